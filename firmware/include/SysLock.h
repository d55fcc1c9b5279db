/*
 * SysLock.h - the one lock of the runtime: keeps tasks and main out of each other's way for a moment.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Taken where inputs and outputs are copied to a task and back, and where main writes what tasks use. The holder
 * calls nothing that may block, fail or take long, and runs no IEC code. Longest time: copying the inputs and outputs
 * that one task uses (at most APP_INPUT_SIZE + APP_OUTPUT_SIZE bytes, 6 instructions for each word on a Cortex-M), so
 * that is what a task of higher priority may start later because of it. Not nested.
 *
 * What it is: on Cortex-M all tasks' interrupts masked, devices' go on; on Linux a mutex that lends its holder the
 * priority of a thread that waits; nothing where main calls the tasks one after the other.
 */
#ifndef SYSLOCK_H
#define SYSLOCK_H

#include "CmpStd.h"

/* From a task's context or main, outside of SysExceptTry; not from the interrupts of devices. Returns what Leave
 * needs. */
RTS_UI32 SysLockEnter(void);
void SysLockLeave(RTS_UI32 before);

#endif
