/*
 * SysExcept.c - exceptions of IEC code on Linux: signals become one return from SysExceptTry.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port, that on macOS too, so it depends on no other file of a port. It also lives in processes that are
 * not ours (Python): signal handlers are taken at first use, faults outside SysExceptTry go to those who had them
 * before, and SysExceptShutdown gives everything back.
 *
 * IEC code runs on a stack of its own (IecStack.h), so that what it destroys there is its own. Leaving it from a handler
 * is sound: IEC code and the C functions it may call hold no lock and own nothing. The handlers block no signal
 * (SA_NODEFER, empty mask), so no mask has to be saved.
 */
#define _GNU_SOURCE
#include "SysExcept.h"

#include "../baremetal/cortexm/ThumbStep.h"
#include "IecStack.h"
#include "StepOver.h"
#include "SysDebug.h"
#include "SysExceptCatch.h"
#if defined(__APPLE__)
#include "../macos/ThreadState.h"
#else
#include "ThreadState.h"
#endif

#include <stdio.h>
#include <stdlib.h>

enum { MAX_CONTEXTS = 64 }; /* threads that run IEC code at the same time */

/* A thread that runs IEC code. The thread itself writes `stack.running`, `round` and `arg`; SysExceptBreak reads them
 * from another. */
typedef struct {
    IEC_STACK stack;      /* the first member; stays when the thread ends, for the next one */
    RTS_UI32 round;       /* counts SysExceptTry, so that a break that comes late does not hit the next one */
    RTS_UI32 break_round; /* the round to break */
    RTS_UI32 break_code;
    const void *arg;         /* of the running SysExceptTry */
    RTS_EXCEPTION exception; /* on the way from the handler to SysExceptTry */
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *tries; /* SysExceptCatch.h */
#endif
    pthread_t thread;
    int used;
} CONTEXT;

typedef struct {
    int number;
    RTS_UI32 code;
    int taken;
    struct sigaction previous;
} SIGNAL;

static struct {
    pthread_mutex_t lock;
    pthread_once_t once;
    pthread_key_t key; /* its destructor frees the context of a thread that ends */
    int installed;
    PF_SYS_DEBUG debugger; /* atomic */
    SIGNAL signal[6];
    CONTEXT context[MAX_CONTEXTS];
} state = {
    .lock = PTHREAD_MUTEX_INITIALIZER,
    .once = PTHREAD_ONCE_INIT,
    .signal =
        {
            {.number = SIGSEGV, .code = RTSEXCPT_ACCESS_VIOLATION},
            {.number = SIGBUS, .code = RTSEXCPT_ACCESS_VIOLATION},
            {.number = SIGFPE, .code = RTSEXCPT_DIVIDEBYZERO},
            {.number = SIGILL, .code = RTSEXCPT_ILLEGAL_INSTRUCTION},
            {.number = SIGTRAP, .code = RTSEXCPT_ILLEGAL_INSTRUCTION}, /* what a compiler's trap is on AArch64 */
            {.number = 0, .code = RTSEXCPT_WATCHDOG},                  /* the break signal, known at run time only */
        },
};

/* That of the calling thread, NULL without. */
static CONTEXT *self(void)
{
    return (CONTEXT *)IecStackOfThread;
}

static void fatal(const char *message)
{
    fprintf(stderr, "SysExcept: %s\n", message);
    abort();
}

static bool runs_iec_code(const CONTEXT *context)
{
    return context != NULL && __atomic_load_n(&context->stack.running, __ATOMIC_ACQUIRE) == IEC_STACK_RUNS;
}

/* ---- in the handler ---- */

/* The stack is read as it is, whatever a sanitizer thinks of the gaps between its variables. */
#define READS_STACK __attribute__((no_sanitize("address")))

/* What a stack that overflowed shows: below what the running calls have left is what earlier ones have, so only as
 * many words as are kept. */
READS_STACK static const uintptr_t *highest_calls(const IEC_STACK *stack)
{
    const uintptr_t *word = (const uintptr_t *)stack->top;
    int found = 0;
    while ((uintptr_t)word > stack->bottom && found < EXCEPT_MAX_CALLS) {
        word--;
        found += SysExceptIsReturn(*word);
    }
    return word;
}

/* What is to be read of the IEC stack from a stack pointer on, which may have been destroyed. */
static const uintptr_t *readable(const IEC_STACK *stack, uintptr_t pointer)
{
    uintptr_t from = pointer & ~(sizeof(uintptr_t) - 1);
    if (IecStackIsOverflow(stack, pointer)) {
        return highest_calls(stack);
    }
    return (const uintptr_t *)(from >= stack->bottom && from < stack->top ? from : stack->top);
}

/* Whether the handler is to leave the IEC code. From then on a break is too late, also one that interrupts this handler:
 * what leaves it (with a sanitizer, more than is here) is not made to be interrupted by itself. */
static bool begin_to_leave(CONTEXT *context)
{
    RTS_UI32 expected = IEC_STACK_RUNS;
    return context != NULL && __atomic_compare_exchange_n(&context->stack.running, &expected, IEC_STACK_UNUSED, false,
                                                          __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
}

static void leave(CONTEXT *context, RTS_UI32 code, PLACE place)
{
    const uintptr_t *end = (const uintptr_t *)context->stack.top;
    SysExceptTrace(place.address, readable(&context->stack, place.stack), end, place.link);
    context->exception.code = code;
    context->exception.address = place.address;
    IecStackLeave(&context->stack);
}

/* Keeps the registers of the fault that leave() is called for next. `fault`: the address that could not be accessed. */
static void note_registers(const CONTEXT *context, const void *ucontext, uintptr_t fault)
{
#if EXCEPT_REGISTERS > 0
    uintptr_t values[EXCEPT_REGISTERS];
    read_registers(ucontext, fault, values);
    SysExceptNoteRegisters(readable(&context->stack, place_of(ucontext).stack), REGISTERS_KIND, values);
#else
    RTS_UNUSED(context);
    RTS_UNUSED(ucontext);
    RTS_UNUSED(fault);
#endif
}

/* C code that IEC code called: the call that is nearest on the stack. */
READS_STACK static uintptr_t last_return(const uintptr_t *word, const uintptr_t *end)
{
    while (word < end && !SysExceptIsReturn(*word)) {
        word++;
    }
    return word < end ? *word - 1 : 0;
}

uintptr_t IecStackLastPlace(const void *ucontext, const void **arg)
{
    const CONTEXT *context = self();
    PLACE place = place_of(ucontext);
    *arg = context != NULL ? context->arg : NULL;
    if (!runs_iec_code(context)) {
        return 0;
    }
    if (SysExceptIsCode(place.address)) {
        return place.address;
    }
    return last_return(readable(&context->stack, place.stack), (const uintptr_t *)context->stack.top);
}

static SIGNAL *find_signal(int number)
{
    SIGNAL *found = state.signal;
    while (found->number != number) {
        found++;
    }
    return found;
}

static RTS_UI32 fault_code(const CONTEXT *context, const SIGNAL *signal, const siginfo_t *info)
{
    bool is_access = signal->code == RTSEXCPT_ACCESS_VIOLATION; /* SIGBUS is that of a guard on macOS */
    bool overflow = is_access && IecStackIsOverflow(&context->stack, (uintptr_t)info->si_addr);
    return overflow ? (RTS_UI32)RTSEXCPT_STACK_OVERFLOW : signal->code;
}

/* A fault that is not ours: the previous owner's, or the end of the process with a core dump of the real place. */
static void chain(const SIGNAL *signal, siginfo_t *info, void *ucontext)
{
    const struct sigaction *previous = &signal->previous;
    if ((previous->sa_flags & SA_SIGINFO) != 0) {
        previous->sa_sigaction(signal->number, info, ucontext);
    } else if (previous->sa_handler == SIG_DFL) {
        sigaction(signal->number, previous, NULL);
        if (info->si_code <= 0) {
            raise(signal->number); /* another process sent it; a real fault occurs again */
        }
    } else if (previous->sa_handler != SIG_IGN) {
        previous->sa_handler(signal->number);
    }
}

/* ---- rts_try ---- */

#if RTS_STRUCTURED_EXCEPTION_HANDLING
/* Goes to the rts_try around C code that failed, if there is one. An exception in code of the program is the program's. */
static void catch_in_c(CONTEXT *context, RTS_UI32 code, PLACE place)
{
    RTS_TRY *found = NULL;
    if (context != NULL && !SysExceptIsCode(place.address)) {
        RTS_UI32 stack = __atomic_load_n(&context->stack.running, __ATOMIC_RELAXED);
        found = SysExceptCatch(&context->tries, stack, code, place.address, place.stack);
    }
    if (found != NULL) {
        longjmp(found->buffer, 1);
    }
}
#else
#define catch_in_c(context, code, place) ((void)0)
#endif

/* ---- the debugger ---- */

void SysDebugSetHandler(PF_SYS_DEBUG handler)
{
    __atomic_store_n(&state.debugger, handler, __ATOMIC_RELEASE);
}

static SYS_DEBUG_ACTION ask_debugger(const CONTEXT *context, RTS_UI32 code, PLACE place)
{
    PF_SYS_DEBUG debugger = __atomic_load_n(&state.debugger, __ATOMIC_ACQUIRE);
    SYS_DEBUG_STOP stop = {code, place.address, place.stack, context->stack.top, place.link, context->arg};
    return debugger != NULL ? debugger(&stop) : SYS_DEBUG_LEAVE;
}

/* Whether IEC code goes on from a signal. */
#if defined(__x86_64__)
static bool goes_on(const CONTEXT *context, RTS_UI32 code, const siginfo_t *info, void *ucontext)
{
    enum { SINGLE_STEP = 0x100 };
    greg_t *registers = ((ucontext_t *)ucontext)->uc_mcontext.gregs;
    PLACE place = place_of(ucontext);
    bool stepped = info->si_signo == SIGTRAP && info->si_code == TRAP_TRACE;
    if (stepped) {
        registers[REG_EFL] &= ~SINGLE_STEP;
        (void)ask_debugger(context, RTSEXCPT_NOEXCEPTION, place);
        return true;
    }
    if (info->si_signo == SIGTRAP) {
        place.address--;
        code = RTSEXCPT_BREAKPOINT;
    }
    SYS_DEBUG_ACTION action = ask_debugger(context, code, place);
    if (action == SYS_DEBUG_LEAVE) {
        return false;
    }
    registers[REG_RIP] = (greg_t)place.address;
    if (action == SYS_DEBUG_PASS) {
        registers[REG_EFL] |= SINGLE_STEP;
    }
    return true;
}
#define abandon_step() ((void)0)
#elif defined(__APPLE__) /* without traps; an exception is shown where it occurred */
static bool goes_on(const CONTEXT *context, RTS_UI32 code, const siginfo_t *info, void *ucontext)
{
    RTS_UNUSED(info);
    return ask_debugger(context, code, place_of(ucontext)) != SYS_DEBUG_LEAVE;
}
#define abandon_step() ((void)0)
#else
#if defined(__arm__)
bool ThumbMayRead(uintptr_t address, RTS_UI32 size)
{
    const IEC_STACK *stack = &self()->stack;
    return (address >= stack->bottom && address < stack->top && size <= stack->top - address) ||
           (SysExceptIsCode(address) && SysExceptIsCode(address + size - 1));
}
#endif

static bool goes_on(const CONTEXT *context, RTS_UI32 code, const siginfo_t *info, void *ucontext)
{
    PLACE place = place_of(ucontext);
    STEP_TRAP step = StepEnd(ucontext);
    if (step == STEP_OF_ANOTHER) {
        return true;
    }
    if (step != STEP_NONE) {
        (void)ask_debugger(context, RTSEXCPT_NOEXCEPTION, place);
    }
    if (step == STEP_ENDED && !SysDebugIsTrap(place.address)) {
        return true;
    }
    if (info->si_signo == SIGTRAP || (info->si_signo == SIGILL && SysDebugIsTrap(place.address))) {
        code = RTSEXCPT_BREAKPOINT;
    }
    SYS_DEBUG_ACTION action = ask_debugger(context, code, place);
    if (action == SYS_DEBUG_PASS && StepBegin(ucontext)) {
        (void)ask_debugger(context, RTSEXCPT_NOEXCEPTION, place);
    }
    return action != SYS_DEBUG_LEAVE;
}

static void abandon_step(void)
{
    (void)StepEnd(NULL);
}
#endif

static bool is_debugged(const CONTEXT *context)
{
    return __atomic_load_n(&state.debugger, __ATOMIC_RELAXED) != NULL && runs_iec_code(context);
}

static void on_fault(int number, siginfo_t *info, void *ucontext)
{
    IecStackResetFlags();
    CONTEXT *context = self();
    SIGNAL *signal = find_signal(number);
    if (info->si_code > 0) { /* none that another process sent */
        catch_in_c(context, signal->code, place_of(ucontext));
    }
    if (is_debugged(context) && goes_on(context, fault_code(context, signal, info), info, ucontext)) {
        return;
    }
    if (begin_to_leave(context)) {
        bool is_access = number == SIGSEGV || number == SIGBUS;
        note_registers(context, ucontext, is_access ? (uintptr_t)info->si_addr : 0);
        leave(context, fault_code(context, signal, info), place_of(ucontext));
    }
    chain(signal, info, ucontext);
}

/* A break of the round that runs, which may have come when a call outside ran. */
static bool is_broken(const CONTEXT *context)
{
    return __atomic_load_n(&context->break_round, __ATOMIC_SEQ_CST) == context->round;
}

RTS_UI32 IecStackCallOutside(IEC_STACK *stack, void (*fn)(void *arg), void *arg)
{
    const CONTEXT *context;

    IecStackCall(stack, fn, arg);
    context = self();
    return is_broken(context) ? context->break_code : (RTS_UI32)RTSEXCPT_NOEXCEPTION;
}

static void on_break(int number, siginfo_t *info, void *ucontext)
{
    IecStackResetFlags();
    CONTEXT *context = self();
    const struct sigaction *previous = &find_signal(number)->previous;
    if (runs_iec_code(context) && is_broken(context) && begin_to_leave(context)) {
        abandon_step();
        note_registers(context, ucontext, 0);
        leave(context, context->break_code, place_of(ucontext));
    }
    if ((previous->sa_flags & SA_SIGINFO) != 0) {
        previous->sa_sigaction(number, info, ucontext); /* another runtime of this process, which may have sent it */
    }
}

/* ---- taking and giving back ---- */

static bool is_break(const SIGNAL *signal)
{
    return signal == &state.signal[RTS_COUNT(state.signal) - 1];
}

static void install(void)
{
    for (size_t i = 0; i < RTS_COUNT(state.signal); i++) {
        SIGNAL *signal = &state.signal[i];
        struct sigaction action = {.sa_flags = SA_SIGINFO | SA_ONSTACK | SA_NODEFER | SA_RESTART};
        action.sa_sigaction = is_break(signal) ? on_break : on_fault;
        sigemptyset(&action.sa_mask);
        if (!signal->taken) {
            sigaction(signal->number, &action, &signal->previous);
            signal->taken = 1;
        }
    }
    __atomic_store_n(&state.installed, 1, __ATOMIC_RELEASE);
}

static void give_back(SIGNAL *signal)
{
    struct sigaction now;
    struct sigaction ignore = {.sa_handler = SIG_IGN};
    sigaction(signal->number, NULL, &now);
    if ((now.sa_flags & SA_SIGINFO) == 0 || (now.sa_sigaction != on_fault && now.sa_sigaction != on_break)) {
        return; /* another handler was installed later and may still call this one: stay */
    }
    if (is_break(signal)) {
        sigaction(signal->number, &ignore, NULL); /* drops a break on its way, which would now end the process */
    }
    sigaction(signal->number, &signal->previous, NULL);
    signal->taken = 0;
}

void SysExceptShutdown(void)
{
    pthread_mutex_lock(&state.lock);
    if (state.installed) {
        for (size_t i = 0; i < RTS_COUNT(state.signal); i++) {
            give_back(&state.signal[i]);
        }
        state.installed = 0;
    }
    pthread_mutex_unlock(&state.lock);
}

/* ---- contexts ---- */

/* At the end of a thread. */
static void detach(void *param)
{
    CONTEXT *context = param;
    stack_t stack;
    size_t size;
    if (sigaltstack(NULL, &stack) == 0 && stack.ss_sp == IecStackSignalMemory(&context->stack, &size)) {
        stack_t none = {.ss_flags = SS_DISABLE};
        sigaltstack(&none, NULL);
    }
    IecStackOfThread = NULL;
    pthread_mutex_lock(&state.lock);
    context->used = 0;
    pthread_mutex_unlock(&state.lock);
}

static void prepare(void)
{
    state.signal[RTS_COUNT(state.signal) - 1].number = BREAK_SIGNAL;
    if (pthread_key_create(&state.key, detach) != 0) {
        fatal("no thread key left in this process");
    }
}

static CONTEXT *take_context(void)
{
    pthread_mutex_lock(&state.lock);
    CONTEXT *context = state.context;
    while (context < state.context + MAX_CONTEXTS && context->used) {
        context++;
    }
    if (context == state.context + MAX_CONTEXTS) {
        fatal("too many threads run IEC code");
    }
    context->used = 1;
    context->thread = pthread_self();
    pthread_mutex_unlock(&state.lock);
    return context;
}

/* A stack overflow leaves no room for a handler on the stack itself. */
static void give_signal_stack(const CONTEXT *context)
{
    stack_t stack;
    if (sigaltstack(NULL, &stack) == 0 && (stack.ss_flags & SS_DISABLE) != 0) {
        stack.ss_sp = IecStackSignalMemory(&context->stack, &stack.ss_size);
        stack.ss_flags = 0;
        sigaltstack(&stack, NULL);
    }
}

static void unblock_signals(void)
{
    sigset_t set;
    sigemptyset(&set);
    for (size_t i = 0; i < RTS_COUNT(state.signal); i++) {
        sigaddset(&set, state.signal[i].number);
    }
    pthread_sigmask(SIG_UNBLOCK, &set, NULL);
}

/* Makes the calling thread a context and the handlers ours. */
static CONTEXT *attach(void)
{
    pthread_once(&state.once, prepare);
    pthread_mutex_lock(&state.lock);
    install();
    pthread_mutex_unlock(&state.lock);
    if (self() == NULL) {
        CONTEXT *context = take_context();
        if (!IecStackReserve(&context->stack)) {
            fatal("no address space is left for the stack of a task: raise the limit (ulimit -v)");
        }
        give_signal_stack(context);
        pthread_setspecific(state.key, context);
        IecStackOfThread = &context->stack;
    }
    unblock_signals();
    return self();
}

static CONTEXT *own_context(void)
{
    CONTEXT *context = self();
    return context != NULL && __atomic_load_n(&state.installed, __ATOMIC_RELAXED) ? context : attach();
}

/* ---- the interface ---- */

static void begin_round(CONTEXT *context, const void *arg)
{
    __atomic_store_n(&context->round, context->round + 1, __ATOMIC_RELEASE);
    __atomic_store_n(&context->arg, arg, __ATOMIC_RELEASE);
}

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    CONTEXT *context = own_context();
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *outer = context->tries;
#endif
    begin_round(context, arg);
    bool ended = IecStackRun(&context->stack, fn, arg);
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    context->tries = outer; /* an exception leaves those within registered */
#endif
    if (!ended) {
        *exception = context->exception;
        return false;
    }
    exception->code = RTSEXCPT_NOEXCEPTION;
    exception->address = 0;
    return true;
}

#if RTS_STRUCTURED_EXCEPTION_HANDLING
RTS_TRY **SysExceptTries(RTS_UI32 *place)
{
    CONTEXT *context = own_context();
    *place = __atomic_load_n(&context->stack.running, __ATOMIC_RELAXED);
    return &context->tries;
}
#endif

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    IecStackResetFlags();
    CONTEXT *context = self();
    PLACE place = {.address = address, .stack = (uintptr_t)stack};
    catch_in_c(context, code, place);
    if (is_debugged(context)) {
        (void)ask_debugger(context, code, place);
    }
    if (!begin_to_leave(context)) {
        fatal("an exception was raised outside of IEC code");
    }
    leave(context, code, place);
}

/* At most one signal per round: a thread that does not get the processor would find all of them stacked on top of each
 * other when it does. */
static void break_round(CONTEXT *context, RTS_UI32 round, RTS_UI32 code)
{
    if (context->break_round != round) {
        context->break_code = code;
        __atomic_store_n(&context->break_round, round, __ATOMIC_SEQ_CST);
        pthread_kill(context->thread, BREAK_SIGNAL);
    }
}

/* Its code, or a call outside that it waits for. */
static bool runs(const CONTEXT *context, const void *arg)
{
    return context->used && __atomic_load_n(&context->stack.running, __ATOMIC_ACQUIRE) != IEC_STACK_UNUSED &&
           __atomic_load_n(&context->arg, __ATOMIC_ACQUIRE) == arg;
}

/* The round is read first: when the thread goes on to its next one meanwhile, the break misses. */
static void break_if_it_runs(CONTEXT *context, const void *arg, RTS_UI32 code)
{
    RTS_UI32 round = __atomic_load_n(&context->round, __ATOMIC_ACQUIRE);
    if (runs(context, arg)) {
        break_round(context, round, code);
    }
}

/* The lock keeps the thread from ending meanwhile. */
RTS_I64 SysExceptGetUsedNs(const void *arg)
{
    RTS_I64 ns = -1;
    pthread_mutex_lock(&state.lock);
    for (const CONTEXT *context = state.context; ns < 0 && context < state.context + MAX_CONTEXTS; context++) {
        if (runs(context, arg)) {
            ns = thread_used_ns(context->thread);
        }
    }
    pthread_mutex_unlock(&state.lock);
    return ns;
}

void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    pthread_mutex_lock(&state.lock);
    for (CONTEXT *context = state.context; state.installed && context < state.context + MAX_CONTEXTS; context++) {
        break_if_it_runs(context, arg, code);
    }
    pthread_mutex_unlock(&state.lock);
}
