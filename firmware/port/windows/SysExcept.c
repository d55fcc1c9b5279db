/*
 * SysExcept.c - exceptions of IEC code on Windows: those of the system become one return from SysExceptTry.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For the simulator, in processes that are not ours (Python): a vectored handler is taken at first use, and sees only
 * what happens in IEC code. That runs in a fiber, which is a stack of its own that the system knows, so that what it
 * destroys there is its own. IEC code is left by moving its thread to leave_fiber at the top of that stack.
 */
#include "SysExcept.h"

#include "../linux/IecStack.h"
#include "SysDebug.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <windows.h>

#pragma GCC diagnostic ignored "-Warray-bounds" /* GetCurrentFiber reads at a small address, in a segment */

enum {
    MAX_CONTEXTS = 64,         /* threads that run IEC code at the same time */
    HANDLER_STACK = 64 * 1024, /* of RTS_IEC_STACK_SIZE besides: the system calls handlers on the stack that failed */
    START = 256,               /* of a stack, which is the system's [bytes] */
    FLAGS = 0x202,             /* neither backwards, nor with checks of the alignment, nor step by step */
    SINGLE_STEP = 0x100,
};

/* A call of the fiber. */
typedef struct {
    void (*fn)(void *arg);
    void *arg;
} CALL;

/* A thread that runs IEC code. The thread itself writes `stack.running` and `arg`; SysExceptBreak reads them from another. */
typedef struct {
    IEC_STACK stack; /* the first member */
    void *own;       /* the fiber that the thread was before */
    void *fiber;     /* with the IEC stack; NULL: not yet */
    HANDLE thread;
    CALL call;           /* of IEC code */
    CALL outside;        /* that IEC code waits for; fn NULL: none */
    const void *arg;     /* of the running SysExceptTry */
    RTS_UI32 break_code; /* of a break while it waited; atomic */
    RTS_EXCEPTION exception;
    bool left; /* the call did not return */
    int used;
} CONTEXT_OF_THREAD;

static struct {
    pthread_mutex_t lock;
    pthread_once_t once;
    pthread_key_t key; /* its destructor frees the context of a thread that ends */
    void *handler;
    PF_SYS_DEBUG debugger; /* atomic */
    CONTEXT_OF_THREAD context[MAX_CONTEXTS];
} state = {.lock = PTHREAD_MUTEX_INITIALIZER, .once = PTHREAD_ONCE_INIT};

__thread IEC_STACK *IecStackOfThread;

static CONTEXT_OF_THREAD *self(void)
{
    return (CONTEXT_OF_THREAD *)IecStackOfThread;
}

static void fatal(const char *message)
{
    fprintf(stderr, "SysExcept: %s\n", message);
    abort();
}

static bool runs_iec_code(const CONTEXT_OF_THREAD *context)
{
    return context != NULL && __atomic_load_n(&context->stack.running, __ATOMIC_ACQUIRE) == IEC_STACK_RUNS;
}

static void set_running(CONTEXT_OF_THREAD *context, RTS_UI32 running)
{
    __atomic_store_n(&context->stack.running, running, __ATOMIC_SEQ_CST);
}

/* Whether the caller is to leave the IEC code; from then on a break is too late. */
static bool begin_to_leave(CONTEXT_OF_THREAD *context)
{
    RTS_UI32 expected = IEC_STACK_RUNS;
    return context != NULL && __atomic_compare_exchange_n(&context->stack.running, &expected, IEC_STACK_UNUSED, false,
                                                          __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
}

/* ---- the fiber ---- */

/* One call after the other. The register that held the context may have been destroyed. */
static void __attribute__((noreturn)) run_calls(void)
{
    for (;;) {
        SwitchToFiber(self()->own);
        set_running(self(), IEC_STACK_RUNS);
        self()->call.fn(self()->call.arg);
        set_running(self(), IEC_STACK_UNUSED);
        self()->left = false;
    }
}

static void CALLBACK begin_fiber(void *param)
{
    CONTEXT_OF_THREAD *context = param;
    ULONG_PTR low, high;
    GetCurrentThreadStackLimits(&low, &high);
    context->stack.top = high - START;
    context->stack.bottom = low;
    run_calls();
}

static void __attribute__((noreturn)) leave_fiber(void)
{
    self()->left = true;
    run_calls();
}

/* Where leave_fiber begins: a function is entered with the return address on an aligned stack. */
static uintptr_t stack_of_leaving(const CONTEXT_OF_THREAD *context)
{
    enum { SHADOW = 32, ALIGNMENT = 16 };
    return ((context->stack.top - SHADOW) & ~(uintptr_t)(ALIGNMENT - 1)) - sizeof(void *);
}

static void end_fiber(CONTEXT_OF_THREAD *context)
{
    if (context->fiber != NULL) {
        DeleteFiber(context->fiber);
        context->fiber = NULL;
    }
}

/* All of its memory is there at once: programs need not touch a stack page by page. */
static void make_fiber(CONTEXT_OF_THREAD *context)
{
    enum { SIZE = RTS_IEC_STACK_SIZE + HANDLER_STACK };
    context->fiber = CreateFiberEx(SIZE, SIZE, 0, begin_fiber, context);
    if (context->fiber == NULL) {
        fatal("no memory is left for the stack of a task");
    }
    SwitchToFiber(context->fiber);
}

/* ---- exceptions ---- */

typedef struct {
    uintptr_t address, stack;
} PLACE;

static PLACE place_of(const CONTEXT *registers)
{
    return (PLACE){.address = registers->Rip, .stack = registers->Rsp};
}

/* What is to be read of the IEC stack from a stack pointer on, which may have been destroyed. */
static const uintptr_t *readable(const IEC_STACK *stack, uintptr_t pointer)
{
    uintptr_t from = pointer & ~(sizeof(uintptr_t) - 1);
    return (const uintptr_t *)(from >= stack->bottom && from < stack->top ? from : stack->top);
}

static void note(CONTEXT_OF_THREAD *context, RTS_UI32 code, PLACE place)
{
    SysExceptTrace(place.address, readable(&context->stack, place.stack), (const uintptr_t *)context->stack.top, 0);
    context->exception.code = code;
    context->exception.address = place.address;
}

/* The thread goes on in leave_fiber. */
static void leave_from(CONTEXT_OF_THREAD *context, RTS_UI32 code, CONTEXT *registers)
{
    note(context, code, place_of(registers));
    registers->Rip = (uintptr_t)leave_fiber;
    registers->Rsp = stack_of_leaving(context);
    registers->EFlags = FLAGS;
}

/* RTSEXCPT_NOEXCEPTION: not one of the processor. */
static RTS_UI32 code_of(const EXCEPTION_RECORD *record)
{
    switch (record->ExceptionCode) {
    case EXCEPTION_STACK_OVERFLOW:
        return RTSEXCPT_STACK_OVERFLOW;
    case EXCEPTION_ACCESS_VIOLATION:
    case EXCEPTION_IN_PAGE_ERROR:
    case EXCEPTION_DATATYPE_MISALIGNMENT:
    case EXCEPTION_PRIV_INSTRUCTION:
        return RTSEXCPT_ACCESS_VIOLATION;
    case EXCEPTION_INT_DIVIDE_BY_ZERO:
    case EXCEPTION_INT_OVERFLOW: /* of a division */
        return RTSEXCPT_DIVIDEBYZERO;
    case EXCEPTION_ILLEGAL_INSTRUCTION:
    case EXCEPTION_BREAKPOINT:
    case EXCEPTION_SINGLE_STEP:
        return RTSEXCPT_ILLEGAL_INSTRUCTION;
    default:
        return RTSEXCPT_NOEXCEPTION;
    }
}

/* A frame that ends below the stack, in memory that does not exist. */
static RTS_UI32 fault_code(const CONTEXT_OF_THREAD *context, const EXCEPTION_RECORD *record)
{
    enum { GUARD = 64 * 1024 };
    RTS_UI32 code = code_of(record);
    bool has_address = record->ExceptionCode == EXCEPTION_ACCESS_VIOLATION && record->NumberParameters > 1;
    bool overflow = has_address && context->stack.bottom - record->ExceptionInformation[1] - 1 < GUARD;
    return overflow ? (RTS_UI32)RTSEXCPT_STACK_OVERFLOW : code;
}

void SysDebugSetHandler(PF_SYS_DEBUG handler)
{
    __atomic_store_n(&state.debugger, handler, __ATOMIC_RELEASE);
}

static SYS_DEBUG_ACTION ask_debugger(const CONTEXT_OF_THREAD *context, RTS_UI32 code, PLACE place)
{
    PF_SYS_DEBUG debugger = __atomic_load_n(&state.debugger, __ATOMIC_ACQUIRE);
    SYS_DEBUG_STOP stop = {code, place.address, place.stack, context->stack.top, 0, context->arg};
    return debugger != NULL ? debugger(&stop) : SYS_DEBUG_LEAVE;
}

/* Whether IEC code goes on. Windows says where the trap is. */
static bool goes_on(const CONTEXT_OF_THREAD *context, const EXCEPTION_RECORD *record, CONTEXT *registers)
{
    PLACE place = place_of(registers);
    RTS_UI32 code = fault_code(context, record);
    if (record->ExceptionCode == EXCEPTION_SINGLE_STEP) {
        registers->EFlags &= ~(DWORD)SINGLE_STEP;
        (void)ask_debugger(context, RTSEXCPT_NOEXCEPTION, place);
        return true;
    }
    if (record->ExceptionCode == EXCEPTION_BREAKPOINT) {
        place.address = (uintptr_t)record->ExceptionAddress;
        code = RTSEXCPT_BREAKPOINT;
    }
    SYS_DEBUG_ACTION action = ask_debugger(context, code, place);
    if (action == SYS_DEBUG_LEAVE) {
        return false;
    }
    registers->Rip = place.address;
    if (action == SYS_DEBUG_PASS) {
        registers->EFlags |= SINGLE_STEP;
    }
    return true;
}

static bool is_debugged(const CONTEXT_OF_THREAD *context)
{
    return __atomic_load_n(&state.debugger, __ATOMIC_RELAXED) != NULL && runs_iec_code(context);
}

static LONG CALLBACK on_exception(EXCEPTION_POINTERS *info)
{
    CONTEXT_OF_THREAD *context = self();
    IecStackResetFlags();
    if (!runs_iec_code(context) || code_of(info->ExceptionRecord) == RTSEXCPT_NOEXCEPTION) {
        return EXCEPTION_CONTINUE_SEARCH;
    }
    if (is_debugged(context) && goes_on(context, info->ExceptionRecord, info->ContextRecord)) {
        return EXCEPTION_CONTINUE_EXECUTION;
    }
    if (begin_to_leave(context)) {
        leave_from(context, fault_code(context, info->ExceptionRecord), info->ContextRecord);
    }
    return EXCEPTION_CONTINUE_EXECUTION;
}

/* ---- contexts ---- */

/* At the end of a thread. */
static void detach(void *param)
{
    CONTEXT_OF_THREAD *context = param;
    IecStackOfThread = NULL;
    end_fiber(context);
    pthread_mutex_lock(&state.lock);
    CloseHandle(context->thread);
    context->used = 0;
    pthread_mutex_unlock(&state.lock);
}

static void prepare(void)
{
    if (pthread_key_create(&state.key, detach) != 0) {
        fatal("no thread key left in this process");
    }
}

static CONTEXT_OF_THREAD *take_context(void)
{
    CONTEXT_OF_THREAD *context = state.context;
    HANDLE process = GetCurrentProcess();
    while (context < state.context + MAX_CONTEXTS && context->used) {
        context++;
    }
    if (context == state.context + MAX_CONTEXTS ||
        !DuplicateHandle(process, GetCurrentThread(), process, &context->thread, 0, FALSE, DUPLICATE_SAME_ACCESS)) {
        fatal("too many threads run IEC code");
    }
    context->used = 1;
    return context;
}

static void attach(void)
{
    pthread_once(&state.once, prepare);
    pthread_mutex_lock(&state.lock);
    if (state.handler == NULL) {
        state.handler = AddVectoredExceptionHandler(1, on_exception);
    }
    CONTEXT_OF_THREAD *context = self() != NULL ? self() : take_context();
    pthread_mutex_unlock(&state.lock);
    pthread_setspecific(state.key, context);
    IecStackOfThread = &context->stack;
}

static CONTEXT_OF_THREAD *own_context(void)
{
    if (self() == NULL || state.handler == NULL) {
        attach();
    }
    CONTEXT_OF_THREAD *context = self();
    context->own = IsThreadAFiber() ? GetCurrentFiber() : ConvertThreadToFiber(NULL);
    if (context->fiber == NULL) {
        make_fiber(context);
    }
    return context;
}

void SysExceptShutdown(void)
{
    pthread_mutex_lock(&state.lock);
    if (state.handler != NULL) {
        RemoveVectoredExceptionHandler(state.handler);
        state.handler = NULL;
    }
    pthread_mutex_unlock(&state.lock);
}

/* ---- the interface ---- */

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    CONTEXT_OF_THREAD *context = own_context();
    context->call = (CALL){fn, arg};
    __atomic_store_n(&context->break_code, RTSEXCPT_NOEXCEPTION, __ATOMIC_SEQ_CST);
    __atomic_store_n(&context->arg, arg, __ATOMIC_RELEASE);
    SwitchToFiber(context->fiber);
    while (context->outside.fn != NULL) {
        CALL outside = context->outside;
        outside.fn(outside.arg);
        context->outside.fn = NULL;
        SwitchToFiber(context->fiber);
    }
    *exception = context->left ? context->exception : (RTS_EXCEPTION){RTSEXCPT_NOEXCEPTION, 0};
    if (exception->code == RTSEXCPT_STACK_OVERFLOW) {
        end_fiber(context); /* its guard is gone */
    }
    return !context->left;
}

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    CONTEXT_OF_THREAD *context = self();
    PLACE place = {.address = address, .stack = (uintptr_t)stack};
    IecStackResetFlags();
    if (is_debugged(context)) {
        (void)ask_debugger(context, code, place);
    }
    if (!begin_to_leave(context)) {
        fatal("an exception was raised outside of IEC code");
    }
    note(context, code, place);
    __asm__ volatile("movq %0, %%rsp\n\tjmp *%1" : : "r"(stack_of_leaving(context)), "r"(leave_fiber) : "memory");
    __builtin_unreachable();
}

RTS_UI32 IecStackCallOutside(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    CONTEXT_OF_THREAD *context = (CONTEXT_OF_THREAD *)stack;
    context->outside = (CALL){fn, arg};
    set_running(context, IEC_STACK_WAITS);
    SwitchToFiber(context->own);
    set_running(context, IEC_STACK_RUNS);
    return __atomic_load_n(&self()->break_code, __ATOMIC_SEQ_CST);
}

static bool runs(const CONTEXT_OF_THREAD *context, const void *arg)
{
    return context->used && __atomic_load_n(&context->stack.running, __ATOMIC_ACQUIRE) != IEC_STACK_UNUSED &&
           __atomic_load_n(&context->arg, __ATOMIC_ACQUIRE) == arg;
}

/* Only compiled code is left: a C function that it called may be within the system. The watchdog tries again. */
static void leave_code(CONTEXT_OF_THREAD *context, RTS_UI32 code)
{
    CONTEXT registers;
    memset(&registers, 0, sizeof registers);
    registers.ContextFlags = CONTEXT_CONTROL;
    if (GetThreadContext(context->thread, &registers) && SysExceptIsCode(registers.Rip) && begin_to_leave(context)) {
        leave_from(context, code, &registers);
        SetThreadContext(context->thread, &registers);
    }
}

static void break_if_it_runs(CONTEXT_OF_THREAD *context, const void *arg, RTS_UI32 code)
{
    if (!runs(context, arg) || SuspendThread(context->thread) == (DWORD)-1) {
        return;
    }
    if (runs(context, arg)) {
        __atomic_store_n(&context->break_code, code, __ATOMIC_SEQ_CST);
        leave_code(context, code);
    }
    ResumeThread(context->thread);
}

void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    pthread_mutex_lock(&state.lock);
    for (CONTEXT_OF_THREAD *context = state.context; context < state.context + MAX_CONTEXTS; context++) {
        break_if_it_runs(context, arg, code);
    }
    pthread_mutex_unlock(&state.lock);
}

static RTS_I64 used_ns(const CONTEXT_OF_THREAD *context)
{
    FILETIME created, ended, kernel, user;
    if (!GetThreadTimes(context->thread, &created, &ended, &kernel, &user)) {
        return -1;
    }
    RTS_I64 high = (RTS_I64)kernel.dwHighDateTime + user.dwHighDateTime;
    return (((high << 32) + kernel.dwLowDateTime) + user.dwLowDateTime) * 100;
}

/* The lock keeps the thread from ending meanwhile. */
RTS_I64 SysExceptGetUsedNs(const void *arg)
{
    RTS_I64 ns = -1;
    pthread_mutex_lock(&state.lock);
    for (const CONTEXT_OF_THREAD *context = state.context; ns < 0 && context < state.context + MAX_CONTEXTS;
         context++) {
        if (runs(context, arg)) {
            ns = used_ns(context);
        }
    }
    pthread_mutex_unlock(&state.lock);
    return ns;
}
