/*
 * test_app_image.c - the process image of tasks: at whatever moment a task interrupts another one, or main writes a bit,
 * no bit is lost, no input changes within a cycle, and nothing is torn.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * AppImage is compiled a second time here, with areas and a lock that are fakes. A low task runs; at each of its steps
 * in turn (loads and stores of its code, and around the lock, never within) something else comes in between: a cycle of
 * a high task, or a write of main as on a port where main runs beside the tasks.
 */
#include <string.h>

#include "rts_config.h"
#undef APP_IMAGE_ALWAYS
#define APP_IMAGE_ALWAYS always

#include <stdbool.h>
static bool always;

#define AppImagePlace test_place
#define AppImageAttach test_attach
#define AppImageSetContext test_set_context
#define AppImageFind test_find
#define AppImageGetCopy test_get_copy
#define AppImageCopyIn test_copy_in
#define AppImageCopyOut test_copy_out
#define AppAreasGet fake_area
#define SysLockEnter fake_enter
#define SysLockLeave fake_leave
#include "../../firmware/src/cycle/AppImage.c"

#include "test.h"

enum { AREA_SIZE = 64, LOW = 0, HIGH = 1, TASKS = 2 };

static RTS_I64 areas[AREAS_COPIES][AREA_SIZE / 8];
static RTS_I64 copies[1024];
static TASK_IMAGE images[APP_MAX_TASKS];
static IEC_CONTEXT context[TASKS];
static RTS_UI32 running;

RTS_UI8 *fake_area(RTS_UI32 area)
{
    return area == AREAS_COPIES ? (RTS_UI8 *)copies : (RTS_UI8 *)areas[area];
}

/* ---- what comes in between ---- */

static bool locked;
static RTS_UI32 step; /* of the low task, from 1 on */
static bool interrupted;
static RTS_UI32 interrupt_at; /* the step before which `interrupt` runs; 0: never */
static void (*interrupt)(void);

static void may_be_interrupted(void)
{
    CHECK(!locked);
    if (!interrupted && ++step == interrupt_at) {
        interrupted = true;
        interrupt();
        interrupted = false;
    }
}

RTS_UI32 fake_enter(void)
{
    may_be_interrupted();
    CHECK(!locked);
    locked = true;
    return 7;
}

void fake_leave(RTS_UI32 before)
{
    CHECK(before == 7 && locked);
    locked = false;
    may_be_interrupted();
}

/* ---- tasks ---- */

static RTS_UI8 *byte_of(RTS_UI32 task, RTS_UI32 area, RTS_UI32 offset)
{
    return (RTS_UI8 *)((uintptr_t)context[task].area[area] + offset);
}

/* As compiled code does it: it may be interrupted between load and store. */
static void set_bit(RTS_UI32 task, RTS_UI32 area, RTS_UI32 offset, RTS_UI8 mask, bool on)
{
    RTS_UI8 loaded;

    may_be_interrupted();
    loaded = *byte_of(task, area, offset);
    may_be_interrupted();
    *byte_of(task, area, offset) = (RTS_UI8)(on ? loaded | mask : loaded & ~mask);
}

static CDL_IMAGE uses[TASKS][IMAGE_AREAS];
static RTS_UI32 used; /* units of copies */

/* A task uses this part, which another one uses too. */
static void use(RTS_UI32 task, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 size, RTS_UI32 flags)
{
    uses[task][area - APP_AREA_INPUT] =
        (CDL_IMAGE){(RTS_UI16)(offset / 8), (RTS_UI16)(size / 8), flags | CDL_IMAGE_SHARED};
}

static void use_nothing(void)
{
    memset(uses, 0, sizeof uses);
}

static void start(bool with_copies)
{
    RTS_UI32 i;

    memset(images, 0, sizeof images);
    used = 0;
    for (i = 0; with_copies && i < IMAGE_AREAS * TASKS; i++)
        used =
            test_place(&images[i / IMAGE_AREAS].part[i % IMAGE_AREAS], &uses[i / IMAGE_AREAS][i % IMAGE_AREAS], used);
    CHECK(used * CDL_IMAGE_UNIT <= sizeof copies);
    test_attach(images);
    running = 1;
    for (i = 0; i < TASKS; i++) {
        context[i].area[APP_AREA_INPUT] = fake_area(APP_AREA_INPUT);
        context[i].area[APP_AREA_OUTPUT] = fake_area(APP_AREA_OUTPUT);
        test_set_context(i, &context[i]);
    }
    step = 0;
}

static void cycle(RTS_UI32 task, void (*code)(void))
{
    test_copy_in(task);
    code();
    test_copy_out(task, &running);
}

/* Runs the low task once with `other` before each of its steps in turn, and `check` after each; returns the number of
 * steps. `begin` comes first. */
static RTS_UI32 at_every_step(void (*begin)(void), void (*low)(void), void (*other)(void), void (*check)(void))
{
    RTS_UI32 last = 1;

    interrupt = other;
    for (interrupt_at = 1; interrupt_at <= last; interrupt_at++) {
        begin();
        step = 0;
        cycle(LOW, low);
        last = step;
        check();
    }
    interrupt_at = 0;
    return last;
}

/* ---- bits of one output byte ---- */

static bool with_copies;
static RTS_UI32 lost;

static void begin_bits(void)
{
    memset(areas, 0, sizeof areas);
    use_nothing();
    fake_area(APP_AREA_OUTPUT)[9] = 0x42; /* bits that must fall */
    use(LOW, APP_AREA_OUTPUT, 8, 8, CDL_IMAGE_WRITTEN);
    use(HIGH, APP_AREA_OUTPUT, 0, 24, CDL_IMAGE_WRITTEN);
    always = false;
    start(with_copies);
}

static void low_bits(void)
{
    set_bit(LOW, APP_AREA_OUTPUT, 9, 0x01, true);
    set_bit(LOW, APP_AREA_OUTPUT, 9, 0x02, false);
    set_bit(LOW, APP_AREA_OUTPUT, 9, 0x80, true);
}

static void high_bits(void)
{
    set_bit(HIGH, APP_AREA_OUTPUT, 9, 0x10, true);
    set_bit(HIGH, APP_AREA_OUTPUT, 9, 0x40, false);
}

static void high_cycle(void)
{
    cycle(HIGH, high_bits);
}

/* The low task may leave one of the high task's bits for it to set again, but neither may undo the other. */
static void check_bits(void)
{
    lost += fake_area(APP_AREA_OUTPUT)[9] != 0x91;
}

static void two_tasks_never_undo_each_others_bits(void)
{
    with_copies = true;
    lost = 0;
    CHECK_EQUAL(at_every_step(begin_bits, low_bits, high_cycle, check_bits), 10);
    CHECK_EQUAL(lost, 0);
}

/* The test would see it. */
static void without_copies_they_do(void)
{
    with_copies = false;
    lost = 0;
    (void)at_every_step(begin_bits, low_bits, high_cycle, check_bits);
    CHECK(lost > 0);
}

/* ---- a bit written by main ---- */

static void write_bits(void)
{
    RTS_UI32 before = fake_enter();

    SysAtomicSetBits(fake_area(APP_AREA_OUTPUT) + 9, 0x50, 0x10);
    fake_leave(before);
}

static void begin_alone(void)
{
    begin_bits();
    use_nothing();
    uses[LOW][1] = (CDL_IMAGE){1, 1, CDL_IMAGE_WRITTEN};
    always = true;
    start(true);
    CHECK_EQUAL(used * CDL_IMAGE_UNIT, 16);
}

static void what_main_writes_is_neither_lost_nor_undoes_anything(void)
{
    with_copies = true;
    lost = 0;
    CHECK_EQUAL(at_every_step(begin_alone, low_bits, write_bits, check_bits), 10);
    CHECK_EQUAL(lost, 0);
}

/* ---- inputs hold still ---- */

static RTS_UI8 seen[4][2];
static RTS_UI32 looks;
static RTS_UI32 changed;

static void look(void)
{
    may_be_interrupted();
    memcpy(seen[looks++], byte_of(LOW, APP_AREA_INPUT, 15), 2); /* across a word */
}

static void begin_inputs(void)
{
    memset(areas, 0, sizeof areas);
    use_nothing();
    use(LOW, APP_AREA_INPUT, 8, 16, 0);
    use(HIGH, APP_AREA_INPUT, 0, 24, CDL_IMAGE_WRITTEN);
    start(true);
    looks = 0;
}

static void look_often(void)
{
    while (looks < RTS_COUNT(seen))
        look();
}

static void write_inputs(void)
{
    memset(byte_of(HIGH, APP_AREA_INPUT, 15), 0xA5, 2);
}

static void high_writes_inputs(void)
{
    cycle(HIGH, write_inputs);
}

static void check_inputs(void)
{
    RTS_UI32 i;

    for (i = 1; i < RTS_COUNT(seen); i++)
        changed += memcmp(seen[0], seen[i], 2) != 0;
    changed += seen[0][0] != seen[0][1]; /* torn */
    CHECK(memcmp(fake_area(APP_AREA_INPUT) + 15, "\xA5\xA5", 2) == 0);
}

static void inputs_hold_still_for_a_cycle_and_a_task_that_writes_them_is_heard(void)
{
    changed = 0;
    (void)at_every_step(begin_inputs, look_often, high_writes_inputs, check_inputs);
    CHECK_EQUAL(changed, 0);
}

/* ---- several words are seen together ---- */

static RTS_UI8 pattern;

static void low_fills(void)
{
    RTS_UI32 i;

    for (i = 3; i < 43; i++) {
        may_be_interrupted();
        *byte_of(LOW, APP_AREA_OUTPUT, i) = 0x5A;
    }
}

static void high_looks(void)
{
    pattern = *byte_of(HIGH, APP_AREA_OUTPUT, 3);
    for (RTS_UI32 i = 3; i < 43; i++)
        changed += *byte_of(HIGH, APP_AREA_OUTPUT, i) != pattern;
}

static void high_reads_outputs(void)
{
    cycle(HIGH, high_looks);
}

static void begin_fill(void)
{
    memset(areas, 0, sizeof areas);
    use_nothing();
    use(LOW, APP_AREA_OUTPUT, 0, 48, CDL_IMAGE_WRITTEN);
    use(HIGH, APP_AREA_OUTPUT, 0, AREA_SIZE, 0);
    start(true);
}

static void check_fill(void)
{
    for (RTS_UI32 i = 0; i < AREA_SIZE; i++)
        CHECK_EQUAL(fake_area(APP_AREA_OUTPUT)[i], (i >= 3 && i < 43 ? 0x5A : 0));
}

static void what_a_cycle_changes_is_seen_as_a_whole(void)
{
    changed = 0;
    (void)at_every_step(begin_fill, low_fills, high_reads_outputs, check_fill);
    CHECK_EQUAL(changed, 0);
}

/* ---- the safe state ---- */

static void stop(void)
{
    running = 0;
    memset(fake_area(APP_AREA_OUTPUT), 0, AREA_SIZE); /* within the lock, as AppAreasClearOutputs does */
}

static void check_zero(void)
{
    RTS_UI32 i;

    for (i = 0; i < AREA_SIZE; i++)
        lost += running == 0 && fake_area(APP_AREA_OUTPUT)[i] != 0;
}

static void a_cycle_that_ends_after_the_stop_leaves_the_outputs_at_zero(void)
{
    with_copies = true;
    lost = 0;
    (void)at_every_step(begin_bits, low_bits, stop, check_zero);
    CHECK_EQUAL(lost, 0);
}

/* ---- the plan ---- */

static void a_task_that_uses_a_part_alone_works_on_the_shared_one(void)
{
    use_nothing();
    uses[LOW][1] = (CDL_IMAGE){0, 1, CDL_IMAGE_WRITTEN};
    uses[HIGH][1] = (CDL_IMAGE){1, 1, CDL_IMAGE_WRITTEN};
    always = false;
    start(true);
    CHECK_EQUAL(used, 0);
    CHECK_SAME(context[LOW].area[APP_AREA_OUTPUT], fake_area(APP_AREA_OUTPUT));
    CHECK_SAME(context[HIGH].area[APP_AREA_OUTPUT], fake_area(APP_AREA_OUTPUT));
}

static void what_is_written_takes_its_copy_twice(void)
{
    use_nothing();
    use(LOW, APP_AREA_OUTPUT, 0, 16, CDL_IMAGE_WRITTEN);
    use(HIGH, APP_AREA_OUTPUT, 8, 8, 0);
    start(true);
    CHECK_EQUAL(used * CDL_IMAGE_UNIT, 2 * 16 + 8);
    CHECK_SAME(context[LOW].area[APP_AREA_INPUT], fake_area(APP_AREA_INPUT));
    CHECK_SAME(byte_of(LOW, APP_AREA_OUTPUT, 0), (RTS_UI8 *)copies);
    CHECK_SAME(byte_of(HIGH, APP_AREA_OUTPUT, 8), (RTS_UI8 *)copies + 32);
}

static void an_address_in_a_copy_is_that_of_the_area(void)
{
    RTS_UI32 area = 99;
    RTS_UI32 offset = 99;

    begin_fill();
    CHECK(test_find((uintptr_t)byte_of(LOW, APP_AREA_OUTPUT, 42), &area, &offset));
    CHECK(area == APP_AREA_OUTPUT && offset == 42);
    CHECK(test_find((uintptr_t)byte_of(HIGH, APP_AREA_OUTPUT, 63), &area, &offset));
    CHECK(area == APP_AREA_OUTPUT && offset == 63);
    CHECK(!test_find((uintptr_t)byte_of(HIGH, APP_AREA_OUTPUT, 64), &area, &offset));
    CHECK(!test_find(0, &area, &offset));
}

/* ---- every bit ---- */

static RTS_UI32 bit; /* of the outputs */

static void low_one_bit(void)
{
    set_bit(LOW, APP_AREA_OUTPUT, bit / 8, (RTS_UI8)(1 << bit % 8), (*byte_of(LOW, APP_AREA_INPUT, 0) & 1) != 0);
}

static void every_bit_goes_both_ways_and_no_other_changes(void)
{
    RTS_UI32 on;
    RTS_UI32 i;

    for (bit = 0; bit < 8 * AREA_SIZE; bit++) {
        for (on = 0; on < 2; on++) {
            memset(areas, on ? 0 : 0xFF, sizeof areas);
            use_nothing();
            use(LOW, APP_AREA_INPUT, 0, 8, 0);
            use(LOW, APP_AREA_OUTPUT, bit / 64 * 8, 8, CDL_IMAGE_WRITTEN);
            use(HIGH, APP_AREA_OUTPUT, 0, AREA_SIZE, 0);
            fake_area(APP_AREA_INPUT)[0] = (RTS_UI8)(on ? 1 : 0);
            start(true);
            cycle(LOW, low_one_bit);
            for (i = 0; i < 8 * AREA_SIZE; i++)
                CHECK_EQUAL((fake_area(APP_AREA_OUTPUT)[i / 8] >> i % 8 & 1u), (i == bit ? on : 1 - on));
        }
    }
}

int main(void)
{
    RUN(two_tasks_never_undo_each_others_bits);
    RUN(without_copies_they_do);
    RUN(what_main_writes_is_neither_lost_nor_undoes_anything);
    RUN(inputs_hold_still_for_a_cycle_and_a_task_that_writes_them_is_heard);
    RUN(what_a_cycle_changes_is_seen_as_a_whole);
    RUN(a_cycle_that_ends_after_the_stop_leaves_the_outputs_at_zero);
    RUN(a_task_that_uses_a_part_alone_works_on_the_shared_one);
    RUN(what_is_written_takes_its_copy_twice);
    RUN(an_address_in_a_copy_is_that_of_the_area);
    RUN(every_bit_goes_both_ways_and_no_other_changes);
    return test_result();
}
