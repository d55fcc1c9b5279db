/*
 * CmpDevice.h - the device services (group 1): identity, login, echo. codesys-v3-protocol 4.4, 4.5.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: docs/protocol.md.
 */
#ifndef CMPDEVICE_H
#define CMPDEVICE_H

#include "CmpItf.h"

enum { RTS_VERSION = 0x00020000 }; /* of this runtime: bytes major.minor.patch.revision from the highest */

RTS_RESULT CmpDevice_Hook(CMP_HOOK hook);

#endif
