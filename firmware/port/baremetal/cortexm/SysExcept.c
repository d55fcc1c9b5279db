/*
 * SysExcept.c - exceptions of application code on Armv7-M.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SysExceptTry is called in handler mode (a timer's interrupt) or in main, both on the main stack. It enters the
 * function by SVC in *thread mode on the process stack*, at the priority of the interrupt it came from
 * (CCR.NONBASETHRDENA), and leaves it by another SVC. So whatever goes wrong in it, the frames of faults and interrupts
 * that need to be trusted lie on the main stack, and leaving is the same exception return for a normal end, a checked
 * error, a fault, and a broken loop:
 *
 *   main stack:    ... interrupt | SysExceptTry | frame of the SVC that entered      <- leaving returns to it
 *   process stack: slot of this nesting depth, with a guard of the MPU below
 *
 * Nested only by pre-emption, last in first out: depth d is interrupted while depth d + 1 runs.
 */
#include "SysExcept.h"

#include "CortexM.h"
#include "rts_config.h"

enum { EXC_RETURN_THREAD_PSP = (int)0xFFFFFFFD, EXC_RETURN_PSP = 4, EXC_RETURN_BASIC = 16 };
enum { XPSR_THUMB = 1 << 24, XPSR_ALIGNED = 1 << 9 };
enum { SHCSR_PENDING = 0xF << 12 }; /* UsageFault, MemManage, BusFault, SVCall */
enum { CONTROL_SPSEL = 2 };

enum {
    CFSR_IACCVIOL = 1 << 0,
    CFSR_STACKING = 0x30 | 0x3000, /* MSTKERR, MLSPERR, STKERR, LSPERR */
    CFSR_MMARVALID = 1 << 7,
    CFSR_IBUSERR = 1 << 8,
    CFSR_ILLEGAL = 0xF << 16, /* UNDEFINSTR, INVSTATE, INVPC, NOCP */
    CFSR_INVSTATE = 1 << 17,
    CFSR_UNALIGNED = 1 << 24,
    CFSR_DIVBYZERO = 1 << 25,
};

/* What an exception entry pushes; the FPU's registers may follow. */
typedef struct {
    RTS_UI32 r0, r1, r2, r3, r12, lr, pc, xpsr;
} FRAME;

typedef struct {
    FRAME *first;         /* on the process stack, at the upper end of the slot of this depth; never changes */
    FRAME *entered;       /* on the main stack */
    FRAME *outer_process; /* process stack pointer of the depth below */
    RTS_UI32 exc_return;
} TRY;

typedef RTS_UI8 IEC_STACK[RTS_IEC_STACK_SIZE];
RTS_STATIC_ASSERT(RTS_IEC_STACK_SIZE % 32 == 0 && RTS_IEC_STACK_SIZE >= 256, iec_stack_holds_guard_and_frame);

/* At the bottom of RAM, the deepest first: what gets past a guard hits a slot that is idle now, or no memory at all. */
__attribute__((section(".bss.iec_stack"), aligned(STACK_GUARD))) static IEC_STACK stacks[APP_MAX_TASKS];

static struct {
    TRY *top; /* behind the innermost that runs */
    TRY tries[APP_MAX_TASKS];
} state;

static FRAME *process_stack(void)
{
    FRAME *pointer;
    __asm__ volatile("mrs %0, psp" : "=r"(pointer));
    return pointer;
}

static void set_process_stack(FRAME *pointer)
{
    __asm__ volatile("msr psp, %0" ::"r"(pointer) : "memory");
}

/* Where the stack of a depth ends. */
static uintptr_t stack_slot(const TRY *try)
{
    return (uintptr_t)(try->first + 1) - RTS_IEC_STACK_SIZE;
}

void MpuProtect(RTS_UI32 region, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 attributes)
{
    enum { RBAR_VALID = 1 << 4, RASR_ENABLE = 1, RASR_NORMAL_MEMORY = 6 << 16 };
    if (region >= ((MPU_TYPE >> 8) & 0xFFu))
        return;
    MPU_RBAR = base | RBAR_VALID | region;
    MPU_RASR = attributes | RASR_NORMAL_MEMORY | (log2_size - 1) << 1 | RASR_ENABLE;
    CpuBarrier();
}

void MpuRelease(RTS_UI32 region)
{
    enum { RBAR_VALID = 1 << 4 };
    if (region >= ((MPU_TYPE >> 8) & 0xFFu))
        return;
    MPU_RBAR = RBAR_VALID | region;
    MPU_RASR = 0;
    CpuBarrier();
}

void SysExceptInit(void)
{
    enum { MPU_ENABLE_WITH_BACKGROUND = 5 };
    /* Where NULL points are the vectors, which only the hardware reads: as many eighths of 32 bytes as they fill. */
    enum { NULL_LOG2 = 8, NULL_EIGHTHS = (VECTOR_IRQ + BOARD_IRQ_COUNT) * 4 / 32 };
    const RTS_UI32 behind_vectors = NULL_EIGHTHS < 8 ? MPU_WITHOUT_EIGHTHS(0xFF << NULL_EIGHTHS) : 0;
    extern RTS_UI8 stack_bottom[];
    state.top = state.tries;
    MpuProtect(MPU_NULL, 0, NULL_LOG2, MPU_NO_ACCESS | behind_vectors);
    MpuProtect(MPU_STACK, (uintptr_t)stack_bottom, STACK_GUARD_LOG2, MPU_NO_ACCESS);
    for (RTS_UI32 i = 0; i < APP_MAX_TASKS; i++) {
        state.tries[i].first = (FRAME *)stacks[APP_MAX_TASKS - i] - 1;
        MpuProtect(MPU_IEC_STACK + i, (uintptr_t)stacks[i], STACK_GUARD_LOG2, MPU_NO_ACCESS);
    }
    if (MPU_TYPE != 0)
        MPU_CTRL = MPU_ENABLE_WITH_BACKGROUND;
    CpuBarrier();
}

/* ---- entering and leaving ---- */

/* The function given to SysExceptTry returned. A store that is on its way and fails is to fail before we leave. */
__attribute__((naked)) static void try_return(void)
{
    __asm__ volatile("dsb\n\tisb\n\tmovs r0, #0\n\tsvc 0");
}

/* Leaves the running Try. */
__attribute__((naked, noreturn)) static void try_raise(RTS_UI32 code, uintptr_t address, const void *stack,
                                                       uintptr_t link)
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

__attribute__((used)) static RTS_UI32 enter(FRAME *caller, RTS_UI32 exc_return)
{
    TRY *try = state.top;
    if (try == state.tries + APP_MAX_TASKS)
        ResetNow(RESET_FATAL, caller->pc);
    FRAME *frame = try->first;
    state.top = try + 1;
    try->entered = caller;
    try->outer_process = process_stack();
    try->exc_return = exc_return;
    frame->r0 = caller->r1;
    frame->lr = (RTS_UI32)(uintptr_t)try_return;
    frame->pc = caller->r0 & ~1u;
    frame->xpsr = XPSR_THUMB;
    set_process_stack(frame);
    return (RTS_UI32)EXC_RETURN_THREAD_PSP;
}

/* Whether the stack can be read from there on: it may be in the guard, below it, or not known. */
static int is_readable(const TRY *try, uintptr_t stack)
{
    return stack - (stack_slot(try) + STACK_GUARD) < RTS_IEC_STACK_SIZE - STACK_GUARD;
}

/* Drops what is on the process stack. An FPU context that waits there for being saved is given up by the return,
 * because try_enter used the FPU, so that the frame returned to has one too. */
__attribute__((used)) static RTS_UI32 leave(RTS_UI32 code, RTS_UI32 address, uintptr_t stack, uintptr_t link)
{
    TRY *try = --state.top;
    if (code != RTSEXCPT_NOEXCEPTION && is_readable(try, stack))
        SysExceptTrace(address, (const uintptr_t *)stack, (const uintptr_t *)(try->first + 1), link);
    try->entered->r0 = code;
    try->entered->r1 = address;
    set_process_stack(try->outer_process);
    return try->exc_return;
}

/* Hands the frame that the exception pushed, and EXC_RETURN, to `function`, and returns to where that says. */
#define DISPATCH(function)                                                                      \
    __asm__ volatile("tst lr, #4\n\tite eq\n\tmrseq r0, msp\n\tmrsne r0, psp\n\tmov r1, lr\n\t" \
                     "bl " #function "\n\tbx r0")

/* From the process stack the call leaves, with what is in r0 to r3 of its frame; from the main stack it enters. */
__attribute__((naked)) void SvcHandler(void);
void SvcHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 1f\n\tmrs r0, msp\n\tmov r1, lr\n\tbl enter\n\tbx r0\n"
                     "1:\n\tmrs r12, psp\n\tldm r12, {r0-r3}\n\tbl leave\n\tbx r0");
}

/* The stack pointer before the exception pushed its frame, with or without the FPU's registers; for the trace alone. */
static uintptr_t stack_before(const FRAME *frame, RTS_UI32 exc_return)
{
    enum { FPU_SIZE = 18 * 4 };
    if (EXCEPT_MAX_CALLS == 0)
        return 0;
    uintptr_t end = (uintptr_t)(frame + 1) + (exc_return & EXC_RETURN_BASIC ? 0 : FPU_SIZE);
    return end + (frame->xpsr & XPSR_ALIGNED ? 4 : 0);
}

/* ---- faults ---- */

/* The return address on the process stack that is next to its end: the fault's own frame was lost. */
static uintptr_t find_caller(uintptr_t slot)
{
    const RTS_UI32 *end = (const RTS_UI32 *)(slot + RTS_IEC_STACK_SIZE);
    for (const RTS_UI32 *word = (const RTS_UI32 *)(slot + STACK_GUARD); word < end; word++)
        if (SysExceptIsReturn(*word))
            return (*word & ~1u) - 2;
    return 0;
}

/* The frame could not be pushed, was pushed below the slot, or the guard was hit by the last push that had no room. */
static int is_overflow(RTS_UI32 cfsr, const FRAME *frame, uintptr_t slot)
{
    return (cfsr & CFSR_STACKING) || (uintptr_t)frame < slot + STACK_GUARD ||
           ((cfsr & CFSR_MMARVALID) && SCB_MMFAR - slot < STACK_GUARD);
}

static RTS_UI32 code_of(RTS_UI32 cfsr)
{
    if (cfsr & CFSR_DIVBYZERO)
        return RTSEXCPT_DIVIDEBYZERO;
    if (cfsr & CFSR_UNALIGNED)
        return RTSEXCPT_MISALIGNMENT;
    if (cfsr & CFSR_ILLEGAL)
        return RTSEXCPT_ILLEGAL_INSTRUCTION;
    return cfsr == 0 ? RTSEXCPT_BREAKPOINT : RTSEXCPT_ACCESS_VIOLATION;
}

/* After a jump to nowhere the caller says more than the program counter. So it does when the stack overflows: that is
 * mostly noticed by what clears the variables of a function, which is no function of the application. */
static uintptr_t address_of(RTS_UI32 cfsr, RTS_UI32 code, const FRAME *frame, uintptr_t slot)
{
    if (cfsr & CFSR_STACKING)
        return find_caller(slot);
    if ((cfsr & (CFSR_IACCVIOL | CFSR_IBUSERR | CFSR_INVSTATE)) ||
        (code == RTSEXCPT_STACK_OVERFLOW && SysExceptIsCode(frame->lr)))
        return (frame->lr & ~1u) - 2;
    return frame->pc;
}

__attribute__((used)) static RTS_UI32 fault_dispatch(FRAME *frame, RTS_UI32 exc_return)
{
    RTS_UI32 cfsr = SCB_CFSR;
    if (!(exc_return & EXC_RETURN_PSP) || state.top == state.tries)
        ResetNow(RESET_FATAL, cfsr & CFSR_STACKING ? 0 : frame->pc);
    uintptr_t slot = stack_slot(state.top - 1);
    RTS_UI32 code = is_overflow(cfsr, frame, slot) ? RTSEXCPT_STACK_OVERFLOW : code_of(cfsr);
    uintptr_t address = address_of(cfsr, code, frame, slot);
    SCB_CFSR = cfsr;
    SCB_HFSR = SCB_HFSR;
    /* What could not be stacked stays pending: it belongs to the function that is left now. */
    SCB_SHCSR &= ~(RTS_UI32)SHCSR_PENDING;
    CpuRestore(0); /* the fault may have been in a place where interrupts are masked */
    if (cfsr & CFSR_STACKING)
        return leave(code, address, 0, 0);
    return leave(code, address, stack_before(frame, exc_return), frame->lr);
}

/* A fault on the main stack is one of the runtime; that stack may be at its end, so it is given up. */
__attribute__((naked)) void FaultHandler(void);
void FaultHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 1f\n\tmrs r0, msp\n\tldr r1, =stack_top\n\tmsr msp, r1\n\tmov r1, lr\n\t"
                     "b fault_dispatch\n\t.ltorg\n1:");
    DISPATCH(fault_dispatch);
}

__attribute__((used)) static RTS_UI32 nmi_dispatch(FRAME *frame, RTS_UI32 exc_return)
{
    RTS_UNUSED(exc_return);
    ResetNow(RESET_WATCHDOG, frame->pc);
}

/* The watchdog's last warning. */
__attribute__((naked)) void NmiHandler(void);
void NmiHandler(void)
{
    DISPATCH(nmi_dispatch);
}

/* ---- for the runtime ---- */

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    RTS_UI64 result = try_enter(fn, arg);
    exception->code = (RTS_UI32)result;
    exception->address = (uintptr_t)(result >> 32);
    return exception->code == RTSEXCPT_NOEXCEPTION;
}

static int in_try(void)
{
    RTS_UI32 control;
    __asm__ volatile("mrs %0, control" : "=r"(control));
    return (control & CONTROL_SPSEL) != 0;
}

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    if (!in_try())
        ResetNow(RESET_FATAL, (RTS_UI32)address);
    try_raise(code, address & ~(uintptr_t)1, stack, 0);
}

void SysExceptShutdown(void)
{
}

/* Where a function that is broken goes on: it leaves the running Try. By then the processor has taken its frame back,
 * so that the stack pointer is as it was. */
__attribute__((naked, noreturn)) static void try_break(RTS_UI32 code, uintptr_t address, RTS_UI32 unused,
                                                       uintptr_t link)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(unused);
    RTS_UNUSED(link);
    __asm__ volatile("mov r2, sp\n\tsvc 0");
}

/* Whether it is about to raise an exception: then where it was must not be forgotten. */
static int is_raising(const FRAME *frame)
{
    enum { BREAK_SIZE = 4 };
    return frame->pc == ((RTS_UI32)(uintptr_t)try_raise & ~1u) ||
           frame->pc - ((RTS_UI32)(uintptr_t)try_break & ~1u) < BREAK_SIZE;
}

static void redirect(FRAME *frame, RTS_UI32 code)
{
    if (is_raising(frame))
        return;
    frame->r0 = code;
    frame->r1 = frame->pc;
    frame->r3 = frame->lr;
    frame->pc = (RTS_UI32)(uintptr_t)try_break & ~1u;
    frame->xpsr = (frame->xpsr & XPSR_ALIGNED) | XPSR_THUMB;
}

/* We run above the Try, so it is interrupted, and where it is to go on lies on its process stack. */
void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    FRAME *frame = process_stack();
    for (const TRY *try = state.top; try != state.tries; frame = try->outer_process) {
        try--;
        if (try->entered->r1 == (uintptr_t)arg)
            redirect(frame, code);
    }
}

__attribute__((naked)) void IecCall(const IEC_CONTEXT *context, RTS_UI32 argument, uintptr_t entry)
{
    RTS_UNUSED(context);
    RTS_UNUSED(argument);
    RTS_UNUSED(entry);
    __asm__ volatile("push {r9, lr}\n\t"
                     "ldr r9, [r0, %0]\n\t"
                     "blx r2\n\t"
                     "pop {r9, pc}" ::"i"(offsetof(IEC_CONTEXT, imports)));
}
