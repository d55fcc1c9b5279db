/*
 * IecStack.c - the memory of stacks for IEC code.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One mapping per stack: guard, stack, guard, memory for signal handlers, guard. Guards cost address space only, which
 * processors of 32 bits have little of. They are wide, for code that does not probe its frames page by page: compiled code does, C functions of the runtime and images
 * of other compilers need not.
 */
#define _GNU_SOURCE
#include "IecStack.h"

#include "rts_config.h"

#include <sys/mman.h>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#endif

#define STACK_SIZE ((size_t)RTS_IEC_STACK_SIZE)
#define GUARD_SIZE ((size_t)16 * 1024 * 1024) /* where the stack grows into */
#define GUARD_ABOVE ((size_t)(sizeof(void *) > 4 ? 16 : 2) * 1024 * 1024)
#define SIGNAL_SIZE ((size_t)64 * 1024) /* a signal frame with all vector registers takes up to 20 KiB */

int IecStackSwitch(void (*fn)(void *arg), void *arg, IEC_STACK *stack, RTS_UI32 running);
void IecStackSwitchBack(IEC_STACK *stack) __attribute__((noreturn));
void IecStackCallBelow(void (*fn)(void *arg), void *arg, uintptr_t stack_pointer);

RTS_STATIC_ASSERT(offsetof(IEC_STACK, back) == 0 && offsetof(IEC_STACK, top) == sizeof(void *) &&
                      offsetof(IEC_STACK, running) == 2 * sizeof(void *),
                  layout_is_what_the_switch_knows);

__thread IEC_STACK *IecStackOfThread;

bool IecStackReserve(IEC_STACK *stack)
{
    size_t size = GUARD_SIZE + STACK_SIZE + GUARD_ABOVE + SIGNAL_SIZE + GUARD_ABOVE;
    if (stack->top != 0) {
        return true;
    }
    char *memory = mmap(NULL, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) {
        return false;
    }
    char *bottom = memory + GUARD_SIZE;
    char *signals = bottom + STACK_SIZE + GUARD_ABOVE;
    if (mprotect(bottom, STACK_SIZE, PROT_READ | PROT_WRITE) != 0 ||
        mprotect(signals, SIGNAL_SIZE, PROT_READ | PROT_WRITE) != 0) {
        munmap(memory, size);
        return false;
    }
    stack->bottom = (uintptr_t)bottom;
    stack->top = (uintptr_t)bottom + STACK_SIZE;
    return true;
}

void *IecStackSignalMemory(const IEC_STACK *stack, size_t *size)
{
    *size = SIGNAL_SIZE;
    return (void *)(stack->top + GUARD_ABOVE);
}

bool IecStackIsOverflow(const IEC_STACK *stack, uintptr_t address)
{
    return stack->bottom - address - 1 < GUARD_SIZE;
}

/* ---- the address sanitizer must know which stack is in use: nothing may be left in the middle of that ---- */

#if defined(__SANITIZE_ADDRESS__)

#define NOT_CHECKED __attribute__((no_sanitize("address")))

typedef struct {
    IEC_STACK *stack;
    void (*fn)(void *arg);
    void *arg;
} CALL;

static void before_back(IEC_STACK *stack)
{
    __sanitizer_start_switch_fiber(NULL, stack->sanitizer.own_bottom, stack->sanitizer.own_size);
}

static void call(void *arg)
{
    CALL *call = arg;
    IEC_STACK *stack = call->stack;
    __sanitizer_finish_switch_fiber(NULL, (const void **)&stack->sanitizer.own_bottom, &stack->sanitizer.own_size);
    __atomic_store_n(&stack->running, IEC_STACK_RUNS, __ATOMIC_RELEASE);
    call->fn(call->arg);
    IecStackResetFlags();
    stack = IecStackOfThread; /* the register that held it may have been destroyed */
    __atomic_store_n(&stack->running, IEC_STACK_UNUSED, __ATOMIC_RELEASE);
    before_back(stack);
}

bool IecStackRun(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    CALL arguments = {stack, fn, arg};
    __sanitizer_start_switch_fiber(&stack->sanitizer.own_state, (void *)stack->bottom, STACK_SIZE);
    bool left = IecStackSwitch(call, &arguments, stack, IEC_STACK_UNUSED);
    __sanitizer_finish_switch_fiber(stack->sanitizer.own_state, NULL, NULL);
    return !left;
}

/* The frames that are given up have poisoned what is between their variables: here, and where handlers run. */
NOT_CHECKED void IecStackLeave(IEC_STACK *stack)
{
    __asan_handle_no_return();
    __asan_unpoison_memory_region((void *)stack->bottom, STACK_SIZE);
    before_back(stack);
    IecStackSwitchBack(stack);
}

static void call_on_own(void *arg)
{
    CALL *call = arg;
    IEC_STACK *stack = call->stack;
    __sanitizer_finish_switch_fiber(stack->sanitizer.own_state, NULL, NULL);
    call->fn(call->arg);
    __sanitizer_start_switch_fiber(&stack->sanitizer.own_state, (void *)stack->bottom, STACK_SIZE);
}

static void call_below(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    CALL arguments = {stack, fn, arg};
    void *iec_state;
    __sanitizer_start_switch_fiber(&iec_state, stack->sanitizer.own_bottom, stack->sanitizer.own_size);
    IecStackCallBelow(call_on_own, &arguments, stack->back);
    __sanitizer_finish_switch_fiber(iec_state, NULL, NULL);
}

#else

bool IecStackRun(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    return IecStackSwitch(fn, arg, stack, IEC_STACK_RUNS) == 0;
}

void IecStackLeave(IEC_STACK *stack)
{
    IecStackSwitchBack(stack);
}

static void call_below(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    IecStackCallBelow(fn, arg, stack->back);
}

#endif

void IecStackCall(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    __atomic_store_n(&stack->running, IEC_STACK_WAITS, __ATOMIC_SEQ_CST);
    call_below(stack, fn, arg);
    __atomic_store_n(&stack->running, IEC_STACK_RUNS, __ATOMIC_SEQ_CST);
}
