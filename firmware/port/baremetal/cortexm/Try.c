/*
 * Try.c - enters and leaves what runs in SysExceptTry; gates of C functions.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Try.h"

#include "ThumbStep.h"

/* At the bottom of RAM, the deepest first: what gets past its slot hits one that is idle now, or no memory at all. */
__attribute__((section(".bss.iec_stack"), aligned(IEC_STACK_ALIGN))) static IEC_STACK stacks[APP_MAX_TASKS];

TRY_STATE TryState;

void TryInit(void)
{
    TryState.top = TryState.tries;
    TryProtectRuntime((uintptr_t)stacks);
    for (RTS_UI32 i = 0; i < APP_MAX_TASKS; i++) {
        TryState.tries[i].first = (FRAME *)stacks[APP_MAX_TASKS - i] - 1;
        if (!RTS_IEC_UNPRIVILEGED)
            MpuProtect(MPU_IEC_STACK + i, (uintptr_t)stacks[i], STACK_GUARD_LOG2, MPU_NO_ACCESS);
    }
}

/* ---- entering and leaving ---- */

/* The function given to SysExceptTry returned. A store that is on its way and fails is to fail before we leave. */
__attribute__((naked)) static void try_return(void)
{
    __asm__ volatile("dsb\n\tisb\n\tmovs r0, #0\n\tsvc 0");
}

/* Leaves the running Try. */
__attribute__((naked, noreturn)) void TryRaise(RTS_UI32 code, uintptr_t address, const void *stack, uintptr_t link)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(stack);
    RTS_UNUSED(link);
    __asm__ volatile("svc 0");
}

/* Enters fn(arg) by SVC; comes back with the code in the low and the address in the high word. Whatever fn did to the
 * registers that a function has to keep, they are as before: the interrupted task below needs its own. */
__attribute__((naked, noinline)) static RTS_UI64 try_enter(void (*fn)(void *arg), void *arg)
{
    RTS_UNUSED(fn);
    RTS_UNUSED(arg);
    __asm__ volatile("push {r3-r11, lr}\n\t"
#ifdef __ARM_FP
                     "vpush {d8-d15}\n\t"
#endif
                     "svc 0\n\t"
#ifdef __ARM_FP
                     "vpop {d8-d15}\n\t"
#endif
                     "pop {r3-r11, pc}");
}

__attribute__((used)) static RTS_UI32 enter_try(FRAME *caller, RTS_UI32 exc_return)
{
    TRY *try = TryState.top;
    if (try == TryState.tries + APP_MAX_TASKS)
        ResetNow(RESET_FATAL, caller->pc);
    FRAME *frame = try->first;
    TryState.top = try + 1;
    try->entered = caller;
    try->outer_process = TryProcessStack();
    try->exc_return = exc_return;
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    try->outer_tries = TryState.newest;
#endif
    frame->r0 = caller->r1;
    frame->lr = (RTS_UI32)(uintptr_t)try_return;
    frame->pc = caller->r0 & ~1u;
    frame->xpsr = XPSR_THUMB;
    TrySetProcessStack(frame);
    TryTakeRights(try);
    return (RTS_UI32)EXC_RETURN_THREAD_PSP;
}

/* True if the stack can be read from this address on. An address in the guard or below it is not in the stack. */
static bool is_readable(const TRY *try, uintptr_t stack)
{
    return stack - TryStackEnd(try) < RTS_IEC_STACK_SIZE - IEC_STACK_GUARD;
}

/* Drops what is on the process stack. An FPU context that waits there for being saved is given up by the return,
 * because try_enter used the FPU, so that the frame returned to has one too. */
__attribute__((used)) RTS_UI32 TryLeave(RTS_UI32 code, RTS_UI32 address, uintptr_t stack, uintptr_t link)
{
    TRY *try = --TryState.top;
    if (code != RTSEXCPT_NOEXCEPTION && is_readable(try, stack))
        SysExceptTrace(address, (const uintptr_t *)stack, (const uintptr_t *)(try->first + 1), link);
    try->entered->r0 = code;
    try->entered->r1 = address;
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    TryState.newest = try->outer_tries;
#endif
    TrySetProcessStack(try->outer_process);
    TryGiveBackRights(try);
    return try->exc_return;
}

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    RTS_UI64 result = try_enter(fn, arg);
    exception->code = (RTS_UI32)result;
    exception->address = (uintptr_t)(result >> 32);
    return exception->code == RTSEXCPT_NOEXCEPTION;
}

uintptr_t TryStackBefore(const FRAME *frame, RTS_UI32 exc_return)
{
    enum { FPU_SIZE = 18 * 4 };
    if (EXCEPT_MAX_CALLS == 0)
        return 0;
    uintptr_t end = (uintptr_t)(frame + 1) + (exc_return & EXC_RETURN_BASIC ? 0 : FPU_SIZE);
    return end + (frame->xpsr & XPSR_ALIGNED ? 4 : 0);
}

#if BP_MAX > 0
bool ThumbMayRead(uintptr_t address, RTS_UI32 size)
{
    const TRY *try = TryState.top - 1;
    return address - TryStackSlot(try) <= RTS_IEC_STACK_SIZE - size ||
           (SysExceptIsCode(address) && SysExceptIsCode(address + size - 1));
}
#endif

/* ---- gates ---- */

#if RTS_IEC_UNPRIVILEGED

/* A function that was called by a gate returns here. This gives up the privileges and returns to the caller of the gate.
 * The result is in r0, r1. */
__attribute__((naked)) static void gate_return(void)
{
    __asm__ volatile("movw r2, #:lower16:%c0\n\tmovt r2, #:upper16:%c0\n\tldr r2, [r2]\n\t"
                     "ldr lr, [r2, %1]\n\tmov r3, #0\n\tstr r3, [r2, %1]\n\t"
                     "mrs r3, control\n\torr r3, %2\n\tmsr control, r3\n\tisb\n\tbx lr" ::"i"(&TryState.top),
                     "i"((int)offsetof(TRY, gate) - (int)sizeof(TRY)), "i"(CONTROL_NPRIV));
}

/* A function with a gate that calls another by its gate has the privileges. */
__attribute__((used)) static void open_gate(FRAME *frame)
{
    TRY *try = TryState.top - 1;
    if (try->gate != 0)
        return;
    try->gate = frame->lr;
    frame->lr = (RTS_UI32)(uintptr_t)gate_return;
    TrySetControl(0);
}

/* Goes to 1 unless the SVC was that of a gate. Most code is past the gates. */
#define LOOK_FOR_A_GATE                                                                                          \
    "mrs r0, psp\n\tldr r2, [r0, #24]\n\tmovw r3, #:lower16:gates_end\n\tmovt r3, #:upper16:gates_end\n\t"       \
    "cmp r2, r3\n\tbhs 1f\n\tmovw r3, #:lower16:gates_start\n\tmovt r3, #:upper16:gates_start\n\tcmp r2, r3\n\t" \
    "blo 1f\n\tpush {r3, lr}\n\tbl open_gate\n\tpop {r3, pc}\n"
#else
#define LOOK_FOR_A_GATE ""
#endif

/* ---- the handler of SVC ---- */

/* Functions that are called here have names that no other source has: the program is optimised as a whole, which renames
 * static functions of the same name. */

/* From the main stack the call enters. From the process stack it leaves, with what is in r0 to r3 of its frame, unless
 * it is that of a gate. */
__attribute__((naked)) void SvcHandler(void);
void SvcHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 2f\n\tmrs r0, msp\n\tmov r1, lr\n\tbl enter_try\n\tbx r0\n"
                     "2:\n\t" LOOK_FOR_A_GATE "1:\n\tmrs r12, psp\n\tldm r12, {r0-r3}\n\tbl TryLeave\n\tbx r0");
}
