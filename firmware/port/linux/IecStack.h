/*
 * IecStack.h - stacks of their own for IEC code: nothing of the runtime is on them, and guards are around them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port; on Windows, a fiber is such a stack (../windows/SysExcept.c). A program that writes beyond a local array destroys what IEC code left there,
 * or meets a guard; what the thread goes on with afterwards is on the stack it came from. Only the stack record, which
 * is found through a thread-local variable, leads back there.
 */
#ifndef IECSTACK_H
#define IECSTACK_H

#include "CmpStd.h"

#if defined(__x86_64__)
#include <x86intrin.h>
#endif

/* What a stack is used for. */
enum { IEC_STACK_UNUSED = 0, IEC_STACK_RUNS = 1, IEC_STACK_WAITS = 2 /* for a call outside */ };

/* The layout of the first three is known to IecStackSwitch.S. */
typedef struct {
    uintptr_t back;   /* stack pointer of the thread, saved while IEC code runs */
    uintptr_t top;    /* past the highest address of the IEC stack */
    RTS_UI32 running; /* IEC_STACK_...; atomic */
    uintptr_t bottom; /* lowest address */
    struct {
        void *own_state, *own_bottom; /* of the address sanitizer */
        size_t own_size;
    } sanitizer;
} IEC_STACK;

/* Memory for a stack that has none; false when the process may not have more. */
bool IecStackReserve(IEC_STACK *stack);
/* The memory for the signal handlers of the thread that runs on it. */
void *IecStackSignalMemory(const IEC_STACK *stack, size_t *size);

/* Whether the address is in the guard below the stack, where it grows into. */
bool IecStackIsOverflow(const IEC_STACK *stack, uintptr_t address);

/* Runs fn(arg) on the IEC stack: true when it returned, false when IecStackLeave was called. */
bool IecStackRun(IEC_STACK *stack, void (*fn)(void *arg), void *arg);
/* Ends the running IecStackRun of this thread, from the IEC stack or from a signal handler. */
void IecStackLeave(IEC_STACK *stack) __attribute__((noreturn));

/* Calls fn(arg) on the stack of the thread, from the IEC stack. */
void IecStackCall(IEC_STACK *stack, void (*fn)(void *arg), void *arg);

/* The record of the calling thread, NULL without: found whatever its registers hold. Reading it in a handler never
 * allocates. */
#if defined(_WIN32)
extern __thread IEC_STACK *IecStackOfThread;
#else
extern __thread IEC_STACK *IecStackOfThread __attribute__((tls_model("initial-exec"), visibility("hidden")));
#endif

/* For C code that goes on after IEC code, which may have set flags with which C code faults: that string instructions go
 * backwards, which the kernel clears for a handler, and that alignment is checked, which it does not. IecStackSwitch does
 * it on its way back. */
static inline void IecStackResetFlags(void)
{
#if defined(__x86_64__)
    __writeeflags(0);
#endif
}

/* In SysExcept.c: IecStackCall of what is not IEC code. It must return. Returns the code of an abort of the running
 * SysExceptTry that came during the call, for the caller to raise; RTSEXCPT_NOEXCEPTION without one. */
RTS_UI32 IecStackCallOutside(IEC_STACK *stack, void (*fn)(void *arg), void *arg);

/* In SysExcept.c, for the handler of a signal that ends the process: the last address of the application's code that the
 * calling thread was at, 0 when it is not in IEC code. *arg: what its latest SysExceptTry was called with, NULL when it
 * called none. */
uintptr_t IecStackLastPlace(const void *ucontext, const void **arg);

#endif
