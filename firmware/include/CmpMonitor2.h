/*
 * CmpMonitor2.h - the monitoring services (group 0x1B): reads and writes variables. codesys-v3-protocol 4.9.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: docs/protocol.md.
 */
#ifndef CMPMONITOR2_H
#define CMPMONITOR2_H

#include "CmpItf.h"

RTS_RESULT CmpMonitor2_Hook(CMP_HOOK hook);

#endif
