/*
 * CmpLogSrv.h - the log services (group 5). codesys-v3-protocol 4.10.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: docs/protocol.md.
 */
#ifndef CMPLOGSRV_H
#define CMPLOGSRV_H

#include "CmpItf.h"

RTS_RESULT CmpLogSrv_Hook(CMP_HOOK hook);

#endif
