/*
 * CmpPlcShell.h - the PLC shell (group 0x11): commands and answers in words. codesys-v3-protocol 4.15.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The commands are those that published clients send, and no more: none reads memory or files. Requests and replies:
 * docs/protocol.md.
 */
#ifndef CMPPLCSHELL_H
#define CMPPLCSHELL_H

#include "CmpItf.h"

RTS_RESULT CmpPlcShell_Hook(CMP_HOOK hook);

#endif
