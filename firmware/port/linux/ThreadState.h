/*
 * ThreadState.h - what a signal handler sees of its thread on Linux: for SysExcept.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef THREADSTATE_H
#define THREADSTATE_H

#include "SysExcept.h"

#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <time.h>
#include <ucontext.h>

#define BREAK_SIGNAL (SIGRTMIN + 5) /* clear of what debuggers and libraries use; known at run time only */

/* Where a thread was interrupted. `link`: the link register, 0 on processors without one. */
typedef struct {
    uintptr_t address, stack, link;
} PLACE;

/* place_of; read_registers: those of a fault, as REGISTERS_KIND orders them, and the address that could not be accessed */
#if defined(__x86_64__)

static inline PLACE place_of(const void *ucontext)
{
    const greg_t *registers = ((const ucontext_t *)ucontext)->uc_mcontext.gregs;
    return (PLACE){.address = (uintptr_t)registers[REG_RIP], .stack = (uintptr_t)registers[REG_RSP]};
}

#define REGISTERS_KIND EXCEPT_REGISTERS_X86_64

static inline void read_registers(const void *ucontext, uintptr_t fault, uintptr_t values[EXCEPT_REGISTERS])
{
    static const RTS_UI8 order[EXCEPT_REGISTERS - 1] = {REG_RAX, REG_RBX, REG_RCX, REG_RDX, REG_RSI, REG_RDI,
                                                        REG_RBP, REG_RSP, REG_R8,  REG_R9,  REG_R10, REG_R11,
                                                        REG_R12, REG_R13, REG_R14, REG_R15, REG_RIP, REG_EFL};
    const greg_t *registers = ((const ucontext_t *)ucontext)->uc_mcontext.gregs;
    for (size_t i = 0; i < RTS_COUNT(order); i++) {
        values[i] = (uintptr_t)registers[order[i]];
    }
    values[RTS_COUNT(order)] = fault;
}

#elif defined(__aarch64__)

static inline PLACE place_of(const void *ucontext)
{
    const mcontext_t *at = &((const ucontext_t *)ucontext)->uc_mcontext;
    return (PLACE){.address = at->pc, .stack = at->sp, .link = at->regs[30]};
}

#define REGISTERS_KIND EXCEPT_REGISTERS_AARCH64

static inline void read_registers(const void *ucontext, uintptr_t fault, uintptr_t values[EXCEPT_REGISTERS])
{
    enum { GENERAL = 31, SP = GENERAL, PC, STATE, FAULT };
    const mcontext_t *at = &((const ucontext_t *)ucontext)->uc_mcontext;
    memcpy(values, at->regs, GENERAL * sizeof(values[0]));
    values[SP] = at->sp;
    values[PC] = at->pc;
    values[STATE] = at->pstate;
    values[FAULT] = fault;
}

#elif defined(__arm__)

static inline PLACE place_of(const void *ucontext)
{
    const mcontext_t *at = &((const ucontext_t *)ucontext)->uc_mcontext;
    return (PLACE){.address = at->arm_pc, .stack = at->arm_sp, .link = at->arm_lr};
}

#define REGISTERS_KIND EXCEPT_REGISTERS_ARM

static inline void read_registers(const void *ucontext, uintptr_t fault, uintptr_t values[EXCEPT_REGISTERS])
{
    const mcontext_t *at = &((const ucontext_t *)ucontext)->uc_mcontext;
    const uintptr_t read[EXCEPT_REGISTERS] = {at->arm_r0, at->arm_r1, at->arm_r2, at->arm_r3, at->arm_r4,   at->arm_r5,
                                              at->arm_r6, at->arm_r7, at->arm_r8, at->arm_r9, at->arm_r10,  at->arm_fp,
                                              at->arm_ip, at->arm_sp, at->arm_lr, at->arm_pc, at->arm_cpsr, fault};
    memcpy(values, read, sizeof read);
}

#else
#error "ThreadState.h: say where this architecture keeps these registers in its ucontext_t."
#endif

/* Processor time that a thread has taken [ns], -1: it is not known. */
static inline RTS_I64 thread_used_ns(pthread_t thread)
{
    clockid_t clock;
    struct timespec used;
    if (pthread_getcpuclockid(thread, &clock) != 0 || clock_gettime(clock, &used) != 0) {
        return -1;
    }
    return (RTS_I64)used.tv_sec * 1000000000 + used.tv_nsec;
}

#endif
