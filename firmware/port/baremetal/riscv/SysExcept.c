/*
 * SysExcept.c - exceptions of application code on RISC-V.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SysExceptTry enters the function in *user mode on a stack of its own*, and notes in mscratch where the main stack goes
 * on. Each trap runs there (trap.c), in machine mode, so whatever goes wrong in the function, no stack that needs to be
 * trusted is one that it could write. It is left by going back on the main stack to where SysExceptTry entered it: for a
 * normal end and a checked error (both an ECALL), a fault, and an aborted loop:
 *
 *   main stack:    ... interrupt | SysExceptTry: registers | FRAME of a trap in the function | ...
 *   IEC stack:     slot of this nesting depth
 *
 * Nested only by pre-emption, last in first out: depth d is interrupted while depth d + 1 runs.
 *
 * To user mode the PMP gives
 *   code and RAM (board.h)                          read, execute
 *   the first 256 bytes, where NULL points          nothing, as to all else
 *   areas of the application (AppAreas.c)           read, write
 *   stack slot of the depth that runs               read, write
 * so a wild store ends in an exception that names it, and has changed nothing but the program's own data. Entering and
 * leaving a Try move one entry, that of the stack.
 *
 * C functions that a program calls run in the Try, too, with its rights: arithmetic and mathematics as they are. What
 * writes variables of its own, or needs hardware, has a gate (APP_GATE): an ECALL in the section of gates, after which
 * the function goes on in machine mode, on the program's stack. The ECALL of no other place gives rights. It returns by
 * gate_return, which gives them up.
 */
#include "SysExcept.h"

#include "BareMetal.h"
#include "RiscvStep.h"
#include "SysDebug.h"
#include "SysExceptCatch.h"
#include "rts_config.h"

#include <string.h>

enum {
    CAUSE_FETCH = 1,
    CAUSE_ILLEGAL = 2,
    CAUSE_BREAKPOINT = 3,
    CAUSE_LOAD_MISALIGNED = 4,
    CAUSE_STORE_MISALIGNED = 6,
    CAUSE_ECALL_USER = 8,
    CAUSE_ECALL_MACHINE = 11,
};
enum { PMP_OFF = 0, PMP_TOR = 1 << 3, PMP_NAPOT = 3 << 3 };
enum { ECALL_SIZE = 4 };

typedef struct {
    FRAME *frame;   /* where a trap in it saves its registers; the main stack goes on above */
    uintptr_t slot; /* its stack; never changes */
    const void *arg;
    RTS_UI32 gate; /* where a function that has a gate returns to; 0: none runs */
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *outer_tries;
#endif
} TRY;

typedef RTS_UI8 IEC_STACK[RTS_IEC_STACK_SIZE];
RTS_STATIC_ASSERT((RTS_IEC_STACK_SIZE & (RTS_IEC_STACK_SIZE - 1)) == 0 && RTS_IEC_STACK_SIZE >= 256,
                  iec_stack_is_an_entry);

/* At the bottom of RAM, the deepest first: what gets past its slot hits one that is idle now, or no memory at all. */
__attribute__((section(".bss.iec_stack"), aligned(RTS_IEC_STACK_SIZE))) static IEC_STACK stacks[APP_MAX_TASKS];

static struct {
    TRY *top; /* past the innermost that runs */
    TRY tries[APP_MAX_TASKS];
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *newest; /* of rts_try, in all contexts: they nest as interrupts do */
#endif
} state;

/* True if the caller runs on a stack of SysExceptTry. An empty stack has its pointer at the end, hence the -1. */
static bool in_try(void)
{
    return (uintptr_t)__builtin_frame_address(0) - (uintptr_t)stacks - 1 < sizeof(stacks);
}

/* ---- rights ---- */

static RTS_UI32 napot(uintptr_t base, RTS_UI32 log2_size)
{
    return (RTS_UI32)base >> 2 | ((1u << (log2_size - 3)) - 1);
}

static void set_address(RTS_UI32 entry, RTS_UI32 address)
{
#define CASE(n)                           \
    case n:                               \
        CSR_WRITE("pmpaddr" #n, address); \
        break
    switch (entry) {
        CASE(0);
        CASE(1);
        CASE(2);
        CASE(3);
        CASE(4);
        CASE(5);
        CASE(6);
        CASE(7);
        CASE(8);
        CASE(9);
        CASE(10);
        CASE(11);
        CASE(12);
        CASE(13);
        CASE(14);
        CASE(15);
    }
#undef CASE
}

static void set_rights(RTS_UI32 entry, RTS_UI32 rights)
{
    RTS_UI32 shift = entry % 4 * 8, keep = ~(0xFFu << shift);
    rights <<= shift;
    switch (entry / 4) {
    case 0:
        CSR_WRITE("pmpcfg0", (CSR_READ("pmpcfg0") & keep) | rights);
        break;
    case 1:
        CSR_WRITE("pmpcfg1", (CSR_READ("pmpcfg1") & keep) | rights);
        break;
    case 2:
        CSR_WRITE("pmpcfg2", (CSR_READ("pmpcfg2") & keep) | rights);
        break;
    case 3:
        CSR_WRITE("pmpcfg3", (CSR_READ("pmpcfg3") & keep) | rights);
        break;
    }
}

void PmpProtect(RTS_UI32 entry, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 rights)
{
    set_address(entry, napot(base, log2_size));
    set_rights(entry, rights | PMP_NAPOT);
}

/* Its rights stay. */
static void allow_stack(uintptr_t slot)
{
    CSR_WRITE("pmpaddr2", napot(slot, RTS_LOG2(RTS_IEC_STACK_SIZE)));
}
RTS_STATIC_ASSERT(PMP_IEC_STACK == 2, the_entry_of_the_stack);

void SysExceptInit(void)
{
    enum { NULL_LOG2 = 8 };
    extern RTS_UI8 stack_bottom[], areas_start[], areas_end[];
    state.top = state.tries;
    for (RTS_UI32 i = 0; i < APP_MAX_TASKS; i++)
        state.tries[i].slot = (uintptr_t)stacks[APP_MAX_TASKS - 1 - i];
    PmpProtect(PMP_STACK, (uintptr_t)stack_bottom, STACK_GUARD_LOG2, PMP_LOCKED);
    PmpProtect(PMP_NULL, 0, NULL_LOG2, 0);
    PmpProtect(PMP_IEC_STACK, (uintptr_t)stacks, RTS_LOG2(RTS_IEC_STACK_SIZE), PMP_READ | PMP_WRITE);
    set_address(PMP_AREAS, (RTS_UI32)(uintptr_t)areas_start >> 2);
    set_rights(PMP_AREAS, PMP_OFF);
    set_address(PMP_AREAS + 1, (RTS_UI32)(uintptr_t)areas_end >> 2);
    set_rights(PMP_AREAS + 1, PMP_READ | PMP_WRITE | PMP_TOR);
    PmpProtect(PMP_CODE, BOARD_CODE, BOARD_CODE_LOG2, PMP_READ | PMP_EXECUTE);
    PmpProtect(PMP_RAM, BOARD_RAM, BOARD_RAM_LOG2, PMP_READ | PMP_EXECUTE);
}

/* ---- entering and leaving ---- */

/* The function given to SysExceptTry returned. A store that is on its way and fails is to fail before we leave. */
__attribute__((naked, used)) static void try_return(void)
{
    __asm__ volatile("fence\n\tli a0, 0\n\tecall");
}

/* Leaves the running Try. */
__attribute__((naked, noreturn)) static void try_raise(RTS_UI32 code, uintptr_t address, const void *stack,
                                                       uintptr_t link)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(stack);
    RTS_UNUSED(link);
    __asm__ volatile("ecall");
}

/* Enters fn(arg) with interrupts on; comes back by try_leave, with the code in the low and the address in the high word.
 * Whatever fn did to the registers that a function has to keep, they are as before. */
__attribute__((naked, noinline)) static RTS_UI64 try_enter(void (*fn)(void *arg), void *arg, TRY *try, uintptr_t stack)
{
    RTS_UNUSED(fn);
    RTS_UNUSED(arg);
    RTS_UNUSED(try);
    RTS_UNUSED(stack);
    __asm__ volatile("addi sp, sp, -64\n\tsw ra, 52(sp)\n\t"
                     "sw s0, 0(sp)\n\tsw s1, 4(sp)\n\tsw s2, 8(sp)\n\tsw s3, 12(sp)\n\tsw s4, 16(sp)\n\t"
                     "sw s5, 20(sp)\n\tsw s6, 24(sp)\n\tsw s7, 28(sp)\n\tsw s8, 32(sp)\n\tsw s9, 36(sp)\n\t"
                     "sw s10, 40(sp)\n\tsw s11, 44(sp)\n\t"
                     "addi t0, sp, -80\n\tsw t0, %0(a2)\n\t"
                     "csrw mscratch, sp\n\tcsrw mepc, a0\n\tli t0, %1\n\tcsrw mstatus, t0\n\t"
                     "la ra, try_return\n\tmv sp, a3\n\tmv a0, a1\n\tmret" ::"i"(offsetof(TRY, frame)),
                     "i"(MSTATUS_MPIE));
}

/* Goes on after try_enter, above the frame of a trap. */
__attribute__((naked, noreturn)) static void try_leave(RTS_UI32 code, uintptr_t address, const FRAME *above)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(above);
    __asm__ volatile("mv sp, a2\n\tlw ra, 52(sp)\n\t"
                     "lw s0, 0(sp)\n\tlw s1, 4(sp)\n\tlw s2, 8(sp)\n\tlw s3, 12(sp)\n\tlw s4, 16(sp)\n\t"
                     "lw s5, 20(sp)\n\tlw s6, 24(sp)\n\tlw s7, 28(sp)\n\tlw s8, 32(sp)\n\tlw s9, 36(sp)\n\t"
                     "lw s10, 40(sp)\n\tlw s11, 44(sp)\n\t"
                     "addi sp, sp, 64\n\tcsrsi mstatus, %0\n\tret" ::"i"(MSTATUS_MIE));
}

/* Main and tasks call it, which have their interrupts on. */
bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    (void)CpuMask();
    TRY *try = state.top;
    if (try == state.tries + APP_MAX_TASKS)
        ResetNow(RESET_FATAL, (RTS_UI32)(uintptr_t)fn);
    state.top = try + 1;
    try->arg = arg;
    try->gate = 0;
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    try->outer_tries = state.newest;
#endif
    allow_stack(try->slot);
    RTS_UI64 result = try_enter(fn, arg, try, try->slot + RTS_IEC_STACK_SIZE);
    exception->code = (RTS_UI32)result;
    exception->address = (uintptr_t)(result >> 32);
    return exception->code == RTSEXCPT_NOEXCEPTION;
}

/* True if the stack can be read from this address on. An address below its end is not in the stack. */
static bool is_readable(const TRY *try, uintptr_t stack)
{
    return stack - try->slot < RTS_IEC_STACK_SIZE;
}

__attribute__((noreturn)) static void leave(RTS_UI32 code, RTS_UI32 address, uintptr_t stack, uintptr_t link)
{
    TRY *try = --state.top;
    if (code != RTSEXCPT_NOEXCEPTION && is_readable(try, stack))
        SysExceptTrace(address, (const uintptr_t *)stack, (const uintptr_t *)(try->slot + RTS_IEC_STACK_SIZE), link);
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    state.newest = try->outer_tries;
#endif
    if (try > state.tries)
        allow_stack(try[-1].slot);
    try_leave(code, address, try->frame + 1);
}

/* ---- gates ---- */

/* A function that was called by a gate returns here. This gives up the rights and returns to the caller of the gate.
 * The result is in a0, a1. */
__attribute__((naked)) static void gate_return(void)
{
    __asm__ volatile("ecall");
}

/* A function with a gate that calls another by its gate has the rights. */
static void open_gate(TRY *try, FRAME *frame)
{
    frame->pc += ECALL_SIZE;
    if (try->gate != 0)
        return;
    try->gate = frame->ra;
    frame->ra = (RTS_UI32)(uintptr_t)gate_return;
    frame->status |= MSTATUS_MPP;
}

static void close_gate(TRY *try, FRAME *frame)
{
    frame->pc = try->gate;
    try->gate = 0;
    frame->status &= ~(RTS_UI32)MSTATUS_MPP;
}

static bool is_gate(uintptr_t pc)
{
    extern RTS_UI8 gates_start[], gates_end[];
    return pc - (uintptr_t)gates_start < (uintptr_t)(gates_end - gates_start);
}

static void call_of_the_runtime(TRY *try, FRAME *frame)
{
    if (is_gate(frame->pc))
        open_gate(try, frame);
    else if (frame->pc == (RTS_UI32)(uintptr_t)gate_return)
        close_gate(try, frame);
    else
        leave(frame->a0, frame->a1, frame->a2, frame->a3);
}

/* ---- faults ---- */

/* The stack pointer is below the slot, or what is there was hit by the last frame that had no room. */
static bool is_overflow(const TRY *try, const FRAME *frame, RTS_UI32 cause)
{
    enum { FRAME_MAX = 64 };
    return frame->sp < try->slot || (cause > CAUSE_BREAKPOINT && try->slot - 1 - CSR_READ("mtval") < FRAME_MAX);
}

static RTS_UI32 code_of(RTS_UI32 cause)
{
    switch (cause) {
    case CAUSE_ILLEGAL:
        return RTSEXCPT_ILLEGAL_INSTRUCTION;
    case CAUSE_BREAKPOINT:
        return RTSEXCPT_BREAKPOINT;
    case CAUSE_LOAD_MISALIGNED:
    case CAUSE_STORE_MISALIGNED:
        return RTSEXCPT_MISALIGNMENT;
    default:
        return RTSEXCPT_ACCESS_VIOLATION;
    }
}

/* After a jump to nowhere the caller says more than the program counter. So it does when the stack overflows: that is
 * mostly noticed by what clears the variables of a function, which is no function of the application. */
static uintptr_t address_of(RTS_UI32 cause, RTS_UI32 code, const FRAME *frame)
{
    if (cause <= CAUSE_FETCH || (code == RTSEXCPT_STACK_OVERFLOW && SysExceptIsCode(frame->ra)))
        return frame->ra - 2;
    return frame->pc;
}

/* ---- rts_try ---- */

#if RTS_STRUCTURED_EXCEPTION_HANDLING

__attribute__((naked)) int SysExceptSetJmp(RTS_JMP_BUF buffer)
{
    RTS_UNUSED(buffer);
    __asm__ volatile("sw sp, 0(a0)\n\tsw s0, 4(a0)\n\tsw s1, 8(a0)\n\tsw s2, 12(a0)\n\tsw s3, 16(a0)\n\t"
                     "sw s4, 20(a0)\n\tsw s5, 24(a0)\n\tsw s6, 28(a0)\n\tsw s7, 32(a0)\n\tsw s8, 36(a0)\n\t"
                     "sw s9, 40(a0)\n\tsw s10, 44(a0)\n\tsw s11, 48(a0)\n\tsw ra, 52(a0)\n\tli a0, 0\n\tret");
}

/* Goes on after it, with interrupts. */
__attribute__((naked, noreturn)) static void go_to_catch(const uintptr_t *buffer)
{
    RTS_UNUSED(buffer);
    __asm__ volatile("lw sp, 0(a0)\n\tlw s0, 4(a0)\n\tlw s1, 8(a0)\n\tlw s2, 12(a0)\n\tlw s3, 16(a0)\n\t"
                     "lw s4, 20(a0)\n\tlw s5, 24(a0)\n\tlw s6, 28(a0)\n\tlw s7, 32(a0)\n\tlw s8, 36(a0)\n\t"
                     "lw s9, 40(a0)\n\tlw s10, 44(a0)\n\tlw s11, 48(a0)\n\tlw ra, 52(a0)\n\tli a0, 1\n\t"
                     "csrsi mstatus, %0\n\tret" ::"i"(MSTATUS_MIE));
}

/* Places: the level of the task in whose interrupt the runtime is, or that of main; above those the depth of a Try. */
enum { PLACE_IN_TRY = 0x200 };

static RTS_UI32 place_in_try(void)
{
    return PLACE_IN_TRY + (RTS_UI32)(state.top - state.tries);
}

/* C code that a program calls without a gate has no right to write the list. */
RTS_TRY **SysExceptTries(RTS_UI32 *place)
{
    if (!in_try()) {
        *place = CpuTaskLevel();
        return &state.newest;
    }
    *place = place_in_try();
    return state.top[-1].gate != 0 ? &state.newest : NULL;
}

/* An exception in code of the program is the program's. */
static RTS_TRY *find_catch(RTS_TRY **list, RTS_UI32 place, RTS_UI32 code, uintptr_t address, uintptr_t stack)
{
    return list == NULL || SysExceptIsCode(address) ? NULL : SysExceptCatch(list, place, code, address, stack);
}

/* True if a fault in a Try was caught: the frame leads there. */
static bool catch_in_try(const TRY *try, RTS_UI32 code, uintptr_t address, FRAME *frame)
{
    RTS_TRY **list = try->gate != 0 ? &state.newest : NULL;
    RTS_TRY *found = find_catch(list, place_in_try(), code, address, frame->sp);

    if (found == NULL)
        return false;
    frame->a0 = (RTS_UI32)(uintptr_t)found->buffer;
    frame->pc = (RTS_UI32)(uintptr_t)go_to_catch;
    frame->sp = found->buffer[0];
    return true;
}

void SysExceptCatchFault(RTS_UI32 cause, uintptr_t address, uintptr_t stack)
{
    /* Without interrupts it is one of a device's, or its own: the level says which task it interrupts. */
    bool interruptible = (CSR_READ("mstatus") & MSTATUS_MPIE) != 0;
    RTS_TRY *found = interruptible ? find_catch(&state.newest, CpuTaskLevel(), code_of(cause), address, stack) : NULL;

    if (found != NULL)
        go_to_catch(found->buffer);
}

/* SysExceptRaise: the same stack and rights. */
static void catch_raised(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UI32 place;
    RTS_TRY **list = SysExceptTries(&place);
    RTS_TRY *found = find_catch(list, place, code, address, (uintptr_t)stack);

    if (found != NULL)
        go_to_catch(found->buffer);
}
#else
#define catch_in_try(try, code, address, frame) false
#define catch_raised(code, address, stack) ((void)0)
#endif

#if BP_MAX > 0

/* ---- the debugger ---- */

/*
 * A halted task leaves its Try as by an exception. Its stack stays: no cycle starts before main has run the rest of this
 * one, in a Try of its own that goes on with these registers. A step is one instruction without interrupts, so that no
 * other task executes the code meanwhile.
 */
static struct {
    PF_SYS_DEBUG handler;
    SYS_DEBUG_STOP stop; /* of the halted task */
    FRAME frame;
    RTS_UI32 saved[SAVED];
    uintptr_t slot;
    bool steps;
    bool ends_at_own; /* at a trap that is nothing but the end of the step */
    uintptr_t next;
    RTS_UI32 original;
    RTS_UI32 interrupts;
    RTS_UI32 cause, value; /* mcause and mtval of the halted task */
} debug;

void SysDebugSetHandler(PF_SYS_DEBUG handler)
{
    debug.handler = handler;
}

/* Keeps the registers of the fault that leave() is called for next. */
static void note_registers(const FRAME *frame, const RTS_UI32 *saved, RTS_UI32 cause, RTS_UI32 value)
{
    uintptr_t values[EXCEPT_REGISTERS] = {
        frame->ra, frame->sp, frame->t0, frame->t1, frame->t2, frame->t3, frame->t4, frame->t5, frame->t6,
        frame->a0, frame->a1, frame->a2, frame->a3, frame->a4, frame->a5, frame->a6, frame->a7,
    };
    enum { CALLER_SAVED = 17 };
    memcpy(values + CALLER_SAVED, saved, SAVED * sizeof values[0]);
    values[CALLER_SAVED + SAVED] = frame->pc;
    values[CALLER_SAVED + SAVED + 1] = cause;
    values[CALLER_SAVED + SAVED + 2] = value;
    SysExceptNoteRegisters((const uintptr_t *)(uintptr_t)frame->sp, EXCEPT_REGISTERS_RISCV32, values);
}

static void tell_debugger(const SYS_DEBUG_STOP *stop, RTS_UI32 code)
{
    SYS_DEBUG_STOP other = *stop;
    other.code = code;
    (void)debug.handler(&other);
}

static void begin_step(const FRAME *frame)
{
    debug.next = frame->pc + RiscvSize(frame->pc);
    debug.ends_at_own = !SysDebugIsTrap(debug.next);
    if (debug.ends_at_own)
        (void)SysDebugWriteTrap(debug.next, &debug.original);
    debug.steps = true;
    debug.interrupts = CSR_READ("mie");
    CSR_WRITE("mie", 0);
}

/* True if that is all the trap was there for. */
static bool end_step(const FRAME *frame)
{
    CSR_WRITE("mie", debug.interrupts);
    debug.steps = false;
    if (debug.ends_at_own)
        SysDebugRestore(debug.next, debug.original);
    return debug.ends_at_own && frame->pc == debug.next;
}

/* The handler of the trap has taken it out. */
static void pass(FRAME *frame, RTS_UI32 *saved, const SYS_DEBUG_STOP *stop)
{
    RISCV_STEP done = RiscvStep(frame, saved);
    if (done == RISCV_STRAIGHT && SysExceptIsCode(frame->pc + RiscvSize(frame->pc) + 1)) {
        begin_step(frame);
        return;
    }
    tell_debugger(stop, RTSEXCPT_NOEXCEPTION);
    if (done != RISCV_DONE)
        leave(RTSEXCPT_ILLEGAL_INSTRUCTION, frame->pc, frame->sp, frame->ra);
}

__attribute__((noreturn)) static void halt(const FRAME *frame, const RTS_UI32 *saved, const SYS_DEBUG_STOP *stop)
{
    debug.stop = *stop;
    debug.frame = *frame;
    debug.slot = state.top[-1].slot;
    debug.cause = CSR_READ("mcause");
    debug.value = CSR_READ("mtval");
    memcpy(debug.saved, saved, sizeof debug.saved);
    leave(SYS_DEBUG_HALTED, frame->pc, 0, 0);
}

/* False: the exception leaves the Try. */
static bool act(SYS_DEBUG_ACTION action, FRAME *frame, RTS_UI32 *saved, const SYS_DEBUG_STOP *stop)
{
    if (action == SYS_DEBUG_HALT)
        halt(frame, saved, stop);
    if (action == SYS_DEBUG_PASS)
        pass(frame, saved, stop);
    return action != SYS_DEBUG_LEAVE;
}

/* Runs in the Try that goes on with what is halted: its trap puts that in its place. */
__attribute__((naked)) static void resume_halted(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("ebreak");
}

static void resume(FRAME *frame, RTS_UI32 *saved)
{
    TRY *try = state.top - 1;
    SYS_DEBUG_STOP stop = debug.stop;
    try->slot = debug.slot;
    allow_stack(try->slot);
    *frame = debug.frame;
    memcpy(saved, debug.saved, sizeof debug.saved);
    stop.code = SYS_DEBUG_HALTED;
    if (!act(debug.handler(&stop), frame, saved, &stop)) {
        note_registers(frame, saved, debug.cause, debug.value);
        leave(debug.stop.code, debug.stop.address, debug.stop.stack, debug.stop.link);
    }
}

bool SysDebugResume(RTS_EXCEPTION *exception)
{
    uintptr_t slot = state.tries[0].slot;
    bool ended = SysExceptTry(resume_halted, (void *)(uintptr_t)debug.stop.arg, exception);
    state.tries[0].slot = slot;
    return ended;
}

/* An error that the program or the runtime found, for the debugger. */
__attribute__((naked, noreturn)) static void raise_to_debugger(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(stack);
    __asm__ volatile("ebreak");
}

static void debug_raised(const FRAME *frame, const RTS_UI32 *saved, SYS_DEBUG_STOP *stop)
{
    stop->code = frame->a0;
    stop->address = frame->a1;
    stop->stack = frame->a2;
    stop->link = 0;
    if (debug.handler(stop) == SYS_DEBUG_HALT)
        halt(frame, saved, stop);
    leave(stop->code, stop->address, stop->stack, 0);
}

/* True if the code goes on as the frame says; else the exception leaves the Try. */
static bool debug_fault(FRAME *frame, RTS_UI32 *saved, RTS_UI32 code)
{
    const TRY *try = state.top - 1;
    SYS_DEBUG_STOP stop = {.code = code,
                           .address = frame->pc,
                           .stack = frame->sp,
                           .end = try->slot + RTS_IEC_STACK_SIZE,
                           .link = frame->ra,
                           .arg = try->arg};
    if (debug.handler == NULL)
        return false;
    if (debug.steps) {
        bool was_all = end_step(frame);
        tell_debugger(&stop, RTSEXCPT_NOEXCEPTION);
        if (was_all)
            return true;
    }
    if (frame->pc == (RTS_UI32)(uintptr_t)resume_halted) {
        resume(frame, saved);
        return true;
    }
    if (frame->pc == (RTS_UI32)(uintptr_t)raise_to_debugger)
        debug_raised(frame, saved, &stop);
    return SysExceptIsCode(frame->pc) && act(debug.handler(&stop), frame, saved, &stop);
}

__attribute__((used)) void SysExceptFault(FRAME *frame, RTS_UI32 cause, RTS_UI32 *saved)
{
    TRY *try = state.top - 1;
    RTS_UI32 code = is_overflow(try, frame, cause) ? RTSEXCPT_STACK_OVERFLOW : code_of(cause);
    if (!catch_in_try(try, code, address_of(cause, code, frame), frame) && !debug_fault(frame, saved, code)) {
        note_registers(frame, saved, cause, CSR_READ("mtval"));
        leave(code, address_of(cause, code, frame), frame->sp, frame->ra);
    }
}

#endif

void SysExceptTrap(FRAME *frame, RTS_UI32 cause)
{
    TRY *try = state.top - 1;
    if (BP_MAX > 0 || cause == CAUSE_ECALL_USER || cause == CAUSE_ECALL_MACHINE) {
        call_of_the_runtime(try, frame);
        return;
    }
    RTS_UI32 code = is_overflow(try, frame, cause) ? RTSEXCPT_STACK_OVERFLOW : code_of(cause);
    if (catch_in_try(try, code, address_of(cause, code, frame), frame))
        return;
    leave(code, address_of(cause, code, frame), frame->sp, frame->ra);
}

/* ---- for the runtime ---- */

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

/* Where a function that is aborted goes on: it leaves the running Try. */
__attribute__((naked, noreturn)) static void try_break(void)
{
    __asm__ volatile("mv a2, sp\n\tecall");
}

/* Whether it is about to raise an exception: then where it was must not be forgotten. */
static bool is_raising(const FRAME *frame)
{
    enum { BREAK_SIZE = 6 };
    return frame->pc == (RTS_UI32)(uintptr_t)try_raise || frame->pc - (RTS_UI32)(uintptr_t)try_break < BREAK_SIZE;
}

static void redirect(FRAME *frame, RTS_UI32 code)
{
    if (is_raising(frame))
        return;
    frame->a0 = code;
    frame->a1 = frame->pc;
    frame->a3 = frame->ra;
    frame->pc = (RTS_UI32)(uintptr_t)try_break;
}

/* We run above the Try, so it is interrupted, and where it is to go on is in its frame. */
void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    for (const TRY *try = state.tries; try != state.top; try++)
        if (try->arg == arg)
            redirect(try->frame, code);
}
