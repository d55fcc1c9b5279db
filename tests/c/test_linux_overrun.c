/*
 * test_linux_overrun.c - IEC code that writes beyond its local variables gets an exception, and the thread goes on.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each write happens in a process of its own, so that one that is not survived is one failure.
 */
#define _GNU_SOURCE
#include "SysExcept.h"
#include "test.h"

#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

/* A sanitizer would report the write, a stack protector would end the process: compiled ST has neither. */
#if defined(__has_attribute)
#if __has_attribute(no_stack_protector)
#define AS_COMPILED_ST __attribute__((noinline, no_sanitize("address", "undefined"), no_stack_protector))
#endif
#endif
#ifndef AS_COMPILED_ST
#define AS_COMPILED_ST __attribute__((noinline, no_sanitize("address", "undefined")))
#endif

enum { ARRAY_SIZE = 40, DIED = 1000, UNCAUGHT = 1001 };

typedef struct {
    long from; /* offset in the array of the first byte that is written */
    long count;
    long step;
    unsigned char value;
} WRITE;

static volatile int sink;

AS_COMPILED_ST static int write_array(const WRITE *write)
{
    volatile unsigned char array[ARRAY_SIZE];
    volatile unsigned char *at = array + write->from;
    long step = write->step;
    unsigned char value = write->value;
    array[0] = 0;
    for (long i = write->count; i > 0; i--, at += step) {
        *at = value;
    }
    return array[0];
}

/* Frames above the one that is destroyed, as a program has them. */
AS_COMPILED_ST static int call_deeper(const WRITE *write, int depth)
{
    volatile int local[4] = {depth, 0, 0, 0};
    int result = depth == 0 ? write_array(write) : call_deeper(write, depth - 1);
    return result + local[0];
}

AS_COMPILED_ST static void run_write(void *arg)
{
    sink = call_deeper(arg, 3);
}

static void do_nothing(void *arg)
{
    RTS_UNUSED(arg);
}

static void raise_bounds(void *arg)
{
    RTS_UNUSED(arg);
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0, NULL);
}

/* What the write led to, when all works as before afterwards. */
static void *try_write(void *arg)
{
    static RTS_UI32 code;
    RTS_EXCEPTION first, normal, raised;
    volatile int own = 4711;
    SysExceptTry(run_write, arg, &first);
    CHECK_EQUAL(own, 4711);
    CHECK(SysExceptTry(do_nothing, NULL, &normal));
    CHECK(!SysExceptTry(raise_bounds, NULL, &raised) && raised.code == RTSEXCPT_ARRAYBOUNDS);
    code = first.code;
    return &code;
}

static RTS_UI32 try_in_thread(WRITE *write)
{
    pthread_t thread;
    void *code;
    pthread_create(&thread, NULL, try_write, write);
    pthread_join(thread, &code);
    return *(RTS_UI32 *)code;
}

static int status_of(RTS_UI32 code)
{
    if (test_failures != 0) {
        return 99;
    }
    return code > 98 ? 98 : (int)code;
}

/* The exception that a write led to (its number, as far as it fits), or DIED. */
static int outcome(WRITE write, int in_thread)
{
    int status;
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
        struct rlimit none = {0, 0};
        setrlimit(RLIMIT_CORE, &none);
        RTS_UI32 code = in_thread ? try_in_thread(&write) : *(RTS_UI32 *)try_write(&write);
        _exit(status_of(code));
    }
    waitpid(child, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) != 99 ? WEXITSTATUS(status) : DIED;
}

static int is_memory_exception(int code)
{
    return code == RTSEXCPT_ACCESS_VIOLATION || code == RTSEXCPT_STACK_OVERFLOW || code == RTSEXCPT_ILLEGAL_INSTRUCTION;
}

static const unsigned char values[] = {0, 255, 0x55};

/* Few bytes may be padding; more destroy the way back. */
static void check_write(WRITE write)
{
    for (size_t i = 0; i < RTS_COUNT(values); i++) {
        for (int in_thread = 0; in_thread < 2; in_thread++) {
            write.value = values[i];
            int code = outcome(write, in_thread);
            int few = write.count < ARRAY_SIZE + 64;
            if (!is_memory_exception(code) && !(few && code == RTSEXCPT_NOEXCEPTION)) {
                fprintf(stderr, "from %ld, %ld bytes of %d, step %ld, %s: %d\n", write.from, write.count, write.value,
                        write.step, in_thread ? "thread" : "main", code);
            }
            CHECK(is_memory_exception(code) || (few && code == RTSEXCPT_NOEXCEPTION));
        }
    }
}

static void any_number_of_bytes_after_a_local_array_is_an_exception(void)
{
    static const long counts[] = {44, 60, 100, 128, 1000, 4096, 65536, 1000000, 9000000, 100000000};
    for (size_t i = 0; i < RTS_COUNT(counts); i++) {
        check_write((WRITE){0, counts[i], 1, 0});
    }
}

static void random_numbers_of_bytes_after_a_local_array_are_exceptions(void)
{
    srand(1);
    for (int i = 0; i < 40; i++) {
        check_write((WRITE){0, ARRAY_SIZE + 64 + rand() % (1 << rand() % 20), 1, 0});
    }
}

static void bytes_before_a_local_array_are_an_exception_when_the_stack_ends(void)
{
    check_write((WRITE){0, 9000000, -1, 0});
}

/* An index that counts in elements of 4 KiB passes over much, but not over the guards. */
static void writing_far_apart_meets_the_guards(void)
{
    check_write((WRITE){4096, 9000000, 4096, 0});
    check_write((WRITE){-4096, 9000000, -4096, 0});
    check_write((WRITE){65536, 9000000, 65536, 0});
}

/* ---- a write that spares the return addresses, but no saved register ---- */

AS_COMPILED_ST static void destroy_registers(void *arg)
{
    RTS_UNUSED(arg);
#if defined(__x86_64__)
    __asm__ volatile("movq $-1, %rbx\n\tmovq $-1, %r12\n\tmovq $-1, %r13\n\tmovq $-1, %r14\n\tmovq $-1, %r15");
#elif defined(__aarch64__)
    __asm__ volatile("mov x19, #-1\n\tmov x20, #-1\n\tmov x21, #-1\n\tmov x22, #-1\n\tmov x23, #-1\n\tmov x24, #-1\n\t"
                     "mov x25, #-1\n\tmov x26, #-1\n\tmov x27, #-1\n\tmov x28, #-1");
#elif defined(__arm__)
    __asm__ volatile("mvn r4, #0\n\tmov r5, r4\n\tmov r6, r4\n\tmov r8, r4\n\tmov r9, r4\n\tmov r10, r4\n\t"
                     "vmov d8, r4, r4\n\tvmov d15, r4, r4");
#endif
}

AS_COMPILED_ST static void destroy_stack_pointer(void *arg)
{
    RTS_UNUSED(arg);
#if defined(__x86_64__)
    __asm__ volatile("movq $-1, %rsp\n\tpushq %rax");
#elif defined(__aarch64__)
    __asm__ volatile("mov x0, #-16\n\tmov sp, x0\n\tstr x0, [sp]");
#elif defined(__arm__)
    __asm__ volatile("mvn r0, #15\n\tmov sp, r0\n\tstr r0, [sp]");
#endif
}

static void registers_that_were_not_preserved_do_no_harm(void)
{
    RTS_EXCEPTION exception;
    for (int i = 0; i < 3; i++) {
        CHECK(SysExceptTry(destroy_registers, NULL, &exception));
        CHECK_EQUAL(exception.code, RTSEXCPT_NOEXCEPTION);
    }
}

static void a_stack_pointer_that_leads_nowhere_is_an_exception(void)
{
    RTS_EXCEPTION exception;
    for (int i = 0; i < 3; i++) {
        CHECK(!SysExceptTry(destroy_stack_pointer, NULL, &exception));
        CHECK(is_memory_exception((int)exception.code));
    }
}

int main(void)
{
    RUN(any_number_of_bytes_after_a_local_array_is_an_exception);
    RUN(random_numbers_of_bytes_after_a_local_array_are_exceptions);
    RUN(bytes_before_a_local_array_are_an_exception_when_the_stack_ends);
    RUN(writing_far_apart_meets_the_guards);
    RUN(registers_that_were_not_preserved_do_no_harm);
    RUN(a_stack_pointer_that_leads_nowhere_is_an_exception);
    return test_result();
}
