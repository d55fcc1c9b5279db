/*
 * rts_config_baremetal.h - how compiled code is entered, and sizes; for the rts_config_*.h of a processor family.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_BAREMETAL_H
#define RTS_CONFIG_BAREMETAL_H

#include "IecCall.h"

#define RTS_ONE_CORE 1

#define SYS_DEBUG_WAITS 0

/* startup.c clears all variables, and whatever ends the runtime is a reset. */
#define RTS_STARTS_ONCE 1

/* A crash is a reset, and the start after it decides. A board with a button that holds the boot project back has 1. */
#ifndef APP_MAY_STAY_STOPPED
#define APP_MAY_STAY_STOPPED 0
#endif

/* No program of a small controller takes this long for a cycle [us]: an endless loop is an exception soon. Its own
 * watchdog does not make it longer: tasks interrupt main, so no tool can talk to the device meanwhile, stop it or send
 * another program, and plctool waits 5 s for an answer. */
#ifndef APP_MAX_CYCLE_US
#define APP_MAX_CYCLE_US 2000000
#endif
#ifndef APP_DEFAULT_WATCHDOG_US
#define APP_DEFAULT_WATCHDOG_US APP_MAX_CYCLE_US
#endif

/* Tasks that wait for an event run in a line of their own, too. */
#ifndef SCHED_EVENTS_IN_TIMERS
#define SCHED_EVENTS_IN_TIMERS 1
#endif

/* 1: IEC code may write its areas and its stack only, and meets an exception elsewhere, if the chip can protect memory
 * (SysExcept.c). 0: it may write all RAM and each peripheral. */
#ifndef RTS_IEC_UNPRIVILEGED
#ifdef __ARM_ARCH_6M__ /* the handler of gates is for Armv7-M (cortexm/SysExcept.c) */
#define RTS_IEC_UNPRIVILEGED 0
#else
#define RTS_IEC_UNPRIVILEGED 1
#endif
#endif

/* Stack of the application code of one task, bytes. RTS_IEC_UNPRIVILEGED 1: a power of 2; 0: a multiple of 32, which are
 * lost to the guard below it. */
#ifndef RTS_IEC_STACK_SIZE
#define RTS_IEC_STACK_SIZE 1024
#endif

#define RTS_LOG2(size) (31 - __builtin_clz(size))

/* The main stack, bytes, a multiple of 32, without what the family adds (CPU_CONTEXTS_SIZE). It holds the check of a new application's image,
 * and on top of it about 210 for each task and 140 for an interrupt above them. */
#ifndef RTS_MAIN_STACK_SIZE
#define RTS_MAIN_STACK_SIZE 2560
#endif

#endif
