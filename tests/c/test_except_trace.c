/*
 * test_except_trace.c - which words of a stack are kept of an exception.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysExcept.h"

#include <string.h>

#include "test.h"

enum { UNIT = 1 + APP_ENTRY_MODE_BIT }; /* bytes of the shortest instruction */
static const RTS_UI8 code[64 * UNIT];
static uintptr_t stack[EXCEPT_MAX_CALLS + 4];

static void setup(void)
{
    SysExceptForgetTrace();
    SysExceptCodeRange(code, sizeof code);
    memset(stack, 0, sizeof stack);
}

/* As what follows a call there is on the stack. */
static uintptr_t in_code(RTS_UI32 instructions)
{
    return (uintptr_t)code + instructions * UNIT + APP_ENTRY_MODE_BIT;
}

static void only_words_that_lead_into_the_code_are_kept(void)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();

    setup();
    stack[0] = in_code(0);
    stack[1] = in_code(64);
    stack[2] = in_code(65);
    stack[3] = in_code(1);
    SysExceptTrace(in_code(5), stack, stack + 4, 0);
    CHECK_EQUAL(trace->count, 2);
    CHECK(trace->call[0].target == 64 * UNIT && trace->call[0].distance == sizeof stack[0]);
    CHECK(trace->call[1].target == 1 * UNIT && trace->call[1].distance == 3 * sizeof stack[0]);
}

/* What points to the start of the code is a function. */
static void a_return_has_a_call_before_it(void)
{
    setup();
    CHECK(!SysExceptIsReturn(in_code(0)));
    CHECK(SysExceptIsReturn(in_code(1)));
    CHECK(SysExceptIsReturn(in_code(64))); /* by what does not come back */
    CHECK(!SysExceptIsReturn(in_code(65)));
}

#if EXCEPT_REGISTERS > 0
static void registers_are_those_of_the_exception_that_counts(void)
{
    static const uintptr_t values[EXCEPT_REGISTERS] = {11, 12}, others[EXCEPT_REGISTERS] = {21, 22};

    setup();
    CHECK_EQUAL(SysExceptGetRegisters()->kind, 0);
    SysExceptNoteRegisters(stack, EXCEPT_REGISTERS_ARM, values);
    SysExceptTrace(in_code(5), stack, stack + 4, 0);
    SysExceptNoteRegisters(stack + 1, EXCEPT_REGISTERS_ARM, others);
    SysExceptTrace(in_code(6), stack + 1, stack + 4, 0);
    CHECK_EQUAL(SysExceptGetRegisters()->kind, EXCEPT_REGISTERS_ARM);
    CHECK(memcmp(SysExceptGetRegisters()->value, values, sizeof values) == 0);
    SysExceptForgetTrace();
    CHECK_EQUAL(SysExceptGetRegisters()->kind, 0);
}

/* Two tasks fail at the same time: of one the registers come first, of the other one the trace. */
static void registers_of_another_exception_are_not_shown(void)
{
    static const uintptr_t values[EXCEPT_REGISTERS] = {11, 12};

    setup();
    SysExceptNoteRegisters(stack, EXCEPT_REGISTERS_ARM, values);
    SysExceptTrace(in_code(6), stack + 1, stack + 4, 0);
    SysExceptTrace(in_code(5), stack, stack + 4, 0);
    CHECK_EQUAL(SysExceptGetRegisters()->kind, 0);
}

static void an_error_without_fault_has_no_registers(void)
{
    setup();
    SysExceptTrace(in_code(5), stack, stack + 4, 0);
    CHECK_EQUAL(SysExceptGetRegisters()->kind, 0);
}
#endif

static void the_link_register_is_distinguished(void)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();

    setup();
    SysExceptTrace(in_code(5), NULL, NULL, in_code(7));
    CHECK(trace->count == 1 && trace->call[0].target == 7 * UNIT && trace->call[0].distance == EXCEPT_LINK);
}

static void a_full_trace_keeps_the_nearest(void)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();
    RTS_UI32 i;

    setup();
    for (i = 0; i < RTS_COUNT(stack); i++)
        stack[i] = in_code(1 + i);
    SysExceptTrace(in_code(5), stack, stack + RTS_COUNT(stack), 0);
    CHECK_EQUAL(trace->count, EXCEPT_MAX_CALLS);
    CHECK_EQUAL(trace->call[EXCEPT_MAX_CALLS - 1].target, EXCEPT_MAX_CALLS * UNIT);
}

static void the_first_exception_counts_until_it_is_forgotten(void)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();

    setup();
    SysExceptTrace(in_code(5), NULL, NULL, in_code(7));
    SysExceptTrace(in_code(6), NULL, NULL, in_code(8));
    CHECK(trace->count == 1 && trace->call[0].target == 7 * UNIT);
    SysExceptKeepTrace(in_code(5));
    CHECK_EQUAL(trace->count, 1);
    SysExceptForgetTrace();
    CHECK_EQUAL(trace->count, 0);
    SysExceptTrace(in_code(6), NULL, NULL, in_code(8));
    CHECK(trace->count == 1 && trace->call[0].target == 8 * UNIT);
}

static void the_trace_of_another_exception_is_not_kept(void)
{
    setup();
    SysExceptTrace(in_code(5), NULL, NULL, in_code(7));
    SysExceptKeepTrace(in_code(6));
    CHECK_EQUAL(SysExceptGetTrace()->count, 0);
}

/* A call by a pointer that is NULL: the address of the exception is 0. */
static void an_exception_at_null_is_kept_and_forgotten_like_any_other(void)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();

    setup();
    SysExceptTrace(0, NULL, NULL, in_code(7));
    SysExceptKeepTrace(0);
    CHECK_EQUAL(trace->count, 1);
    SysExceptForgetTrace();
    CHECK_EQUAL(trace->count, 0);
    SysExceptTrace(in_code(6), NULL, NULL, in_code(8));
    CHECK_EQUAL(trace->count, 1);
}

static void without_code_there_are_no_calls(void)
{
    setup();
    stack[0] = in_code(3);
    SysExceptCodeRange(NULL, 0);
    SysExceptTrace(in_code(5), stack, stack + 1, 0);
    CHECK_EQUAL(SysExceptGetTrace()->count, 0);
}

int main(void)
{
    RUN(a_return_has_a_call_before_it);
    RUN(only_words_that_lead_into_the_code_are_kept);
    RUN(the_link_register_is_distinguished);
#if EXCEPT_REGISTERS > 0
    RUN(registers_are_those_of_the_exception_that_counts);
    RUN(registers_of_another_exception_are_not_shown);
    RUN(an_error_without_fault_has_no_registers);
#endif
    RUN(a_full_trace_keeps_the_nearest);
    RUN(the_first_exception_counts_until_it_is_forgotten);
    RUN(the_trace_of_another_exception_is_not_kept);
    RUN(an_exception_at_null_is_kept_and_forgotten_like_any_other);
    RUN(without_code_there_are_no_calls);
    return test_result();
}
