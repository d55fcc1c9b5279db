/*
 * ThreadState.h - what a signal handler sees of its thread on macOS: as ../linux/ThreadState.h says.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef THREADSTATE_H
#define THREADSTATE_H

#include "SysExcept.h"

#include <mach/mach.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <sys/ucontext.h>

#define BREAK_SIGNAL SIGUSR2 /* there are no real-time signals */

typedef struct {
    uintptr_t address, stack, link;
} PLACE;

static inline const _STRUCT_ARM_THREAD_STATE64 *state_of(const void *ucontext)
{
    return &((const ucontext_t *)ucontext)->uc_mcontext->__ss;
}

static inline PLACE place_of(const void *ucontext)
{
    const _STRUCT_ARM_THREAD_STATE64 *at = state_of(ucontext);
    return (PLACE){.address = at->__pc, .stack = at->__sp, .link = at->__lr};
}

#define REGISTERS_KIND EXCEPT_REGISTERS_AARCH64

static inline void read_registers(const void *ucontext, uintptr_t fault, uintptr_t values[EXCEPT_REGISTERS])
{
    enum { NUMBERED = 29, FP = NUMBERED, LR, SP, PC, STATE, FAULT };
    const _STRUCT_ARM_THREAD_STATE64 *at = state_of(ucontext);
    memcpy(values, at->__x, NUMBERED * sizeof(values[0]));
    values[FP] = at->__fp;
    values[LR] = at->__lr;
    values[SP] = at->__sp;
    values[PC] = at->__pc;
    values[STATE] = at->__cpsr;
    values[FAULT] = fault;
}

static inline RTS_I64 thread_used_ns(pthread_t thread)
{
    thread_basic_info_data_t info;
    mach_msg_type_number_t count = THREAD_BASIC_INFO_COUNT;
    if (thread_info(pthread_mach_thread_np(thread), THREAD_BASIC_INFO, (thread_info_t)&info, &count) != KERN_SUCCESS) {
        return -1;
    }
    RTS_I64 seconds = (RTS_I64)info.user_time.seconds + info.system_time.seconds;
    RTS_I64 us = (RTS_I64)info.user_time.microseconds + info.system_time.microseconds;
    return seconds * 1000000000 + us * 1000;
}

#endif
