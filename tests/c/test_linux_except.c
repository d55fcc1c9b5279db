/*
 * test_linux_except.c - SysExcept: every way IEC code can go wrong ends in one return from SysExceptTry.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "../../firmware/port/linux/IecStack.h"
#include "SysExcept.h"
#include "test.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

static int *volatile null_pointer;
static volatile int sink;

static void do_nothing(void *arg)
{
    RTS_UNUSED(arg);
}

static void count_up(void *arg)
{
    ++*(int *)arg;
}

/* A sanitizer would report it before it happens. */
static void read_null(void *arg) __attribute__((no_sanitize("undefined")));

static void read_null(void *arg)
{
    RTS_UNUSED(arg);
    sink = *null_pointer;
}

static void divide_by_zero(void *arg)
{
    RTS_UNUSED(arg);
#if defined(__x86_64__)
    __asm__ volatile("xorl %%ecx, %%ecx\n\tmovl $1, %%eax\n\tcltd\n\tidivl %%ecx" ::: "eax", "ecx", "edx", "cc");
#else
    raise(SIGFPE); /* the hardware does not trap */
#endif
}

static void run_illegal_instruction(void *arg)
{
    RTS_UNUSED(arg);
    __builtin_trap();
}

static int (*volatile recurse_again)(int depth);

static int recurse(int depth)
{
    volatile char frame[256];
    frame[0] = (char)depth;
    return depth < 0 ? 0 : recurse_again(depth + 1) + frame[0];
}

static void overflow_stack(void *arg)
{
    RTS_UNUSED(arg);
    recurse_again = recurse;
    sink = recurse(0);
}

static void raise_bounds(void *arg)
{
    RTS_UNUSED(arg);
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0x1234, NULL);
}

static void loop_forever(void *arg)
{
    RTS_UNUSED(arg);
    for (;;) {
        sink++;
    }
}

static RTS_UI32 code_of(void (*fn)(void *))
{
    RTS_EXCEPTION exception = {0xDEAD, 0};
    bool left = !SysExceptTry(fn, NULL, &exception);
    CHECK_EQUAL(left, (exception.code != RTSEXCPT_NOEXCEPTION));
    return exception.code;
}

static void a_normal_return_is_no_exception(void)
{
    int calls = 0;
    RTS_EXCEPTION exception = {1, 1};
    CHECK(SysExceptTry(count_up, &calls, &exception));
    CHECK_EQUAL(calls, 1);
    CHECK(exception.code == RTSEXCPT_NOEXCEPTION && exception.address == 0);
}

static void reading_null_is_an_access_violation_at_its_instruction(void)
{
    RTS_EXCEPTION exception;
    CHECK(!SysExceptTry(read_null, NULL, &exception));
    CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
    CHECK(exception.address - (uintptr_t)read_null < 128);
}

static void dividing_by_zero_is_caught(void)
{
    CHECK_EQUAL(code_of(divide_by_zero), RTSEXCPT_DIVIDEBYZERO);
}

static void an_illegal_instruction_is_caught(void)
{
    CHECK_EQUAL(code_of(run_illegal_instruction), RTSEXCPT_ILLEGAL_INSTRUCTION);
}

static void raise_gives_its_code_and_address(void)
{
    RTS_EXCEPTION exception;
    CHECK(!SysExceptTry(raise_bounds, NULL, &exception));
    CHECK_EQUAL(exception.code, RTSEXCPT_ARRAYBOUNDS);
    CHECK_EQUAL(exception.address, 0x1234);
}

static void a_stack_overflow_of_main_is_caught_twice(void)
{
    CHECK_EQUAL(code_of(overflow_stack), RTSEXCPT_STACK_OVERFLOW);
    CHECK_EQUAL(code_of(overflow_stack), RTSEXCPT_STACK_OVERFLOW);
    CHECK_EQUAL(code_of(read_null), RTSEXCPT_ACCESS_VIOLATION);
}

static void *overflow_in_thread(void *arg)
{
    *(RTS_UI32 *)arg = code_of(overflow_stack);
    return NULL;
}

static void a_stack_overflow_of_a_thread_is_caught(void)
{
    pthread_t thread;
    RTS_UI32 code = 0;
    pthread_create(&thread, NULL, overflow_in_thread, &code);
    pthread_join(thread, NULL);
    CHECK_EQUAL(code, RTSEXCPT_STACK_OVERFLOW);
}

/* ---- the watchdog's break ---- */

typedef struct {
    int calls;
    int done;
} VICTIM;

/* Breaks the victim again and again until it says that it is done. */
static void *breaker(void *arg)
{
    VICTIM *victim = arg;
    while (!__atomic_load_n(&victim->done, __ATOMIC_ACQUIRE)) {
        SysExceptBreak(&victim->calls, RTSEXCPT_WATCHDOG);
        sched_yield();
    }
    return NULL;
}

static void an_endless_loop_is_broken(void)
{
    pthread_t thread;
    VICTIM victim = {0, 0};
    pthread_create(&thread, NULL, breaker, &victim);
    RTS_EXCEPTION exception;
    CHECK(!SysExceptTry(loop_forever, &victim.calls, &exception));
    __atomic_store_n(&victim.done, 1, __ATOMIC_RELEASE);
    pthread_join(thread, NULL);
    CHECK_EQUAL(exception.code, RTSEXCPT_WATCHDOG);
}

static void breaks_at_any_moment_do_no_harm(void)
{
    pthread_t thread;
    VICTIM victim = {0, 0};
    pthread_create(&thread, NULL, breaker, &victim);
    for (int i = 0; i < 200000; i++) {
        RTS_EXCEPTION exception;
        bool left = !SysExceptTry(count_up, &victim.calls, &exception);
        CHECK_EQUAL(exception.code, (left ? (RTS_UI32)RTSEXCPT_WATCHDOG : (RTS_UI32)RTSEXCPT_NOEXCEPTION));
    }
    __atomic_store_n(&victim.done, 1, __ATOMIC_RELEASE);
    pthread_join(thread, NULL);
    CHECK(victim.calls > 0);
    CHECK_EQUAL(code_of(do_nothing), RTSEXCPT_NOEXCEPTION);
}

static void a_break_outside_of_try_does_nothing(void)
{
    SysExceptBreak(NULL, RTSEXCPT_WATCHDOG);
    CHECK_EQUAL(code_of(do_nothing), RTSEXCPT_NOEXCEPTION);
}

/* ---- calls outside, from IEC code ---- */

typedef struct {
    uintptr_t thread, iec, outside; /* addresses on their stacks */
    RTS_UI32 code;                  /* what IEC code raises after it */
    int returned;
} OUTSIDE;

/* Of the frame, not of a local variable: sanitizers keep those elsewhere. */
static uintptr_t here(void)
{
    return (uintptr_t)__builtin_frame_address(0);
}

static void run_outside(void *arg)
{
    OUTSIDE *o = arg;
    char frame[2 * 1024 * 1024]; /* larger than all of the IEC stack */
    memset(frame, 1, sizeof frame);
    o->outside = here();
    o->returned = frame[sizeof frame - 1];
}

static void call_outside(void *arg)
{
    OUTSIDE *o = arg;
    o->iec = here();
    CHECK_EQUAL(IecStackCallOutside(IecStackOfThread, run_outside, o), RTSEXCPT_NOEXCEPTION);
    if (o->code != RTSEXCPT_NOEXCEPTION) {
        SysExceptRaise(o->code, 0x1234, NULL);
    }
}

static bool near(uintptr_t a, uintptr_t b)
{
    return (a > b ? a - b : b - a) < 4 * 1024 * 1024;
}

static void a_call_outside_runs_on_the_stack_of_the_thread(void)
{
    static const RTS_UI32 codes[] = {RTSEXCPT_NOEXCEPTION, RTSEXCPT_ARRAYBOUNDS};
    for (size_t i = 0; i < 1000; i++) {
        OUTSIDE o = {.thread = here(), .code = codes[i % 2]};
        RTS_EXCEPTION exception;
        CHECK_EQUAL(SysExceptTry(call_outside, &o, &exception), o.code == RTSEXCPT_NOEXCEPTION);
        CHECK_EQUAL(exception.code, o.code);
        CHECK(o.returned);
        CHECK(near(o.outside, o.thread));
        CHECK(!near(o.iec, o.thread));
    }
}

static void fail_outside(void *arg)
{
    RTS_UNUSED(arg);
    read_null(NULL);
}

static void call_what_fails(void *arg)
{
    (void)IecStackCallOutside(IecStackOfThread, fail_outside, arg);
}

#if defined(__x86_64__)
enum { DIRECTION_AND_ALIGNMENT_CHECK = 1 << 10 | 1 << 18 };

static void set_flags(void *arg)
{
    __asm__ volatile("pushfq\n\torq %0, (%%rsp)\n\tpopfq" ::"i"(DIRECTION_AND_ALIGNMENT_CHECK) : "cc", "memory");
    if (arg != NULL) {
        __asm__ volatile("ud2"); /* what SysExceptRaise does is C already */
    }
}

static void the_flags_are_those_of_c_afterwards(void)
{
    for (uintptr_t raises = 0; raises < 2; raises++) {
        RTS_EXCEPTION exception;
        uint64_t flags;
        CHECK_EQUAL(SysExceptTry(set_flags, (void *)raises, &exception), !raises);
        __asm__ volatile("pushfq\n\tpopq %0\n\tpushq $0\n\tpopfq" : "=r"(flags)::"cc", "memory");
        CHECK((flags & DIRECTION_AND_ALIGNMENT_CHECK) == 0);
    }
}
#endif

static void break_outside(void *arg)
{
    bool *returned = arg;
    SysExceptBreak(NULL, RTSEXCPT_WATCHDOG);
    *returned = true;
}

static void be_broken_outside(void *arg)
{
    bool returned = false;
    RTS_UI32 code = IecStackCallOutside(IecStackOfThread, break_outside, &returned);
    RTS_UNUSED(arg);
    CHECK(returned);
    CHECK_EQUAL(code, RTSEXCPT_WATCHDOG);
    SysExceptRaise(code, 0x1234, NULL);
}

static void nothing_outside(void *arg)
{
    RTS_UNUSED(arg);
}

static void call_outside_again(void *arg)
{
    CHECK_EQUAL(IecStackCallOutside(IecStackOfThread, nothing_outside, arg), RTSEXCPT_NOEXCEPTION);
}

static void a_break_in_a_call_outside_is_for_its_caller_to_raise(void)
{
    CHECK_EQUAL(code_of(be_broken_outside), RTSEXCPT_WATCHDOG);
    CHECK_EQUAL(code_of(call_outside_again), RTSEXCPT_NOEXCEPTION); /* it is over with that try */
}

/* It is a fault of the process, not of the program. */
static void fault_in_a_call_outside(void)
{
    RTS_EXCEPTION exception;
    (void)SysExceptTry(call_what_fails, NULL, &exception);
}

static void mask_all(int how)
{
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(how, &all, NULL);
}

static void break_itself_with_signals_held(void *arg)
{
    mask_all(SIG_BLOCK);
    SysExceptBreak(arg, RTSEXCPT_WATCHDOG);
}

static void let_signals_come(void *arg)
{
    RTS_UNUSED(arg);
    mask_all(SIG_UNBLOCK);
}

static void a_break_that_comes_late_does_not_hit_the_next_try(void)
{
    CHECK_EQUAL(code_of(break_itself_with_signals_held), RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(code_of(let_signals_come), RTSEXCPT_NOEXCEPTION);
}

static void *try_once(void *arg)
{
    RTS_EXCEPTION exception;
    SysExceptTry(do_nothing, arg, &exception);
    return NULL;
}

static void a_break_of_a_thread_that_ended_does_nothing(void)
{
    pthread_t thread;
    int gone;
    pthread_create(&thread, NULL, try_once, &gone);
    pthread_join(thread, NULL);
    SysExceptBreak(&gone, RTSEXCPT_WATCHDOG);
    CHECK_EQUAL(code_of(do_nothing), RTSEXCPT_NOEXCEPTION);
}

static void break_something_else(void *arg)
{
    SysExceptBreak((char *)arg + 1, RTSEXCPT_WATCHDOG);
}

static void a_break_of_something_else_does_nothing(void)
{
    char here[2];
    RTS_EXCEPTION exception;
    CHECK(SysExceptTry(break_something_else, here, &exception));
}

/* ---- many of them ---- */

static void *fault_often(void *arg)
{
    for (int i = 0; i < 2000; i++) {
        CHECK_EQUAL(code_of(read_null), RTSEXCPT_ACCESS_VIOLATION);
        CHECK_EQUAL(code_of(do_nothing), RTSEXCPT_NOEXCEPTION);
    }
    return arg;
}

static void threads_do_not_disturb_each_other(void)
{
    pthread_t threads[8];
    for (size_t i = 0; i < RTS_COUNT(threads); i++) {
        pthread_create(&threads[i], NULL, fault_often, NULL);
    }
    for (size_t i = 0; i < RTS_COUNT(threads); i++) {
        pthread_join(threads[i], NULL);
    }
}

static void threads_that_end_leave_room_for_others(void)
{
    for (int i = 0; i < 200; i++) {
        a_break_of_a_thread_that_ended_does_nothing();
    }
}

static void a_hundred_thousand_tries_work(void)
{
    int calls = 0;
    RTS_EXCEPTION exception;
    for (int i = 0; i < 100000; i++) {
        CHECK(SysExceptTry(count_up, &calls, &exception));
    }
    CHECK_EQUAL(calls, 100000);
}

/* ---- living in a process of another program ---- */

/* Exit status of a child that runs `fn`, or 1000 + the signal that ended it. */
static int run_child(void (*fn)(void))
{
    int status;
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
        struct rlimit none = {0, 0};
        setrlimit(RLIMIT_CORE, &none);
        SysExceptShutdown();
        signal(SIGSEGV, SIG_DFL);
        signal(SIGBUS, SIG_DFL);
        fn();
        _exit(0);
    }
    waitpid(child, &status, 0);
    return WIFSIGNALED(status) ? 1000 + WTERMSIG(status) : WEXITSTATUS(status);
}

static void exit_42(int number)
{
    RTS_UNUSED(number);
    _exit(42);
}

static void fault_outside(void)
{
    (void)code_of(do_nothing);
    read_null(NULL);
}

static void fault_outside_with_handler(void)
{
    signal(SIGSEGV, exit_42);
    fault_outside();
}

static void be_sent_a_fault(void)
{
    (void)code_of(do_nothing);
    kill(getpid(), SIGBUS);
}

static void raise_outside(void)
{
    fclose(stderr);
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0, NULL);
}

static void a_fault_outside_of_try_ends_the_process_as_ever(void)
{
    CHECK_EQUAL(run_child(fault_outside), 1000 + SIGSEGV);
    CHECK_EQUAL(run_child(be_sent_a_fault), 1000 + SIGBUS);
}

static void a_fault_in_a_call_outside_ends_the_process(void)
{
    CHECK_EQUAL(run_child(fault_in_a_call_outside), 1000 + SIGSEGV);
}

static void a_fault_outside_of_try_goes_to_the_handler_before(void)
{
    CHECK_EQUAL(run_child(fault_outside_with_handler), 42);
}

static void raise_outside_of_try_is_fatal(void)
{
    CHECK_EQUAL(run_child(raise_outside), 1000 + SIGABRT);
}

static void shutdown_gives_the_handlers_back(void)
{
    struct sigaction now;
    SysExceptShutdown();
    signal(SIGSEGV, exit_42);
    CHECK_EQUAL(code_of(read_null), RTSEXCPT_ACCESS_VIOLATION);
    SysExceptShutdown();
    sigaction(SIGSEGV, NULL, &now);
    CHECK_SAME(now.sa_handler, exit_42);
    signal(SIGSEGV, SIG_DFL);
    CHECK_EQUAL(code_of(read_null), RTSEXCPT_ACCESS_VIOLATION);
}

int main(void)
{
    RUN(a_normal_return_is_no_exception);
    RUN(reading_null_is_an_access_violation_at_its_instruction);
    RUN(dividing_by_zero_is_caught);
    RUN(an_illegal_instruction_is_caught);
    RUN(raise_gives_its_code_and_address);
    RUN(a_stack_overflow_of_main_is_caught_twice);
    RUN(a_stack_overflow_of_a_thread_is_caught);
    RUN(an_endless_loop_is_broken);
    RUN(breaks_at_any_moment_do_no_harm);
    RUN(a_break_outside_of_try_does_nothing);
    RUN(a_break_that_comes_late_does_not_hit_the_next_try);
    RUN(a_break_of_a_thread_that_ended_does_nothing);
    RUN(a_break_of_something_else_does_nothing);
    RUN(a_call_outside_runs_on_the_stack_of_the_thread);
    RUN(a_break_in_a_call_outside_is_for_its_caller_to_raise);
#if defined(__x86_64__)
    RUN(the_flags_are_those_of_c_afterwards);
#endif
    RUN(a_fault_in_a_call_outside_ends_the_process);
    RUN(threads_do_not_disturb_each_other);
    RUN(threads_that_end_leave_room_for_others);
    RUN(a_hundred_thousand_tries_work);
    RUN(a_fault_outside_of_try_ends_the_process_as_ever);
    RUN(a_fault_outside_of_try_goes_to_the_handler_before);
    RUN(raise_outside_of_try_is_fatal);
    RUN(shutdown_gives_the_handlers_back);
    return test_result();
}
