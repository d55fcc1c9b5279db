/*
 * IecClock.h - the wall clock for programs: SysTimeRtcGet and its like of the library (host/plctool/stdlib/wall_clock.st).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It needs HAS_IecClock in cmp_list.c, and SysTimeRtc.h of the port.
 */
#ifndef IECCLOCK_H
#define IECCLOCK_H

#include "CmpItf.h"

RTS_RESULT IecClock_Hook(CMP_HOOK hook);

#endif
