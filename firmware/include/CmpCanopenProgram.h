/*
 * CmpCanopenProgram.h - the manager of a CANopen network replaces, starts and stops the program of this device: 1F50h to
 * 1F57h (CanopenProgram.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An image takes the way of all downloads (AppDownload.h): into the idle slot, beside the running program. The command
 * "start" checks it and commits it. While the device has a password all commands are refused.
 */
#ifndef CMPCANOPENPROGRAM_H
#define CMPCANOPENPROGRAM_H

#include "CmpItf.h"

RTS_RESULT CmpCanopenProgram_Hook(CMP_HOOK hook);

#endif
