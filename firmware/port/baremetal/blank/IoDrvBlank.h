/*
 * IoDrvBlank.h - a driver that does nothing, to be copied.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IODRVBLANK_H
#define IODRVBLANK_H

#include "CmpItf.h"

/* Component numbers from 0x8000 on are yours. */
enum { CMPID_IoDrvBlank = 0x8000 };

RTS_RESULT IoDrvBlank_Hook(CMP_HOOK hook);

#endif
