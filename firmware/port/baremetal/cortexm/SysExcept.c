/*
 * SysExcept.c - exceptions of application code on Armv7-M: the handlers of faults, and what raises and aborts.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Try.h says how what runs in a Try is entered and left.
 */
#include "SysExcept.h"

#include "BareMetal.h"
#include "Try.h"
#include "rts_config.h"

enum { SHCSR_PENDING = 0xF << 12 }; /* UsageFault, MemManage, BusFault, SVCall */

void SysExceptInit(void)
{
    enum { MPU_ENABLE_WITH_BACKGROUND = 5 };
    /* Where NULL points are the vectors, which only the hardware reads: as many eighths of 32 bytes as they fill. */
    enum { NULL_LOG2 = 8, NULL_EIGHTHS = (VECTOR_IRQ + BOARD_IRQ_COUNT) * 4 / 32 };
    const RTS_UI32 behind_vectors = NULL_EIGHTHS < 8 ? MPU_WITHOUT_EIGHTHS(0xFF << NULL_EIGHTHS) : 0;
    extern RTS_UI8 stack_bottom[];
    TryInit();
    MpuProtect(MPU_NULL, 0, NULL_LOG2, MPU_NO_ACCESS | behind_vectors);
    MpuProtect(MPU_STACK, (uintptr_t)stack_bottom, STACK_GUARD_LOG2, MPU_NO_ACCESS);
    if (MPU_TYPE != 0)
        MPU_CTRL = MPU_ENABLE_WITH_BACKGROUND;
    CpuBarrier();
}

/* ---- faults ---- */

/* The return address on the process stack that is next to its end: the fault's own frame was lost. */
static uintptr_t find_caller(const TRY *try)
{
    const RTS_UI32 *end = (const RTS_UI32 *)(try->first + 1);
    for (const RTS_UI32 *word = (const RTS_UI32 *)TryStackEnd(try); word < end; word++)
        if (SysExceptIsReturn(*word))
            return (*word & ~1u) - 2;
    return 0;
}

/* The frame could not be pushed, was pushed below the end, or what is there was hit by the last push that had no
 * room: of 16 registers of an FPU, say. */
static bool is_overflow(RTS_UI32 cfsr, const FRAME *frame, uintptr_t end)
{
    enum { PUSH_MAX = IEC_STACK_GUARD != 0 ? IEC_STACK_GUARD : 64 };
    return (cfsr & CFSR_STACKING) || (uintptr_t)frame < end ||
           ((cfsr & CFSR_MMARVALID) && end - 1 - SCB_MMFAR < PUSH_MAX);
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
static uintptr_t address_of(RTS_UI32 cfsr, RTS_UI32 code, const FRAME *frame, const TRY *try)
{
    if (cfsr & CFSR_STACKING)
        return find_caller(try);
    if ((cfsr & (CFSR_IACCVIOL | CFSR_IBUSERR | CFSR_INVSTATE)) ||
        (code == RTSEXCPT_STACK_OVERFLOW && SysExceptIsCode(frame->lr)))
        return (frame->lr & ~1u) - 2;
    return frame->pc;
}

static void clear_fault(RTS_UI32 cfsr)
{
    SCB_CFSR = cfsr;
    SCB_HFSR = SCB_HFSR;
    /* A fault of the stacking is still pending. It belongs to the function that ends here. */
    SCB_SHCSR &= ~(RTS_UI32)SHCSR_PENDING;
    CpuRestore(0); /* the fault may have been in a place where interrupts are masked */
}

/* Functions that handlers call have names that no other source has: the program is optimised as a whole, which renames
 * static functions of the same name. */

#if RTS_STRUCTURED_EXCEPTION_HANDLING

/* A fault on the main stack, handled on a stack of its own: where to return to in the high word, with which stack pointer
 * in the low one. */
__attribute__((used)) static RTS_UI64 catch_in_runtime(FRAME *frame, RTS_UI32 exc_return)
{
    enum { EXC_RETURN_THREAD = 8, XPSR_EXCEPTION = 0x1FF, PLACE_UNKNOWN = 0x1FF };
    RTS_UI32 cfsr = SCB_CFSR;
    bool lost = (cfsr & CFSR_STACKING) != 0;
    RTS_UI32 main_or_not = exc_return & EXC_RETURN_THREAD ? 0 : PLACE_UNKNOWN;
    RTS_UI32 place = lost ? main_or_not : frame->xpsr & XPSR_EXCEPTION;
    uintptr_t address = lost ? 0 : frame->pc;
    RTS_UI32 code = lost ? (RTS_UI32)RTSEXCPT_STACK_OVERFLOW : code_of(cfsr);
    RTS_TRY *found = SysExceptCatch(&TryState.newest, place, code, address, (uintptr_t)frame);

    if (found == NULL)
        ResetNow(RESET_FATAL, address);
    clear_fault(cfsr);
    return (RTS_UI64)(exc_return | EXC_RETURN_BASIC) << 32 | (uintptr_t)TryFrameTo(found, place, exc_return);
}

enum { FAULT_STACK_WORDS = 48 };
static __attribute__((aligned(8))) RTS_UI32 fault_stack[FAULT_STACK_WORDS];

#endif

/* ---- handlers ---- */

#if BP_MAX > 0
#define SAVE_THE_OTHERS "push {r4-r11}\n\tmov r2, sp\n\t"
#define LOAD_THE_OTHERS "pop {r4-r11}\n\t"
#else
#define SAVE_THE_OTHERS ""
#define LOAD_THE_OTHERS ""
#endif

/* Hands the frame that the exception pushed, and EXC_RETURN, to `function`, and returns to where that says. */
#define DISPATCH(function)                                                                      \
    __asm__ volatile("tst lr, #4\n\tite eq\n\tmrseq r0, msp\n\tmrsne r0, psp\n\tmov r1, lr\n\t" \
                     "bl " #function "\n\tbx r0")

__attribute__((used)) static RTS_UI32 fault_dispatch(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved)
{
    RTS_UI32 goes_to;
    RTS_UI32 cfsr = SCB_CFSR;
    if (!(exc_return & EXC_RETURN_PSP) || TryState.top == TryState.tries)
        ResetNow(RESET_FATAL, cfsr & CFSR_STACKING ? 0 : frame->pc);
    const TRY *try = TryState.top - 1;
    RTS_UI32 code = is_overflow(cfsr, frame, TryStackEnd(try)) ? RTSEXCPT_STACK_OVERFLOW : code_of(cfsr);
    uintptr_t address = address_of(cfsr, code, frame, try);
    TryNoteFault(cfsr);
    clear_fault(cfsr);
    goes_to = TryCatchFault(code, address, frame, exc_return);
    if (goes_to != 0)
        return goes_to;
    if (cfsr & CFSR_STACKING)
        return TryLeave(code, address, 0, 0);
    goes_to = TryDebugFault(frame, exc_return, saved, code);
    if (goes_to != 0)
        return goes_to;
    TryNoteRegisters(frame, exc_return, saved);
    return TryLeave(code, address, TryStackBefore(frame, exc_return), frame->lr);
}

/* A fault on the main stack is one of the runtime; that stack may be at its end, so it is given up. */
__attribute__((naked)) void FaultHandler(void);
#if RTS_STRUCTURED_EXCEPTION_HANDLING
void FaultHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 1f\n\tmrs r0, msp\n\tldr r1, =%c0\n\tmsr msp, r1\n\t"
                     "mov r1, lr\n\tbl catch_in_runtime\n\tmsr msp, r0\n\tbx r1\n\t.ltorg\n"
                     "1:\tmrs r0, psp\n\tmov r1, lr\n\t" SAVE_THE_OTHERS "bl fault_dispatch\n\t" LOAD_THE_OTHERS
                     "bx r0" ::"i"(fault_stack + FAULT_STACK_WORDS));
}
#else
void FaultHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 1f\n\tmrs r0, msp\n\tldr r1, =stack_top\n\tmsr msp, r1\n\tmov r1, lr\n\t"
                     "b fault_dispatch\n\t.ltorg\n1:\tmrs r0, psp\n\tmov r1, lr\n\t" SAVE_THE_OTHERS
                     "bl fault_dispatch\n\t" LOAD_THE_OTHERS "bx r0");
}
#endif

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

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    TryCatchRaised(code, address & ~(uintptr_t)1, stack);
    if (!TryRuns())
        ResetNow(RESET_FATAL, (RTS_UI32)address);
    TryDebugRaised(code, address & ~(uintptr_t)1, stack);
    TryRaise(code, address & ~(uintptr_t)1, stack, 0);
}

void SysExceptShutdown(void)
{
}

/* Where a function that is aborted goes on: it leaves the running Try. By then the processor has taken its frame back,
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
static bool is_raising(const FRAME *frame)
{
    enum { BREAK_SIZE = 4 };
    return frame->pc == ((RTS_UI32)(uintptr_t)TryRaise & ~1u) ||
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

/* We run above the Try, so it is interrupted, and where it is to go on is on its process stack. */
void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    FRAME *frame = TryProcessStack();
    for (const TRY *try = TryState.top; try != TryState.tries; frame = try->outer_process) {
        try--;
        if (try->entered->r1 == (uintptr_t)arg)
            redirect(frame, code);
    }
}
