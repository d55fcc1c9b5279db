/*
 * TryDebug.c - halts a program at faults and traps, and goes on with it, for a debugger.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Try.h"

#include <string.h>

#include "SysDebug.h"
#include "ThumbStep.h"

#if BP_MAX > 0

/*
 * A halted task leaves its Try as by an exception. Its stack stays: no cycle starts before main has run the rest of this
 * one, in a Try of its own that goes on with these registers. A step is one instruction with interrupts masked, so that no
 * other task executes the code meanwhile.
 */
static struct {
    PF_SYS_DEBUG handler;
    SYS_DEBUG_STOP stop; /* of the halted task */
    FRAME *frame;
    FRAME *first;
    FRAME entered_over; /* what enter_try overwrites: the outermost stack begins there, which may be that of the task */
    RTS_UI32 exc_return;
    RTS_UI32 saved[TRY_SAVED];
#ifdef __ARM_FP
    RTS_UI32 fpu[16];
#endif
    bool steps;
    bool ends_at_own; /* at a trap that is nothing but the end of the step */
    uintptr_t next;
    RTS_UI32 original;
    RTS_UI32 flags;
    struct {
        RTS_UI32 status, address;
    } fault, halted_at; /* the newest one, and that of the halted task */
} debug;

void SysDebugSetHandler(PF_SYS_DEBUG handler)
{
    debug.handler = handler;
}

static RTS_UI32 frame_size(RTS_UI32 exc_return)
{
    enum { FPU_SIZE = 18 * 4 };
    return sizeof(FRAME) + (exc_return & EXC_RETURN_BASIC ? 0 : FPU_SIZE);
}

static void get_registers(THUMB_REGISTERS *at, const FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved)
{
    memcpy(at->r, frame, 4 * sizeof at->r[0]);
    memcpy(at->r + 4, saved, TRY_SAVED * sizeof at->r[0]);
    at->r[12] = frame->r12;
    at->r[13] = TryStackBefore(frame, exc_return);
    at->r[14] = frame->lr;
    at->r[15] = frame->pc;
    at->flags = frame->xpsr;
}

/* The frame moves with the stack pointer: that of code that goes on is right above it. */
static void put_registers(const THUMB_REGISTERS *at, FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved)
{
    RTS_UI32 size = frame_size(exc_return);
    RTS_UI32 below = at->r[13] - size;
    FRAME *moved = (FRAME *)(uintptr_t)(below & ~7u);

    memmove(moved, frame, size);
    memcpy(moved, at->r, 4 * sizeof at->r[0]);
    memcpy(saved, at->r + 4, TRY_SAVED * sizeof at->r[0]);
    moved->r12 = at->r[12];
    moved->lr = at->r[14];
    moved->pc = at->r[15] & ~1u;
    moved->xpsr = (at->flags & ~(RTS_UI32)(XPSR_ALIGNED | XPSR_THUMB)) | (at->r[15] & 1 ? XPSR_THUMB : 0) |
                  (below & 4 ? XPSR_ALIGNED : 0);
    TrySetProcessStack(moved);
}

void TryNoteFault(RTS_UI32 cfsr)
{
    enum { CFSR_BFARVALID = 1 << 15 };
    debug.fault.status = cfsr;
    debug.fault.address = cfsr & CFSR_MMARVALID ? SCB_MMFAR : cfsr & CFSR_BFARVALID ? SCB_BFAR : 0;
}

#if EXCEPT_REGISTERS > 0
void TryNoteRegisters(const FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved)
{
    enum { GENERAL = 16 };
    THUMB_REGISTERS at;
    uintptr_t values[EXCEPT_REGISTERS];

    get_registers(&at, frame, exc_return, saved);
    memcpy(values, at.r, sizeof at.r);
    values[GENERAL] = at.flags;
    values[GENERAL + 1] = debug.fault.status;
    values[GENERAL + 2] = debug.fault.address;
    SysExceptNoteRegisters((const uintptr_t *)(uintptr_t)at.r[13], EXCEPT_REGISTERS_ARMV7M, values);
}
#endif

static void tell_debugger(const SYS_DEBUG_STOP *stop, RTS_UI32 code)
{
    SYS_DEBUG_STOP other = *stop;
    other.code = code;
    (void)debug.handler(&other);
}

static void begin_step(FRAME *frame)
{
    debug.flags = frame->xpsr;
    debug.next = frame->pc + ThumbSize(*(const RTS_UI16 *)(uintptr_t)frame->pc);
    debug.ends_at_own = !SysDebugIsTrap(debug.next);
    if (debug.ends_at_own)
        (void)SysDebugWriteTrap(debug.next, &debug.original);
    frame->xpsr = ThumbAlone(frame->xpsr);
    debug.steps = true;
    (void)CpuMask();
}

/* True if that is all the trap was there for. */
static bool end_step(FRAME *frame)
{
    debug.steps = false;
    if (debug.ends_at_own)
        SysDebugRestore(debug.next, debug.original);
    if (frame->pc != debug.next)
        return false;
    frame->xpsr = ThumbAfter(debug.flags, frame->xpsr);
    return debug.ends_at_own;
}

/* False after the last instruction of the code, which could not go on there. */
static bool has_next(const FRAME *frame)
{
    uintptr_t next = frame->pc + ThumbSize(*(const RTS_UI16 *)(uintptr_t)frame->pc);
    return SysExceptIsCode(next + 1) && SysExceptIsCode(next + SysDebugTrapSize(next) - 1);
}

/* The handler of the trap has taken it out. */
static RTS_UI32 pass(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved, const SYS_DEBUG_STOP *stop)
{
    THUMB_REGISTERS at;
    THUMB_STEP done;

    get_registers(&at, frame, exc_return, saved);
    done = ThumbStep(&at);
    if (done == THUMB_STRAIGHT && has_next(frame)) {
        begin_step(frame);
        return exc_return;
    }
    tell_debugger(stop, RTSEXCPT_NOEXCEPTION);
    if (done != THUMB_DONE)
        return TryLeave(RTSEXCPT_ACCESS_VIOLATION, frame->pc, stop->stack, frame->lr);
    put_registers(&at, frame, exc_return, saved);
    return exc_return;
}

static RTS_UI32 halt(FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved, const SYS_DEBUG_STOP *stop)
{
    debug.stop = *stop;
    debug.frame = frame;
    debug.first = TryState.top[-1].first;
    debug.exc_return = exc_return;
    debug.halted_at.status = debug.fault.status;
    debug.halted_at.address = debug.fault.address;
    memcpy(debug.saved, saved, sizeof debug.saved);
#ifdef __ARM_FP
    __asm__ volatile("vstm %0, {s16-s31}" ::"r"(debug.fpu) : "memory"); /* the others are in the frame by that */
#endif
    return TryLeave(SYS_DEBUG_HALTED, frame->pc, 0, 0);
}

/* 0: the exception leaves the Try. */
static RTS_UI32 act(SYS_DEBUG_ACTION action, FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved,
                    const SYS_DEBUG_STOP *stop)
{
    switch (action) {
    case SYS_DEBUG_GO:
        return exc_return;
    case SYS_DEBUG_PASS:
        return pass(frame, exc_return, saved, stop);
    case SYS_DEBUG_HALT:
        return halt(frame, exc_return, saved, stop);
    default:
        return 0;
    }
}

/* Runs in the Try that goes on with what is halted: its trap puts that in its place. */
__attribute__((naked)) static void resume_halted(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("udf #0");
}

static RTS_UI32 resume(RTS_UI32 *saved)
{
    TRY *try = TryState.top - 1;
    SYS_DEBUG_STOP stop = debug.stop;
    RTS_UI32 goes_to;

    *try->first = debug.entered_over;
    try->first = debug.first;
    TryAllowStack(TryStackSlot(try));
    TrySetProcessStack(debug.frame);
    memcpy(saved, debug.saved, sizeof debug.saved);
#ifdef __ARM_FP
    __asm__ volatile("vldm %0, {s16-s31}" ::"r"(debug.fpu) : "memory");
    TryDropFpuContext();
#endif
    stop.code = SYS_DEBUG_HALTED;
    goes_to = act(debug.handler(&stop), debug.frame, debug.exc_return, saved, &stop);
    if (goes_to != 0)
        return goes_to;
    debug.fault.status = debug.halted_at.status;
    debug.fault.address = debug.halted_at.address;
    TryNoteRegisters(debug.frame, debug.exc_return, saved);
    return TryLeave(debug.stop.code, debug.stop.address, debug.stop.stack, debug.stop.link);
}

bool SysDebugResume(RTS_EXCEPTION *exception)
{
    FRAME *first = TryState.tries[0].first;
    debug.entered_over = *first;
    bool ended = SysExceptTry(resume_halted, (void *)(uintptr_t)debug.stop.arg, exception);

    TryState.tries[0].first = first;
    return ended;
}

/* An error that the program or the runtime found, for the debugger. */
__attribute__((naked, noreturn)) static void raise_to_debugger(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(stack);
    __asm__ volatile("udf #0");
}

void TryDebugRaised(RTS_UI32 code, uintptr_t address, const void *stack)
{
    if (debug.handler != NULL)
        raise_to_debugger(code, address, stack);
}

static RTS_UI32 debug_raised(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved, SYS_DEBUG_STOP *stop)
{
    stop->code = frame->r0;
    stop->address = frame->r1;
    stop->stack = frame->r2;
    stop->link = 0;
    if (debug.handler(stop) == SYS_DEBUG_HALT)
        return halt(frame, exc_return, saved, stop);
    return TryLeave(stop->code, stop->address, stop->stack, 0);
}

RTS_UI32 TryDebugFault(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved, RTS_UI32 code)
{
    const TRY *try = TryState.top - 1;
    SYS_DEBUG_STOP stop = {.code = code,
                           .address = frame->pc,
                           .stack = TryStackBefore(frame, exc_return),
                           .end = (uintptr_t)(try->first + 1),
                           .link = frame->lr,
                           .arg = (const void *)(uintptr_t)try->entered->r1};

    if (debug.handler == NULL)
        return 0;
    if (debug.steps) {
        bool was_all = end_step(frame);
        tell_debugger(&stop, RTSEXCPT_NOEXCEPTION);
        if (was_all)
            return exc_return;
    }
    if (frame->pc == ((RTS_UI32)(uintptr_t)resume_halted & ~1u))
        return resume(saved);
    if (frame->pc == ((RTS_UI32)(uintptr_t)raise_to_debugger & ~1u))
        return debug_raised(frame, exc_return, saved, &stop);
    if (!SysExceptIsCode(frame->pc))
        return 0;
    if (code == RTSEXCPT_ILLEGAL_INSTRUCTION && SysDebugIsTrap(frame->pc))
        stop.code = RTSEXCPT_BREAKPOINT;
    return act(debug.handler(&stop), frame, exc_return, saved, &stop);
}

#endif
