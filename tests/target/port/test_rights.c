/*
 * test_rights.c - what application code may write, and that nothing else of it arrives: each kind of memory, each width,
 * any address; and functions in C that a gate gives all rights for the time of a call.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "check.h"

/* Of the application: no power of 2, so that what surrounds it begins within a region of the MPU. */
enum { AREAS_SIZE = 5500 };
typedef struct {
    RTS_UI8 bytes[AREAS_SIZE];
} APP_AREAS_ALIGNED(AREAS_SIZE) PLACED;
static PLACED areas APP_AREAS_SECTION;

/* Of the runtime. */
static volatile RTS_UI32 in_bss[4];
static volatile RTS_UI32 in_data[4] = {1, 2, 3, 4};
static volatile RTS_UI32 after_store;

extern RTS_UI8 areas_start[], areas_end[], stack_bottom[], stack_top[];
enum { RANDOM_STORES = 20000 };

/* ---- stores ---- */

typedef struct {
    uintptr_t address;
    RTS_UI32 value;
} STORE;

static void store_byte(void *arg)
{
    const STORE *store = arg;
    *(volatile RTS_UI8 *)store->address = (RTS_UI8)store->value;
}

static void store_half(void *arg)
{
    const STORE *store = arg;
    *(volatile RTS_UI16 *)store->address = (RTS_UI16)store->value;
}

static void store_word(void *arg)
{
    const STORE *store = arg;
    *(volatile RTS_UI32 *)store->address = store->value;
}

#include "stores.h" /* of the processor family */

static void (*const stores[])(void *) = {store_byte, store_half, store_word, push_there, OTHER_STORES};

/* Of one word, without effects on the stack. */
static bool may_store(uintptr_t address, RTS_UI32 value)
{
    STORE store = {address, value};
    RTS_EXCEPTION exception;
    return SysExceptTry(store_word, &store, &exception);
}

static void expect_stopped(uintptr_t address)
{
    int is_readable = IS_READABLE(address);
    for (RTS_UI32 i = 0; i < RTS_COUNT(stores); i++) {
        RTS_UI32 before = is_readable ? REG32(address) : 0;
        STORE store = {address, ~before};
        RTS_EXCEPTION exception = {0, 0};
        CHECK_EQUAL(SysExceptTry(stores[i], &store, &exception), false);
        if (stores[i] != push_there)
            CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
        if (is_readable)
            CHECK_EQUAL(REG32(address), before);
    }
}

/* ---- each kind of memory ---- */

static void store_into_the_areas_arrives(void)
{
    for (RTS_UI32 offset = 0; offset + 4 <= AREAS_SIZE; offset += 4) {
        CHECK(may_store((uintptr_t)&areas.bytes[offset], offset + 1));
        CHECK_EQUAL(REG32((uintptr_t)&areas.bytes[offset]), offset + 1);
    }
}

static void store_next_to_the_areas_is_stopped(void)
{
    CHECK_EQUAL((uintptr_t)&areas, (uintptr_t)areas_start);
    expect_stopped((uintptr_t)areas_end);
    expect_stopped((uintptr_t)areas_end + 28);
}

static void store_into_variables_of_the_runtime_is_stopped(void)
{
    expect_stopped((uintptr_t)in_bss);
    expect_stopped((uintptr_t)in_data);
    CHECK_EQUAL(in_data[0], 1);
}

static void store_into_the_main_stack_is_stopped(void)
{
    volatile RTS_UI32 here[4] = {5, 6, 7, 8};
    expect_stopped((uintptr_t)here);
    CHECK_EQUAL(here[0], 5);
}

static void store_into_a_stack_that_does_not_run_is_stopped(void)
{
    for (RTS_UI32 i = 0; i < APP_MAX_TASKS - 1; i++) {
        expect_stopped(IEC_STACKS + i * RTS_IEC_STACK_SIZE);
        expect_stopped(IEC_STACKS + i * RTS_IEC_STACK_SIZE + RTS_IEC_STACK_SIZE / 2);
    }
}

static void store_into_code_is_stopped(void)
{
    expect_stopped((uintptr_t)expect_stopped & ~3u);
}

static void store_into_vectors_is_stopped(void)
{
    expect_stopped(0);
    expect_stopped(0x40);
}

static void store_into_registers_is_stopped(void)
{
    static const uintptr_t registers[] = {DEVICE_REGISTERS};
    for (RTS_UI32 i = 0; i < RTS_COUNT(registers); i++)
        expect_stopped(registers[i]);
}

static void jump_there(void *arg)
{
    ((void (*)(void))((uintptr_t)arg | APP_ENTRY_MODE_BIT))();
    after_store = 1;
}

static void data_is_not_executed(void)
{
    RTS_EXCEPTION exception;
    areas.bytes[0] = RETURN_INSTRUCTION & 0xFF;
    areas.bytes[1] = RETURN_INSTRUCTION >> 8;
    CHECK_EQUAL(SysExceptTry(jump_there, &areas, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
}

#include "privileges.h" /* of the processor family */

/* ---- any address ---- */

static RTS_UI32 random_state = 2463534242u;

static RTS_UI32 random_number(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

/* Half of them where there is RAM, half of them anywhere but among the registers of the processor. */
static uintptr_t random_address(RTS_UI32 round)
{
    extern RTS_UI8 end[];
    RTS_UI32 number = random_number();
    if (round % 2)
        return IS_OF_THE_PROCESSOR(number) ? 0 : number & ~3u;
    return IEC_STACKS + number % ((uintptr_t)end - IEC_STACKS) / 4 * 4;
}

/* Writes the complement of a value, 0: what is there already. */
static void replace_word(void *arg)
{
    const STORE *store = arg;
    *(volatile RTS_UI32 *)store->address = store->value != 0 ? ~store->value : REG32(store->address);
}

/* On its own stack it writes back what is there, so that it comes to its end. Variables of the runtime may change
 * meanwhile, but not to what was stored; on the main stack a trap may leave it, as one of the registers it saves. */
static void store_lands_in_the_areas_or_on_the_stack_or_is_stopped(void)
{
    const uintptr_t stack = IEC_STACKS + (APP_MAX_TASKS - 1) * RTS_IEC_STACK_SIZE;
    RTS_UI32 landed = 0;
    for (RTS_UI32 round = 0; round < RANDOM_STORES; round++) {
        uintptr_t address = random_address(round);
        int is_main_stack = address - (uintptr_t)stack_bottom < (uintptr_t)(stack_top - stack_bottom);
        int is_readable = round % 2 == 0 && !is_main_stack;
        int is_areas = address - (uintptr_t)areas_start < (uintptr_t)(areas_end - areas_start);
        int is_stack = address - stack < RTS_IEC_STACK_SIZE;
        STORE store = {address, is_stack ? 0 : 0x57A7E000 + round};
        RTS_EXCEPTION exception = {0, 0};
        bool stopped = !SysExceptTry(replace_word, &store, &exception);
        CHECK_EQUAL(stopped, !is_areas && !is_stack);
        if (is_readable && !is_stack)
            CHECK_EQUAL(REG32(address) == ~store.value, is_areas);
        landed += !stopped;
    }
    CHECK(landed > RANDOM_STORES / 50);
}

/* ---- tasks that interrupt each other ---- */

typedef struct {
    void (*function)(void *arg);
    volatile RTS_UI32 caught, passed;
    RTS_EXCEPTION exception;
} TASK;

static TASK slow, fast;

static void on_timer(void *param, RTS_I64 due)
{
    TASK *task = param;
    RTS_UNUSED(due);
    if (SysExceptTry(task->function, task, &task->exception))
        task->passed++;
    else
        task->caught++;
}

static RTS_HANDLE start(TASK *task, void (*function)(void *arg), RTS_UI32 interval_us, RTS_UI32 priority)
{
    RTS_HANDLE timer;
    *task = (TASK){.function = function};
    CHECK_EQUAL(SysTimerCreate(on_timer, task, interval_us, priority, &timer), ERR_OK);
    SysTimerStart(timer);
    return timer;
}

static void wait_for(const volatile RTS_UI32 *counter, RTS_UI32 count)
{
    RTS_UI32 from = SysTimeGetMs();
    while (*counter < count && SysTimeGetMs() - from < 1000)
        ;
    CHECK(*counter >= count);
}

/* Words on its stack and in the areas, counted up together for a while. */
static void write_own_memory(void *arg)
{
    volatile RTS_UI32 here[8] = {0};
    volatile RTS_UI32 *there = (volatile RTS_UI32 *)(void *)areas.bytes;
    RTS_UNUSED(arg);
    there[0] = 0;
    for (RTS_UI32 i = 0; i < 100000; i++)
        if (++here[i % 8], ++there[0] != i + 1)
            __asm__ volatile(UNDEFINED);
}

static void write_the_stack_of_the_task_below(void *arg)
{
    RTS_UNUSED(arg);
    REG32(IEC_STACKS + APP_MAX_TASKS * RTS_IEC_STACK_SIZE - 64) = 0xBAD;
}

static void task_cannot_write_the_stack_of_the_one_it_interrupted(void)
{
    RTS_HANDLE high = start(&fast, write_the_stack_of_the_task_below, 300, 3);
    RTS_HANDLE low = start(&slow, write_own_memory, 50000, 10);
    wait_for(&slow.passed, 3);
    SysTimerDelete(low);
    SysTimerDelete(high);
    CHECK_EQUAL(slow.caught, 0);
    /* where no other task runs that word is on its own stack, which it did not need any more */
    CHECK(fast.caught > 10);
    CHECK_EQUAL(fast.exception.code, RTSEXCPT_ACCESS_VIOLATION);
}

static void end_at_once(void *arg)
{
    RTS_UNUSED(arg);
}

static void main_keeps_its_rights_below_tasks(void)
{
    RTS_HANDLE high = start(&fast, end_at_once, 100, 3);
    RTS_UI32 from = SysTimeGetMs();
    while (SysTimeGetMs() - from < 20) {
        in_bss[1]++;
        CHECK(READ_A_PRIVILEGED_REGISTER() != 0);
    }
    SysTimerDelete(high);
    CHECK(fast.passed > 100);
}

/* ---- gates ---- */

/* As a program has it, in its import table. */
#define IMPORT(function) \
    APP_GATE(function);  \
    static __typeof__(function) *const volatile imported_##function = (__typeof__(function) *)APP_GATED(function)

/* Arguments in registers and on the stack, and a result of two registers. */
static RTS_I64 add_and_count(RTS_I64 a, RTS_I64 b, RTS_I32 c, RTS_I32 d)
{
    in_bss[2]++;
    return a + b + c + d;
}
IMPORT(add_and_count);

static void call_by_gate(void *arg)
{
    *(volatile RTS_I64 *)arg = imported_add_and_count((RTS_I64)1 << 40, 20, 300, 4000);
}

static void function_with_a_gate_has_all_rights(void)
{
    RTS_EXCEPTION exception;
    in_bss[2] = 0;
    CHECK_EQUAL(SysExceptTry(call_by_gate, &areas, &exception), true);
    CHECK_EQUAL(in_bss[2], 1);
    CHECK_EQUAL(*(volatile RTS_I64 *)(void *)&areas, ((RTS_I64)1 << 40) + 4320);
}

static void write_after_a_gate(void *arg)
{
    call_by_gate(arg);
    in_bss[3] = 1;
}

static void after_the_call_it_has_not(void)
{
    RTS_EXCEPTION exception;
    in_bss[3] = 0;
    CHECK_EQUAL(SysExceptTry(write_after_a_gate, &areas, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(in_bss[3], 0);
}

static RTS_I32 call_another(void)
{
    RTS_I64 sum = imported_add_and_count(1, 2, 3, 4);
    in_bss[2]++;
    return (RTS_I32)sum;
}
IMPORT(call_another);

static void call_two_gates(void *arg)
{
    *(volatile RTS_I32 *)arg = imported_call_another();
}

static void function_with_a_gate_may_call_another_by_its_gate(void)
{
    RTS_EXCEPTION exception;
    in_bss[2] = 0;
    CHECK_EQUAL(SysExceptTry(call_two_gates, &areas, &exception), true);
    CHECK_EQUAL(in_bss[2], 2);
    CHECK_EQUAL(*(volatile RTS_I32 *)(void *)&areas, 10);
}

static void call_of_a_gate_elsewhere(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile(CALL_OF_A_GATE ::: "memory");
    in_bss[3] = 1;
}

static void call_of_a_gate_elsewhere_gives_no_rights(void)
{
    RTS_EXCEPTION exception;
    in_bss[3] = 0;
    (void)SysExceptTry(call_of_a_gate_elsewhere, NULL, &exception);
    CHECK_EQUAL(in_bss[3], 0);
}

static RTS_I32 fail_with_all_rights(void)
{
    in_bss[2]++;
    __asm__ volatile(UNDEFINED);
    return 0;
}
IMPORT(fail_with_all_rights);

static void call_what_fails(void *arg)
{
    *(volatile RTS_I32 *)arg = imported_fail_with_all_rights();
}

static void failure_with_a_gate_takes_the_rights_back(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(call_what_fails, &areas, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ILLEGAL_INSTRUCTION);
    CHECK(!may_store((uintptr_t)&in_bss[0], 1));
    function_with_a_gate_has_all_rights();
}

static RTS_I32 work_for_long(void)
{
    for (RTS_UI32 i = 0; i < 100000; i++)
        in_bss[0]++;
    return 0;
}
IMPORT(work_for_long);

static void call_what_takes_long(void *arg)
{
    RTS_UNUSED(arg);
    (void)imported_work_for_long();
}

static void function_with_a_gate_keeps_its_rights_when_it_is_interrupted(void)
{
    RTS_HANDLE high = start(&fast, write_the_stack_of_the_task_below, 300, 3);
    RTS_HANDLE low = start(&slow, call_what_takes_long, 50000, 10);
    wait_for(&slow.passed, 3);
    SysTimerDelete(low);
    SysTimerDelete(high);
    CHECK_EQUAL(slow.caught, 0);
    CHECK(fast.caught > 10);
}

static void loop_with_all_rights(void)
{
    for (;;)
        in_bss[0]++;
}
IMPORT(loop_with_all_rights);

static void call_what_never_ends(void *arg)
{
    RTS_UNUSED(arg);
    imported_loop_with_all_rights();
}

static void break_it(RTS_I64 now)
{
    static RTS_UI32 ticks;
    RTS_UNUSED(now);
    if (++ticks % 4 == 0)
        SysExceptBreak(&slow, RTSEXCPT_WATCHDOG);
}

static void endless_loop_with_a_gate_is_aborted(void)
{
    ClockSetCallback(break_it);
    RTS_HANDLE timer = start(&slow, call_what_never_ends, 2000, 0);
    wait_for(&slow.caught, 3);
    SysTimerDelete(timer);
    ClockSetCallback(NULL);
    CHECK_EQUAL(slow.exception.code, RTSEXCPT_WATCHDOG);
    CHECK(!may_store((uintptr_t)&in_bss[0], 1));
}

int main(void)
{
    TEST_BEGIN();
    TEST_RUN(store_into_the_areas_arrives);
    TEST_RUN(store_next_to_the_areas_is_stopped);
    TEST_RUN(store_into_variables_of_the_runtime_is_stopped);
    TEST_RUN(store_into_the_main_stack_is_stopped);
    TEST_RUN(store_into_a_stack_that_does_not_run_is_stopped);
    TEST_RUN(store_into_code_is_stopped);
    TEST_RUN(store_into_vectors_is_stopped);
    TEST_RUN(store_into_registers_is_stopped);
    TEST_RUN(data_is_not_executed);
    RUN_PRIVILEGE_TESTS();
    TEST_RUN(store_lands_in_the_areas_or_on_the_stack_or_is_stopped);
    TEST_RUN(task_cannot_write_the_stack_of_the_one_it_interrupted);
    TEST_RUN(main_keeps_its_rights_below_tasks);
    TEST_RUN(function_with_a_gate_has_all_rights);
    TEST_RUN(after_the_call_it_has_not);
    TEST_RUN(function_with_a_gate_may_call_another_by_its_gate);
    TEST_RUN(call_of_a_gate_elsewhere_gives_no_rights);
    TEST_RUN(failure_with_a_gate_takes_the_rights_back);
    TEST_RUN(function_with_a_gate_keeps_its_rights_when_it_is_interrupted);
    TEST_RUN(endless_loop_with_a_gate_is_aborted);
    TEST_END();
}
