/*
 * SysDebug.c - traps in IEC code on Linux: INT3, BRK or UDF in memory that can otherwise only be executed.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port.
 */
#define _GNU_SOURCE
#include "SysDebug.h"

#include "../baremetal/cortexm/ArmCondition.h"
#include "../baremetal/cortexm/ThumbStep.h"
#include "StepOver.h"

#include <linux/futex.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

static pthread_t main_thread;

void SysDebugIsMain(void)
{
    main_thread = pthread_self();
}

bool SysDebugMayWait(void)
{
    return !pthread_equal(main_thread, pthread_self());
}

bool SysDebugCanTrap(void)
{
    return true;
}

#if defined(__x86_64__)
typedef RTS_UI8 CODE_UNIT;
#elif defined(__aarch64__)
typedef RTS_UI32 CODE_UNIT;
#else
typedef RTS_UI16 CODE_UNIT;
#endif

/* Code stays executable, since other tasks may execute it. A unit is in one page. */
static bool store_code(uintptr_t address, CODE_UNIT unit)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE);
    void *start = (void *)(address & ~(page - 1));
    if (mprotect(start, page, PROT_READ | PROT_WRITE | PROT_EXEC) != 0) {
        return false;
    }
    __atomic_store_n((CODE_UNIT *)address, unit, __ATOMIC_SEQ_CST);
    (void)mprotect(start, page, PROT_READ | PROT_EXEC);
    __builtin___clear_cache((char *)address, (char *)(address + sizeof unit));
    return true;
}

#if defined(__arm__)

static RTS_UI32 read_code(uintptr_t address)
{
    return ThumbRead(address);
}

static bool write_trap(uintptr_t address)
{
    return ThumbWriteTrap(address, store_code);
}

static void restore_code(uintptr_t address, RTS_UI32 original)
{
    ThumbRestore(address, original, store_code);
}

RTS_UI32 SysDebugTrapSize(uintptr_t address)
{
    return ThumbSize(*(const RTS_UI16 *)address);
}

bool SysDebugIsTrap(uintptr_t address)
{
    return ThumbIsTrap(address);
}

#else

#if defined(__x86_64__)
enum { TRAP = 0xCC, TRAP_MASK = 0xFF }; /* INT3 */
#else
enum { TRAP = (int)0xD4200020, TRAP_MASK = (int)0xFFE0001F }; /* BRK */
#endif

static RTS_UI32 read_code(uintptr_t address)
{
    return *(const CODE_UNIT *)address;
}

static bool write_trap(uintptr_t address)
{
    return store_code(address, (CODE_UNIT)TRAP);
}

static void restore_code(uintptr_t address, RTS_UI32 original)
{
    (void)store_code(address, (CODE_UNIT)original);
}

RTS_UI32 SysDebugTrapSize(uintptr_t address)
{
    RTS_UNUSED(address);
    return sizeof(CODE_UNIT);
}

bool SysDebugIsTrap(uintptr_t address)
{
    return ((read_code(address) ^ (RTS_UI32)TRAP) & (RTS_UI32)TRAP_MASK) == 0;
}

#endif

#if defined(__x86_64__)

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    *original = read_code(address);
    return write_trap(address) ? ERR_OK : ERR_NO_ACCESS_RIGHTS;
}

void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    restore_code(address, original);
}

#else

/* ---- a single instruction ---- */

/* Nothing in it is written, and no code, without it. */
static pthread_mutex_t step_lock = PTHREAD_MUTEX_INITIALIZER;

/* That one thread executes, with a trap after it. */
static struct {
    RTS_UI32 thread; /* 0: none; atomic */
    uintptr_t next;  /* the instruction after it */
    RTS_UI32 original;
    bool is_own; /* the trap there is nothing but the end of the step */
#if defined(__arm__)
    RTS_UI32 flags; /* of before */
#endif
} step;

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    bool done = true;
    pthread_mutex_lock(&step_lock);
    if (step.thread != 0 && step.is_own && address == step.next) {
        *original = step.original;
        step.is_own = false;
    } else {
        *original = read_code(address);
        done = write_trap(address);
    }
    pthread_mutex_unlock(&step_lock);
    return done ? ERR_OK : ERR_NO_ACCESS_RIGHTS;
}

/* The trap that ends a step stays. */
void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    pthread_mutex_lock(&step_lock);
    if (step.thread != 0 && address == step.next) {
        step.original = original;
        step.is_own = true;
    } else {
        restore_code(address, original);
    }
    pthread_mutex_unlock(&step_lock);
}

static RTS_UI32 self(void)
{
    return (RTS_UI32)syscall(SYS_gettid);
}

#if defined(__aarch64__)

enum { ZERO = 31, LINK = 30, INSTRUCTION = 4 };

static RTS_I64 signed_bits(RTS_UI32 code, RTS_UI32 lowest, RTS_UI32 count)
{
    return (RTS_I64)((RTS_UI64)code << (64 - lowest - count)) >> (64 - count);
}

static RTS_UI64 register_of(const mcontext_t *at, RTS_UI32 number)
{
    return number == ZERO ? 0 : at->regs[number];
}

/* C4.1: branches, which are executed here. */
static bool execute_branch(ucontext_t *context)
{
    mcontext_t *at = &context->uc_mcontext;
    RTS_UI32 code = read_code(at->pc);
    RTS_UI64 back = at->pc + INSTRUCTION;
    RTS_UI64 value = register_of(at, code & 31);
    RTS_I64 distance = 4 * signed_bits(code, 5, 19);
    bool taken = true, links = false;
    if ((code & 0x7C000000) == 0x14000000) { /* B, BL */
        distance = 4 * signed_bits(code, 0, 26);
        links = code >> 31 != 0;
    } else if ((code & 0xFF000010) == 0x54000000) { /* B.cond */
        taken = ArmConditionHolds(code & 15, (RTS_UI32)at->pstate);
    } else if ((code & 0x7E000000) == 0x34000000) { /* CBZ, CBNZ */
        value = code >> 31 != 0 ? value : (RTS_UI32)value;
        taken = (value == 0) != (code >> 24 & 1);
    } else if ((code & 0x7E000000) == 0x36000000) { /* TBZ, TBNZ */
        distance = 4 * signed_bits(code, 5, 14);
        taken = (value >> ((code >> 31) << 5 | (code >> 19 & 31)) & 1) == (code >> 24 & 1);
    } else if ((code & 0xFF9FFC1F) == 0xD61F0000) { /* BR, BLR, RET */
        distance = (RTS_I64)(register_of(at, code >> 5 & 31) - at->pc);
        links = (code >> 21 & 3) == 1;
    } else {
        return false;
    }
    at->pc = taken ? at->pc + (RTS_UI64)distance : back;
    if (links) {
        at->regs[LINK] = back;
    }
    return true;
}

static uintptr_t next_of(const ucontext_t *context)
{
    return context->uc_mcontext.pc + INSTRUCTION;
}

static uintptr_t address_of(const ucontext_t *context)
{
    return context->uc_mcontext.pc;
}

#define prepare_step(context) ((void)(context))
#define finish_step(context) ((void)(context))

#else

enum { STATE_THUMB = 1 << 5 };

/* A load that reads neither code nor the stack is left to the processor, whose exception is that of the program. */
static bool execute_branch(ucontext_t *context)
{
    THUMB_REGISTERS at;
    unsigned long *registers = &context->uc_mcontext.arm_r0;
    for (int i = 0; i < 16; i++) {
        at.r[i] = registers[i];
    }
    at.flags = context->uc_mcontext.arm_cpsr;
    if (ThumbStep(&at) != THUMB_DONE) {
        return false;
    }
    for (int i = 0; i < 16; i++) {
        registers[i] = at.r[i];
    }
    context->uc_mcontext.arm_cpsr = at.r[15] & 1 ? at.flags : at.flags & ~(RTS_UI32)STATE_THUMB;
    context->uc_mcontext.arm_pc = at.r[15] & ~1u;
    return true;
}

static uintptr_t address_of(const ucontext_t *context)
{
    return context->uc_mcontext.arm_pc;
}

static uintptr_t next_of(const ucontext_t *context)
{
    return address_of(context) + ThumbSize(*(const RTS_UI16 *)address_of(context));
}

static void prepare_step(ucontext_t *context)
{
    step.flags = context->uc_mcontext.arm_cpsr;
    context->uc_mcontext.arm_cpsr = ThumbAlone(step.flags);
}

static void finish_step(ucontext_t *context)
{
    context->uc_mcontext.arm_cpsr = ThumbAfter(step.flags, context->uc_mcontext.arm_cpsr);
}

#endif

/* One step at a time. */
static void enter_when_none_steps(void)
{
    RTS_UI32 other;
    pthread_mutex_lock(&step_lock);
    while ((other = step.thread) != 0) {
        pthread_mutex_unlock(&step_lock);
        SysDebugWait(&step.thread, other);
        pthread_mutex_lock(&step_lock);
    }
}

bool StepBegin(void *ucontext)
{
    ucontext_t *context = ucontext;
    if (execute_branch(context)) {
        return true;
    }
    enter_when_none_steps();
    step.next = next_of(context);
    step.is_own = !SysDebugIsTrap(step.next);
    step.original = read_code(step.next);
    bool trapped = !step.is_own || write_trap(step.next);
    if (trapped) {
        __atomic_store_n(&step.thread, self(), __ATOMIC_SEQ_CST);
        prepare_step(context);
    }
    pthread_mutex_unlock(&step_lock);
    return !trapped;
}

static void end_step(void)
{
    if (step.is_own) {
        restore_code(step.next, step.original);
    }
    __atomic_store_n(&step.thread, 0, __ATOMIC_SEQ_CST);
}

STEP_TRAP StepEnd(void *ucontext)
{
    RTS_UI32 running = __atomic_load_n(&step.thread, __ATOMIC_SEQ_CST);
    if (running == 0 || (ucontext == NULL && running != self())) {
        return STEP_NONE;
    }
    pthread_mutex_lock(&step_lock);
    RTS_UI32 thread = step.thread;
    bool is_mine = thread == self();
    bool is_there = ucontext != NULL && thread != 0 && address_of(ucontext) == step.next;
    bool is_own = step.is_own;
    if (is_mine) {
        end_step();
        if (is_there) {
            finish_step(ucontext);
        }
    }
    pthread_mutex_unlock(&step_lock);
    if (is_mine) {
        SysDebugWake(&step.thread);
        return is_there && is_own ? STEP_ENDED : STEP_INTERRUPTED;
    }
    if (!is_there || !is_own) {
        return STEP_NONE;
    }
    SysDebugWait(&step.thread, thread);
    return STEP_OF_ANOTHER;
}

#endif

void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value)
{
    (void)syscall(SYS_futex, word, FUTEX_WAIT_PRIVATE, value, NULL, NULL, 0);
}

void SysDebugWake(RTS_UI32 *word)
{
    (void)syscall(SYS_futex, word, FUTEX_WAKE_PRIVATE, INT32_MAX, NULL, NULL, 0);
}
