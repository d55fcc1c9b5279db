/*
 * SysExcept.c - exceptions of application code on Armv7-M.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SysExceptTry is called in handler mode (a timer's interrupt) or in main, both on the main stack. It enters the
 * function by SVC in *thread mode on the process stack*, at the priority of the interrupt it came from
 * (CCR.NONBASETHRDENA), and leaves it by another SVC. So whatever goes wrong in it, the frames of faults and interrupts
 * that need to be trusted are on the main stack, and leaving is the same exception return for a normal end, a checked
 * error, a fault, and an aborted loop:
 *
 *   main stack:    ... interrupt | SysExceptTry | frame of the SVC that entered      <- leaving returns to it
 *   process stack: slot of this nesting depth
 *
 * Nested only by pre-emption, last in first out: depth d is interrupted while depth d + 1 runs.
 *
 * Rights (RTS_IEC_UNPRIVILEGED). What runs in a Try is unprivileged. To such code the MPU gives
 *   code and RAM of the architecture (below 1 GiB)  read, execute; writing them takes privileges; without what the
 *                                                   board names as holes
 *   vectors, where NULL points                      nothing, as to all else
 *   areas of the application (AppAreas.c)           read, write
 *   stack slot of the depth that runs               read, write
 * and nothing else: peripherals, the processor's own registers. So a wild store ends in an exception that names
 * it, and has changed nothing but the program's own data. Entering and leaving a Try move one region, that of the
 * stack, and set CONTROL.nPRIV, which says how thread mode goes on; handlers are privileged whatever it says.
 *
 * C functions that a program calls run in the Try, too, with its rights: arithmetic and mathematics as they are. What
 * writes variables of its own, or needs hardware, has a gate (APP_GATE, 8 bytes): an SVC in the section of gates, and a
 * jump to the function. The SVC of no other place gives privileges, so there is no way to them but to call such a
 * function. It runs on the program's stack, and returns through gate_return, which gives the privileges up. That the
 * program called it is the only thing kept of it (TRY.gate): tasks interrupt it, faults and breaks leave it as ever.
 *
 * Otherwise all code is privileged, and each slot has a guard of the MPU at its lower end.
 */
#include "SysExcept.h"

#include "BareMetal.h"
#include "SysDebug.h"
#include "SysExceptCatch.h"
#include "ThumbStep.h"
#include "rts_config.h"

#include <string.h>

enum { EXC_RETURN_THREAD_PSP = (int)0xFFFFFFFD, EXC_RETURN_PSP = 4, EXC_RETURN_BASIC = 16 };
enum { XPSR_THUMB = 1 << 24, XPSR_ALIGNED = 1 << 9 };
enum { SHCSR_PENDING = 0xF << 12 }; /* UsageFault, MemManage, BusFault, SVCall */
enum { CONTROL_NPRIV = 1, CONTROL_SPSEL = 2 };

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
#if RTS_IEC_UNPRIVILEGED
    RTS_UI32 outer_control; /* of the depth below, or of main */
    RTS_UI32 gate;          /* where a function that has a gate returns to; 0: none runs */
#endif
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *outer_tries;
#endif
} TRY;

typedef RTS_UI8 IEC_STACK[RTS_IEC_STACK_SIZE];
RTS_STATIC_ASSERT(RTS_IEC_STACK_SIZE % 32 == 0 && RTS_IEC_STACK_SIZE >= 256, iec_stack_holds_guard_and_frame);

#if RTS_IEC_UNPRIVILEGED
RTS_STATIC_ASSERT((RTS_IEC_STACK_SIZE & (RTS_IEC_STACK_SIZE - 1)) == 0, iec_stack_is_a_region);
enum { IEC_STACK_ALIGN = RTS_IEC_STACK_SIZE };
#else
RTS_STATIC_ASSERT(RTS_IEC_STACK_GUARD == STACK_GUARD, what_is_lost_to_the_guard_is_known);
enum { IEC_STACK_ALIGN = STACK_GUARD };
#endif
enum { IEC_STACK_GUARD = RTS_IEC_STACK_GUARD };

/* At the bottom of RAM, the deepest first: what gets past its slot hits one that is idle now, or no memory at all. */
__attribute__((section(".bss.iec_stack"), aligned(IEC_STACK_ALIGN))) static IEC_STACK stacks[APP_MAX_TASKS];

static struct {
    TRY *top; /* past the innermost that runs */
    TRY tries[APP_MAX_TASKS];
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *newest; /* of rts_try, in all contexts: they nest as interrupts do */
#endif
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

static bool in_try(void)
{
    RTS_UI32 control;
    __asm__ volatile("mrs %0, control" : "=r"(control));
    return (control & CONTROL_SPSEL) != 0;
}

static uintptr_t stack_slot(const TRY *try)
{
    return (uintptr_t)(try->first + 1) - RTS_IEC_STACK_SIZE;
}

/* Where the stack of a depth ends. */
static uintptr_t stack_end(const TRY *try)
{
    return stack_slot(try) + IEC_STACK_GUARD;
}

/* A task that interrupts it moves a region too. */
RTS_NOINLINE void MpuProtect(RTS_UI32 region, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 attributes)
{
    enum { RASR_ENABLE = 1, RASR_NORMAL_MEMORY = 3 << 16 };
    if (region >= ((MPU_TYPE >> 8) & 0xFFu))
        return;
    RTS_UI32 mask = RTS_IEC_UNPRIVILEGED ? CpuMask() : 0;
    MPU_RBAR = base | MPU_RBAR_VALID | region;
    MPU_RASR = attributes | RASR_NORMAL_MEMORY | (log2_size - 1) << 1 | RASR_ENABLE;
    CpuBarrier();
    if (RTS_IEC_UNPRIVILEGED)
        CpuRestore(mask);
}

/* ---- rights ---- */

#if RTS_IEC_UNPRIVILEGED

/* Eighths of the first GiB without memory. Where they read as zeros, a wild jump would execute all of them. */
#ifndef BOARD_MEMORY_HOLES
#define BOARD_MEMORY_HOLES 0
#endif

/* Of the linker script. Where the areas begin and end is a multiple of an eighth of their size, rounded up to a power
 * of 2 (APP_AREAS_ALIGNED): so two regions of that size next to each other hold them. */
extern RTS_UI8 areas_start[], areas_end[];

static void allow_areas(void)
{
    uintptr_t start = (uintptr_t)areas_start;
    RTS_UI32 size = (RTS_UI32)(areas_end - areas_start);
    RTS_UI32 log2 = 32u - (RTS_UI32)__builtin_clz((size - 1) | 0xFF);
    uintptr_t region = start >> log2;
    RTS_UI32 others = ~(((1u << (size >> (log2 - 3))) - 1) << (start >> (log2 - 3) & 7));
    for (RTS_UI32 i = 0; i < 2; i++, others >>= 8)
        MpuProtect(MPU_AREAS + i, (region + i) << log2, log2, MPU_DATA | MPU_WITHOUT_EIGHTHS(others));
}

static void protect_runtime(void)
{
    enum { CODE_AND_RAM_LOG2 = 30, STACK_LOG2 = RTS_LOG2(RTS_IEC_STACK_SIZE) };
    MpuProtect(MPU_MEMORY, 0, CODE_AND_RAM_LOG2, MPU_WRITE_PRIVILEGED | MPU_WITHOUT_EIGHTHS(BOARD_MEMORY_HOLES));
    MpuProtect(MPU_IEC_STACK, (uintptr_t)stacks, STACK_LOG2, MPU_DATA);
    allow_areas();
}

/* The region's size stays. That it moved is seen after the exception return that follows. */
static void allow_stack(uintptr_t slot)
{
    MPU_RBAR = slot | MPU_RBAR_VALID | MPU_IEC_STACK;
}

static RTS_UI32 get_control(void)
{
    RTS_UI32 control;
    __asm__ volatile("mrs %0, control" : "=r"(control));
    return control;
}

/* In a handler, for thread mode: nothing in it but nPRIV is of effect. */
static void set_control(RTS_UI32 control)
{
    __asm__ volatile("msr control, %0" ::"r"(control) : "memory");
}

static void take_rights(TRY *try)
{
    try->outer_control = get_control();
    try->gate = 0;
    set_control(CONTROL_NPRIV);
    allow_stack(stack_slot(try));
}

/* FPU registers of the function that is left may still wait to be saved on its stack, with its rights. Another interrupt
 * may come before the exception return that gives them up: it would save them where these rights do not reach any more.
 * Those that wait for privileged code are of the frame that is returned to. */
static void drop_fpu_context(void)
{
#ifdef __ARM_FP
    enum { FPCCR_LSPACT = 1, FPCCR_USER = 2 };
    RTS_UI32 control = FPU_FPCCR;
    if ((control & (FPCCR_LSPACT | FPCCR_USER)) == (FPCCR_LSPACT | FPCCR_USER))
        FPU_FPCCR = control & ~(RTS_UI32)FPCCR_LSPACT;
#endif
}

/* The slot of the depth below is above; of main, which has all rights, none does, but no task runs then. */
static void give_back_rights(const TRY *try)
{
    drop_fpu_context();
    set_control(try->outer_control);
    allow_stack((uintptr_t)(try->first + 1));
}

#else
#define protect_runtime() ((void)0)
#define take_rights(try) ((void)(try))
#define give_back_rights(try) ((void)(try))
#endif

void SysExceptInit(void)
{
    enum { MPU_ENABLE_WITH_BACKGROUND = 5 };
    /* Where NULL points are the vectors, which only the hardware reads: as many eighths of 32 bytes as they fill. */
    enum { NULL_LOG2 = 8, NULL_EIGHTHS = (VECTOR_IRQ + BOARD_IRQ_COUNT) * 4 / 32 };
    const RTS_UI32 behind_vectors = NULL_EIGHTHS < 8 ? MPU_WITHOUT_EIGHTHS(0xFF << NULL_EIGHTHS) : 0;
    extern RTS_UI8 stack_bottom[];
    state.top = state.tries;
    protect_runtime();
    MpuProtect(MPU_NULL, 0, NULL_LOG2, MPU_NO_ACCESS | behind_vectors);
    MpuProtect(MPU_STACK, (uintptr_t)stack_bottom, STACK_GUARD_LOG2, MPU_NO_ACCESS);
    for (RTS_UI32 i = 0; i < APP_MAX_TASKS; i++) {
        state.tries[i].first = (FRAME *)stacks[APP_MAX_TASKS - i] - 1;
        if (!RTS_IEC_UNPRIVILEGED)
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

__attribute__((used)) static RTS_UI32 enter_try(FRAME *caller, RTS_UI32 exc_return)
{
    TRY *try = state.top;
    if (try == state.tries + APP_MAX_TASKS)
        ResetNow(RESET_FATAL, caller->pc);
    FRAME *frame = try->first;
    state.top = try + 1;
    try->entered = caller;
    try->outer_process = process_stack();
    try->exc_return = exc_return;
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    try->outer_tries = state.newest;
#endif
    frame->r0 = caller->r1;
    frame->lr = (RTS_UI32)(uintptr_t)try_return;
    frame->pc = caller->r0 & ~1u;
    frame->xpsr = XPSR_THUMB;
    set_process_stack(frame);
    take_rights(try);
    return (RTS_UI32)EXC_RETURN_THREAD_PSP;
}

/* Whether the stack can be read from there on: it may be in the guard, below it, or not known. */
static bool is_readable(const TRY *try, uintptr_t stack)
{
    return stack - stack_end(try) < RTS_IEC_STACK_SIZE - IEC_STACK_GUARD;
}

/* Drops what is on the process stack. An FPU context that waits there for being saved is given up by the return,
 * because try_enter used the FPU, so that the frame returned to has one too. */
__attribute__((used)) static RTS_UI32 leave_try(RTS_UI32 code, RTS_UI32 address, uintptr_t stack, uintptr_t link)
{
    TRY *try = --state.top;
    if (code != RTSEXCPT_NOEXCEPTION && is_readable(try, stack))
        SysExceptTrace(address, (const uintptr_t *)stack, (const uintptr_t *)(try->first + 1), link);
    try->entered->r0 = code;
    try->entered->r1 = address;
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    state.newest = try->outer_tries;
#endif
    set_process_stack(try->outer_process);
    give_back_rights(try);
    return try->exc_return;
}

/* ---- gates ---- */

#if RTS_IEC_UNPRIVILEGED

/* Where a function that has a gate returns to: it gives the privileges up, and goes on where the gate was called. The
 * result is in r0, r1. */
__attribute__((naked)) static void gate_return(void)
{
    __asm__ volatile("movw r2, #:lower16:%c0\n\tmovt r2, #:upper16:%c0\n\tldr r2, [r2]\n\t"
                     "ldr lr, [r2, %1]\n\tmov r3, #0\n\tstr r3, [r2, %1]\n\t"
                     "mrs r3, control\n\torr r3, %2\n\tmsr control, r3\n\tisb\n\tbx lr" ::"i"(&state.top),
                     "i"((int)offsetof(TRY, gate) - (int)sizeof(TRY)), "i"(CONTROL_NPRIV));
}

/* A function with a gate that calls another by its gate has the privileges. */
__attribute__((used)) static void open_gate(FRAME *frame)
{
    TRY *try = state.top - 1;
    if (try->gate != 0)
        return;
    try->gate = frame->lr;
    frame->lr = (RTS_UI32)(uintptr_t)gate_return;
    set_control(0);
}

/* Goes to 1 unless the SVC was that of a gate. Most code is past the gates. */
#define LOOK_FOR_A_GATE                                                                                          \
    "mrs r0, psp\n\tldr r2, [r0, #24]\n\tmovw r3, #:lower16:gates_end\n\tmovt r3, #:upper16:gates_end\n\t"       \
    "cmp r2, r3\n\tbhs 1f\n\tmovw r3, #:lower16:gates_start\n\tmovt r3, #:upper16:gates_start\n\tcmp r2, r3\n\t" \
    "blo 1f\n\tpush {r3, lr}\n\tbl open_gate\n\tpop {r3, pc}\n"
#else
#define LOOK_FOR_A_GATE ""
#endif

/* ---- handlers ---- */

/* Hands the frame that the exception pushed, and EXC_RETURN, to `function`, and returns to where that says. */
#define DISPATCH(function)                                                                      \
    __asm__ volatile("tst lr, #4\n\tite eq\n\tmrseq r0, msp\n\tmrsne r0, psp\n\tmov r1, lr\n\t" \
                     "bl " #function "\n\tbx r0")

/* Functions that are called here have names that no other source has: the program is optimised as a whole, which renames
 * static functions of the same name. */

/* From the main stack the call enters. From the process stack it leaves, with what is in r0 to r3 of its frame, unless
 * it is that of a gate. */
__attribute__((naked)) void SvcHandler(void);
void SvcHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 2f\n\tmrs r0, msp\n\tmov r1, lr\n\tbl enter_try\n\tbx r0\n"
                     "2:\n\t" LOOK_FOR_A_GATE "1:\n\tmrs r12, psp\n\tldm r12, {r0-r3}\n\tbl leave_try\n\tbx r0");
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
static uintptr_t find_caller(const TRY *try)
{
    const RTS_UI32 *end = (const RTS_UI32 *)(try->first + 1);
    for (const RTS_UI32 *word = (const RTS_UI32 *)stack_end(try); word < end; word++)
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

/* ---- rts_try ---- */

#if RTS_STRUCTURED_EXCEPTION_HANDLING

#ifdef __ARM_FP
#define SAVE_FPU "vstm r0, {s16-s31}\n\t"
#define LOAD_FPU "vldm r0, {s16-s31}\n\t"
enum { SAVED_BY_TRY = (10 + 16) * 4 };
#else
#define SAVE_FPU ""
#define LOAD_FPU ""
enum { SAVED_BY_TRY = 10 * 4 };
#endif
RTS_STATIC_ASSERT(sizeof(RTS_JMP_BUF) >= SAVED_BY_TRY, buffer_holds_what_is_saved);

__attribute__((naked)) int SysExceptSetJmp(RTS_JMP_BUF buffer)
{
    RTS_UNUSED(buffer);
    __asm__ volatile("mov r1, sp\n\tstmia r0!, {r1, r4-r11, lr}\n\t" SAVE_FPU "movs r0, #0\n\tbx lr");
}

/* Goes on after it. */
__attribute__((naked, noreturn)) static void go_to_catch(const uintptr_t *buffer)
{
    RTS_UNUSED(buffer);
    __asm__ volatile("ldmia r0!, {r1, r4-r11, lr}\n\t" LOAD_FPU "mov sp, r1\n\tmovs r0, #1\n\tbx lr");
}

/* Places: the number of the exception that runs, 0 for main; above those the depth of a Try. */
enum { PLACE_IN_TRY = 0x200, PLACE_UNKNOWN = 0x1FF };

static RTS_UI32 place_in_try(void)
{
    return PLACE_IN_TRY + (RTS_UI32)(state.top - state.tries);
}

/* C code that a program calls without a gate has no right to write the list. */
static bool may_catch_in_try(void)
{
#if RTS_IEC_UNPRIVILEGED
    return state.top[-1].gate != 0;
#else
    return true;
#endif
}

RTS_TRY **SysExceptTries(RTS_UI32 *place)
{
    if (!in_try()) {
        *place = CpuExceptionNumber();
        return &state.newest;
    }
    *place = place_in_try();
    return may_catch_in_try() ? &state.newest : NULL;
}

/* Registers of the FPU that wait to be saved are of what is left. */
static void forget_fpu(RTS_UI32 exc_return)
{
#ifdef __ARM_FP
    enum { FPCCR_LSPACT = 1 };
    if (!(exc_return & EXC_RETURN_BASIC))
        FPU_FPCCR &= ~(RTS_UI32)FPCCR_LSPACT;
#else
    RTS_UNUSED(exc_return);
#endif
}

/* Makes the frame that leads there, below what is live on the stack of rts_try. */
static FRAME *frame_to(const RTS_TRY *found, RTS_UI32 number)
{
    FRAME *frame = (FRAME *)(found->buffer[0] & ~(uintptr_t)7) - 1;

    frame->r0 = (RTS_UI32)(uintptr_t)found->buffer;
    frame->pc = (RTS_UI32)(uintptr_t)go_to_catch & ~1u;
    frame->xpsr = XPSR_THUMB | number;
    __asm__ volatile("msr basepri, %0" ::"r"(0) : "memory");
    return frame;
}

/* Returns the EXC_RETURN that leads to the rts_catch of a fault in a Try, 0 if none catches it. Exceptions in code of the
 * program are not caught here. */
static RTS_UI32 catch_in_try(RTS_UI32 code, uintptr_t address, const FRAME *frame, RTS_UI32 exc_return)
{
    RTS_TRY *found = NULL;

    if (may_catch_in_try() && !SysExceptIsCode(address))
        found = SysExceptCatch(&state.newest, place_in_try(), code, address, (uintptr_t)frame);
    if (found == NULL)
        return 0;
    forget_fpu(exc_return);
    set_process_stack(frame_to(found, 0));
    return (RTS_UI32)EXC_RETURN_THREAD_PSP;
}

static void clear_fault(RTS_UI32 cfsr);

/* A fault on the main stack, handled on a stack of its own: where to return to in the high word, with which stack pointer
 * in the low one. */
__attribute__((used)) static RTS_UI64 catch_in_runtime(FRAME *frame, RTS_UI32 exc_return)
{
    enum { EXC_RETURN_THREAD = 8, XPSR_EXCEPTION = 0x1FF };
    RTS_UI32 cfsr = SCB_CFSR;
    bool lost = (cfsr & CFSR_STACKING) != 0;
    RTS_UI32 main_or_not = exc_return & EXC_RETURN_THREAD ? 0 : PLACE_UNKNOWN;
    RTS_UI32 place = lost ? main_or_not : frame->xpsr & XPSR_EXCEPTION;
    uintptr_t address = lost ? 0 : frame->pc;
    RTS_UI32 code = lost ? (RTS_UI32)RTSEXCPT_STACK_OVERFLOW : code_of(cfsr);
    RTS_TRY *found = SysExceptCatch(&state.newest, place, code, address, (uintptr_t)frame);

    if (found == NULL)
        ResetNow(RESET_FATAL, address);
    clear_fault(cfsr);
    forget_fpu(exc_return);
    return (RTS_UI64)(exc_return | EXC_RETURN_BASIC) << 32 | (uintptr_t)frame_to(found, place);
}

static __attribute__((aligned(8), used)) RTS_UI32 fault_stack[48];
#define FAULT_STACK_TOP "fault_stack + 192"

/* SysExceptRaise: the same stack and rights. */
static void catch_raised(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UI32 place;
    RTS_TRY **list = SysExceptTries(&place);
    RTS_TRY *found = NULL;

    if (list != NULL && !SysExceptIsCode(address))
        found = SysExceptCatch(list, place, code, address, (uintptr_t)stack);
    if (found != NULL)
        go_to_catch(found->buffer);
}
#else
#define catch_in_try(code, address, frame, exc_return) 0
#define catch_raised(code, address, stack) ((void)0)
#endif

/* ---- the debugger ---- */

#if BP_MAX > 0

enum { SAVED = 8 }; /* registers r4 to r11, which FaultHandler saves and loads again */

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
    RTS_UI32 saved[SAVED];
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

static RTS_UI32 leave_try(RTS_UI32 code, RTS_UI32 address, uintptr_t stack, uintptr_t link);

void SysDebugSetHandler(PF_SYS_DEBUG handler)
{
    debug.handler = handler;
}

bool ThumbMayRead(uintptr_t address, RTS_UI32 size)
{
    const TRY *try = state.top - 1;
    return address - stack_slot(try) <= RTS_IEC_STACK_SIZE - size ||
           (SysExceptIsCode(address) && SysExceptIsCode(address + size - 1));
}

static RTS_UI32 frame_size(RTS_UI32 exc_return)
{
    enum { FPU_SIZE = 18 * 4 };
    return sizeof(FRAME) + (exc_return & EXC_RETURN_BASIC ? 0 : FPU_SIZE);
}

static void get_registers(THUMB_REGISTERS *at, const FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved)
{
    memcpy(at->r, frame, 4 * sizeof at->r[0]);
    memcpy(at->r + 4, saved, SAVED * sizeof at->r[0]);
    at->r[12] = frame->r12;
    at->r[13] = stack_before(frame, exc_return);
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
    memcpy(saved, at->r + 4, SAVED * sizeof at->r[0]);
    moved->r12 = at->r[12];
    moved->lr = at->r[14];
    moved->pc = at->r[15] & ~1u;
    moved->xpsr = (at->flags & ~(RTS_UI32)(XPSR_ALIGNED | XPSR_THUMB)) | (at->r[15] & 1 ? XPSR_THUMB : 0) |
                  (below & 4 ? XPSR_ALIGNED : 0);
    set_process_stack(moved);
}

/* Notes the fault that is handled now. */
static void note_fault(RTS_UI32 cfsr)
{
    enum { CFSR_BFARVALID = 1 << 15 };
    debug.fault.status = cfsr;
    debug.fault.address = cfsr & CFSR_MMARVALID ? SCB_MMFAR : cfsr & CFSR_BFARVALID ? SCB_BFAR : 0;
}

#if EXCEPT_REGISTERS > 0
/* Keeps the registers of the fault that leave_try is called for next. */
static void note_registers(const FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved)
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
#else
#define note_registers(frame, exc_return, saved) ((void)0)
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
        return leave_try(RTSEXCPT_ACCESS_VIOLATION, frame->pc, stop->stack, frame->lr);
    put_registers(&at, frame, exc_return, saved);
    return exc_return;
}

static RTS_UI32 halt(FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved, const SYS_DEBUG_STOP *stop)
{
    debug.stop = *stop;
    debug.frame = frame;
    debug.first = state.top[-1].first;
    debug.exc_return = exc_return;
    debug.halted_at.status = debug.fault.status;
    debug.halted_at.address = debug.fault.address;
    memcpy(debug.saved, saved, sizeof debug.saved);
#ifdef __ARM_FP
    __asm__ volatile("vstm %0, {s16-s31}" ::"r"(debug.fpu) : "memory"); /* the others are in the frame by that */
#endif
    return leave_try(SYS_DEBUG_HALTED, frame->pc, 0, 0);
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
    TRY *try = state.top - 1;
    SYS_DEBUG_STOP stop = debug.stop;
    RTS_UI32 goes_to;

    *try->first = debug.entered_over;
    try->first = debug.first;
    allow_stack(stack_slot(try));
    set_process_stack(debug.frame);
    memcpy(saved, debug.saved, sizeof debug.saved);
#ifdef __ARM_FP
    __asm__ volatile("vldm %0, {s16-s31}" ::"r"(debug.fpu) : "memory");
    drop_fpu_context();
#endif
    stop.code = SYS_DEBUG_HALTED;
    goes_to = act(debug.handler(&stop), debug.frame, debug.exc_return, saved, &stop);
    if (goes_to != 0)
        return goes_to;
    debug.fault.status = debug.halted_at.status;
    debug.fault.address = debug.halted_at.address;
    note_registers(debug.frame, debug.exc_return, saved);
    return leave_try(debug.stop.code, debug.stop.address, debug.stop.stack, debug.stop.link);
}

bool SysDebugResume(RTS_EXCEPTION *exception)
{
    FRAME *first = state.tries[0].first;
    debug.entered_over = *first;
    bool ended = SysExceptTry(resume_halted, (void *)(uintptr_t)debug.stop.arg, exception);

    state.tries[0].first = first;
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

static RTS_UI32 debug_raised(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved, SYS_DEBUG_STOP *stop)
{
    stop->code = frame->r0;
    stop->address = frame->r1;
    stop->stack = frame->r2;
    stop->link = 0;
    if (debug.handler(stop) == SYS_DEBUG_HALT)
        return halt(frame, exc_return, saved, stop);
    return leave_try(stop->code, stop->address, stop->stack, 0);
}

/* Where a fault that the debugger gets is to return to; 0: it leaves the Try. */
static RTS_UI32 debug_fault(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved, RTS_UI32 code)
{
    const TRY *try = state.top - 1;
    SYS_DEBUG_STOP stop = {.code = code,
                           .address = frame->pc,
                           .stack = stack_before(frame, exc_return),
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

#define SAVE_THE_OTHERS "push {r4-r11}\n\tmov r2, sp\n\t"
#define LOAD_THE_OTHERS "pop {r4-r11}\n\t"
#else
#define debug_fault(frame, exc_return, saved, code) ((void)(saved), 0)
#define note_fault(cfsr) ((void)0)
#define note_registers(frame, exc_return, saved) ((void)0)
#define SAVE_THE_OTHERS ""
#define LOAD_THE_OTHERS ""
#endif

static void clear_fault(RTS_UI32 cfsr)
{
    SCB_CFSR = cfsr;
    SCB_HFSR = SCB_HFSR;
    /* A fault of the stacking is still pending. It belongs to the function that ends here. */
    SCB_SHCSR &= ~(RTS_UI32)SHCSR_PENDING;
    CpuRestore(0); /* the fault may have been in a place where interrupts are masked */
}

__attribute__((used)) static RTS_UI32 fault_dispatch(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved)
{
    RTS_UI32 goes_to;
    RTS_UI32 cfsr = SCB_CFSR;
    if (!(exc_return & EXC_RETURN_PSP) || state.top == state.tries)
        ResetNow(RESET_FATAL, cfsr & CFSR_STACKING ? 0 : frame->pc);
    const TRY *try = state.top - 1;
    RTS_UI32 code = is_overflow(cfsr, frame, stack_end(try)) ? RTSEXCPT_STACK_OVERFLOW : code_of(cfsr);
    uintptr_t address = address_of(cfsr, code, frame, try);
    note_fault(cfsr);
    clear_fault(cfsr);
    goes_to = catch_in_try(code, address, frame, exc_return);
    if (goes_to != 0)
        return goes_to;
    if (cfsr & CFSR_STACKING)
        return leave_try(code, address, 0, 0);
    goes_to = debug_fault(frame, exc_return, saved, code);
    if (goes_to != 0)
        return goes_to;
    note_registers(frame, exc_return, saved);
    return leave_try(code, address, stack_before(frame, exc_return), frame->lr);
}

/* A fault on the main stack is one of the runtime; that stack may be at its end, so it is given up. */
__attribute__((naked)) void FaultHandler(void);
#if RTS_STRUCTURED_EXCEPTION_HANDLING
void FaultHandler(void)
{
    __asm__ volatile("tst lr, #4\n\tbne 1f\n\tmrs r0, msp\n\tldr r1, =" FAULT_STACK_TOP "\n\tmsr msp, r1\n\t"
                     "mov r1, lr\n\tbl catch_in_runtime\n\tmsr msp, r0\n\tbx r1\n\t.ltorg\n"
                     "1:\tmrs r0, psp\n\tmov r1, lr\n\t" SAVE_THE_OTHERS "bl fault_dispatch\n\t" LOAD_THE_OTHERS
                     "bx r0");
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

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    RTS_UI64 result = try_enter(fn, arg);
    exception->code = (RTS_UI32)result;
    exception->address = (uintptr_t)(result >> 32);
    return exception->code == RTSEXCPT_NOEXCEPTION;
}

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    catch_raised(code, address & ~(uintptr_t)1, stack);
    if (!in_try())
        ResetNow(RESET_FATAL, (RTS_UI32)address);
#if BP_MAX > 0
    if (debug.handler != NULL)
        raise_to_debugger(code, address & ~(uintptr_t)1, stack);
#endif
    try_raise(code, address & ~(uintptr_t)1, stack, 0);
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

/* We run above the Try, so it is interrupted, and where it is to go on is on its process stack. */
void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    FRAME *frame = process_stack();
    for (const TRY *try = state.top; try != state.tries; frame = try->outer_process) {
        try--;
        if (try->entered->r1 == (uintptr_t)arg)
            redirect(frame, code);
    }
}
