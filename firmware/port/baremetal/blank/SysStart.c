/*
 * SysStart.c - why the runtime starts. Contract: SysStart.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysStart.h"

#include "SysExcept.h"

/* Write here: SYS_START_CRASH after a reset by the watchdog or by a fault handler of yours, SYS_START_POWER after any
 * other, as the chip's reset cause register says. A chip without one keeps a word in RAM that no start-up clears
 * (common/reset.c). As it is nothing is known: an application that ends the runtime in its cycles is started again and
 * again. */
const SYS_START *SysStartGet(void)
{
    static const SYS_START start = {SYS_START_UNKNOWN, 0, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""};
    return &start;
}
