/*
 * test_trace.c - traces: what packets record in the cycles of a task, triggers, what ends them, and persistent ones.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpBytes.h"
#include "CmpChecksum.h"
#include "CmpTraceMgr.h"
#include "CyclePhases.h"
#include "FileStore.h"
#include "counting_tasks.h"

enum { CYCLE_NS = 10000000, POINTER_AT = 32, MAX_SAMPLES = 512, MAX_VALUES = 8 };

/* ---- requests ---- */

typedef struct {
    TRACE_CONFIG head;
    MON2_PLACE records[TRACE_MAX_RECORDS];
} CONFIG;

static CONFIG config;

static void place(MON2_PLACE *to, RTS_UI8 area, RTS_UI32 offset, RTS_UI8 size)
{
    memset(to, 0, sizeof *to);
    to->area = area;
    to->size = size;
    to->mask = PLACE_ALL_BITS;
    BytesPut32(to->offset, offset);
}

static void begin_config(RTS_UI32 samples)
{
    memset(&config, 0, sizeof config);
    BytesPut32(config.head.image_crc, image_crc(&image));
    BytesPut32(config.head.every, 1);
    BytesPut32(config.head.samples, samples);
}

static void add(RTS_UI8 area, RTS_UI32 offset, RTS_UI8 size)
{
    place(&config.records[config.head.records++], area, offset, size);
}

static void set_trigger(RTS_UI32 offset, RTS_UI8 size, RTS_UI8 comparison, RTS_UI64 constant, RTS_UI32 before)
{
    config.head.flags |= TRACE_TRIGGER;
    config.head.comparison = comparison;
    memcpy(config.head.constant, &constant, sizeof constant);
    BytesPut32(config.head.before, before);
    place(&config.head.trigger, APP_AREA_DATA, offset, size);
}

static RTS_UI32 config_size(void)
{
    return (RTS_UI32)(sizeof config.head + config.head.records * sizeof(MON2_PLACE));
}

static RTS_UI32 id;

static RTS_RESULT create(void)
{
    RTS_UI32 bad;
    MON_RESULT error = MONITORING_ERR_OK;

    return TraceCreate((const RTS_UI8 *)&config, config_size(), &id, &bad, &error);
}

/* The error of a place, and the record that has it. */
static MON_RESULT refused(RTS_UI32 *bad)
{
    MON_RESULT error = MONITORING_ERR_OK;

    CHECK_EQUAL(TraceCreate((const RTS_UI8 *)&config, config_size(), &id, bad, &error), ERR_INVALID_REFERENCE);
    return error;
}

/* ---- replies ---- */

static TRACE_STATE state;
static RTS_UI32 samples[MAX_SAMPLES][MAX_VALUES]; /* the time is the first two */
static RTS_UI32 sizes[MAX_VALUES];

static RTS_UI32 get_number(const RTS_UI8 **data)
{
    RTS_UI32 number = 0;
    RTS_UI32 shift = 0;

    do
        number |= (RTS_UI32)(**data & 0x7F) << (shift < 32 ? shift : 0), shift += 7;
    while ((*(*data)++ & 0x80) != 0);
    return number >> 1 ^ (0u - (number & 1));
}

static void unpack(const RTS_UI8 *data, RTS_UI32 count)
{
    RTS_UI32 values = 2u + config.head.records;

    for (RTS_UI32 s = 0; s < count; s++) {
        const RTS_UI8 *bits = data;
        data += (values + 7) / 8;
        for (RTS_UI32 v = 0; v < values; v++) {
            RTS_UI32 number = (bits[v / 8] >> v % 8 & 1) != 0 ? get_number(&data) : 0;
            number += s > 0 ? samples[s - 1][v] : 0;
            number += s > 1 ? samples[s - 1][v] - samples[s - 2][v] : 0;
            sizes[v] = v < 2 ? 4 : config.records[v - 2].size;
            samples[s][v] = sizes[v] == 4 ? number : number & ((1u << 8 * sizes[v]) - 1);
        }
    }
}

/* Reads one message of the packet; how many samples came. */
static RTS_UI32 read_some(RTS_UI32 from, RTS_UI32 room)
{
    static RTS_UI8 data[8192];
    RTS_UI32 size = room;

    CHECK_EQUAL(TraceRead(id, from, data, &size, &state), ERR_OK);
    CHECK(size <= room);
    CHECK(BytesGet32(state.count) <= MAX_SAMPLES);
    unpack(data, BytesGet32(state.count));
    return BytesGet32(state.count);
}

static RTS_UI32 read_all(void)
{
    return read_some(0, 8192);
}

static RTS_UI32 state_now(void)
{
    (void)read_some(0, 0);
    return BytesGet32(state.state);
}

static RTS_I64 time_of(RTS_UI32 sample)
{
    return (RTS_I64)((RTS_UI64)samples[sample][1] << 32 | samples[sample][0]);
}

/* ---- the program ---- */

static RTS_UI8 *at(RTS_UI32 area, RTS_UI32 offset)
{
    return AppGetAreaAddress(area, offset, 1);
}

static void run_cycles(RTS_UI32 count)
{
    CHECK_EQUAL(SimAdvance(count * (RTS_I64)CYCLE_NS), ERR_OK);
}

/* Main counts at data[0] in each 10 ms; Slow at data[4] in each 20 ms. */
static void begin_program(void)
{
    begin();
    spec.areas[APP_AREA_INPUT] = 16;
    (void)add_counting_task("Main", KIND_CYCLIC, 10000);
    (void)add_counting_task("Slow", KIND_CYCLIC, 20000);
    load();
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
    run_cycles(1); /* that of the start; then there is one in each 10 ms */
}

/* ---- recording ---- */

static void each_cycle_of_the_task_is_recorded_with_its_time(void)
{
    begin_program();
    run_cycles(3);
    begin_config(5);
    add(APP_AREA_DATA, 0, 4);
    add(APP_AREA_DATA, 0, 1);
    CHECK_EQUAL(create(), ERR_OK);
    run_cycles(20);
    CHECK_EQUAL(read_all(), 5);
    CHECK_EQUAL(BytesGet32(state.state), TRACE_COMPLETE);
    CHECK_EQUAL(BytesGet32(state.written), 5);
    CHECK_EQUAL(BytesGet32(state.capacity), 5);
    for (RTS_UI32 i = 1; i < 5; i++) {
        CHECK_EQUAL(samples[i][2], samples[0][2] + i);
        CHECK_EQUAL(samples[i][3], samples[i][2]);
        CHECK_EQUAL(time_of(i) - time_of(i - 1), CYCLE_NS);
    }
}

static void a_packet_records_its_task_alone_and_every_nth_cycle(void)
{
    begin_program();
    begin_config(0);
    add(APP_AREA_DATA, 4, 4);
    config.head.task = 1;
    BytesPut32(config.head.every, 3);
    CHECK_EQUAL(create(), ERR_OK);
    run_cycles(40);
    CHECK(read_all() >= 6);
    for (RTS_UI32 i = 1; i < 6; i++) {
        CHECK_EQUAL(samples[i][2], samples[0][2] + 3 * i);
        CHECK_EQUAL(time_of(i) - time_of(i - 1), 6 * (RTS_I64)CYCLE_NS);
    }
}

static void values_of_all_sizes_are_packed_and_unpacked(void)
{
    static RTS_UI32 written[40][3];
    RTS_UI32 random = 1;

    begin_program();
    begin_config(40);
    add(APP_AREA_DATA, 16, 4);
    add(APP_AREA_DATA, 24, 2);
    add(APP_AREA_DATA, 28, 1);
    CHECK_EQUAL(create(), ERR_OK);
    for (RTS_UI32 i = 0; i < 40; i++) {
        for (RTS_UI32 v = 0; v < 3; v++)
            written[i][v] = (random = random * 1664525 + 1013904223) >> (i % 3) * 8;
        memcpy(at(APP_AREA_DATA, 16), &written[i][0], 4);
        memcpy(at(APP_AREA_DATA, 24), &written[i][1], 2);
        memcpy(at(APP_AREA_DATA, 28), &written[i][2], 1);
        run_cycles(1);
    }
    CHECK_EQUAL(read_all(), 40);
    for (RTS_UI32 i = 0; i < 40; i++) {
        CHECK_EQUAL(samples[i][2], written[i][0]);
        CHECK_EQUAL(samples[i][3], written[i][1] & 0xFFFF);
        CHECK_EQUAL(samples[i][4], written[i][2] & 0xFF);
    }
}

static void a_message_takes_as_many_as_fit_and_the_next_one_goes_on(void)
{
    RTS_UI32 next = 0;

    begin_program();
    begin_config(100);
    add(APP_AREA_DATA, 0, 4);
    CHECK_EQUAL(create(), ERR_OK);
    run_cycles(120);
    CHECK_EQUAL(read_some(0, 15), 0); /* less than one may take */
    for (RTS_UI32 room = 16; next < 100; room = 64) {
        RTS_UI32 got = read_some(next, room);
        CHECK(got > 0);
        CHECK_EQUAL(BytesGet32(state.first), next);
        CHECK_EQUAL(samples[got - 1][2], samples[0][2] + got - 1);
        next += got;
        if (got == 0)
            return;
    }
    CHECK_EQUAL(read_some(100, 64), 0);
    CHECK_EQUAL(read_some(200, 64), 0); /* of no packet yet */
}

static void what_the_ring_has_lost_is_left_out_and_said(void)
{
    begin_program();
    begin_config(0);
    for (RTS_UI32 i = 0; i < 90; i++)
        add(APP_AREA_DATA, 0, 4);
    CHECK_EQUAL(create(), ERR_OK);
    CHECK_EQUAL(state_now(), TRACE_TRIGGERED);
    RTS_UI32 capacity = BytesGet32(state.capacity);
    run_cycles(capacity + 50);
    config.head.records = 0; /* only the state is looked at */
    RTS_UI32 size = 0;
    CHECK_EQUAL(TraceRead(id, 3, (RTS_UI8 *)samples, &size, &state), ERR_OK);
    CHECK_EQUAL(BytesGet32(state.first), BytesGet32(state.written) - capacity);
    CHECK(BytesGet32(state.written) >= capacity + 50);
}

static void a_pointer_is_followed_in_each_cycle(void)
{
    uintptr_t pointer = 0;

    begin_program();
    begin_config(4);
    add(APP_AREA_DATA, POINTER_AT, 4);
    config.records[0].pointers = 1;
    BytesPut32(config.records[0].offset + 4, 4);
    CHECK_EQUAL(create(), ERR_OK); /* it leads nowhere now */
    for (RTS_UI32 i = 0; i < 4; i++) {
        pointer = i < 2 ? 0 : (uintptr_t)at(APP_AREA_DATA, 40 + 4 * i);
        memcpy(at(APP_AREA_DATA, POINTER_AT), &pointer, sizeof pointer);
        *at(APP_AREA_DATA, 44 + 4 * i) = (RTS_UI8)(i + 1);
        run_cycles(1);
    }
    CHECK_EQUAL(read_all(), 4);
    CHECK_EQUAL(samples[1][2], 0);
    CHECK_EQUAL(samples[2][2], 3);
    CHECK_EQUAL(samples[3][2], 4);
}

/* The task has a copy of the inputs, and none after the change. */
static void inputs_are_recorded_where_the_task_has_them_since_an_online_change(void)
{
    APP_REFUSAL refusal;
    APP_BYTES next;
    RTS_UI32 count;

    begin_program();
    spec.images[0] = (CDL_IMAGE){0, 2, CDL_IMAGE_SHARED};
    spec.image_count = 1;
    load();
    begin_config(0);
    add(APP_AREA_INPUT, 0, 1);
    CHECK_EQUAL(create(), ERR_OK);
    *at(APP_AREA_INPUT, 0) = 5;
    run_cycles(2);
    spec.image_count = 0;
    spec.change = (CDL_CHANGE){image_crc(&image), CDL_CHANGE_NO_INIT, 0, 0};
    build_image(&next, &spec);
    CHECK_EQUAL(send_part(&next, next.size), ERR_OK);
    CHECK_EQUAL(AppDownloadChange(&refusal), ERR_OK);
    *at(APP_AREA_INPUT, 0) = 9;
    run_cycles(2);
    count = read_all();
    CHECK(count >= 4);
    CHECK_EQUAL(samples[0][2], 5);
    CHECK_EQUAL(samples[count - 1][2], 9);
}

static void system_values_of_the_task_are_recorded(void)
{
    begin_program();
    begin_config(4);
    add(TRACE_SYSTEM, TRACE_CYCLE_NS, 4);
    add(TRACE_SYSTEM, TRACE_LATE_NS, 4);
    CHECK_EQUAL(create(), ERR_OK);
    run_cycles(4);
    CHECK_EQUAL(read_all(), 4);
    for (RTS_UI32 i = 0; i < 4; i++)
        CHECK_EQUAL(samples[i][3], 0); /* tasks are punctual here */
}

/* ---- triggers ---- */

/* Writes each value in a cycle of its own; the number of the value that the trigger came with, or -1. */
static int fires_at(RTS_UI8 size, RTS_UI8 flags, RTS_UI8 comparison, RTS_UI64 constant, const RTS_UI64 *values,
                    RTS_UI32 count)
{
    begin_program();
    begin_config(count);
    add(APP_AREA_DATA, 16, 4);
    set_trigger(16, size, comparison, constant, count - 1);
    config.head.flags |= flags;
    memcpy(at(APP_AREA_DATA, 16), &values[0], size);
    CHECK_EQUAL(create(), ERR_OK);
    for (RTS_UI32 i = 0; i < count; i++) {
        memcpy(at(APP_AREA_DATA, 16), &values[i], size);
        run_cycles(1);
    }
    (void)read_all();
    return BytesGet32(state.state) == TRACE_WAITING ? -1 : (int)BytesGet32(state.trigger);
}

static RTS_UI64 real(float value)
{
    RTS_UI32 bits;

    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static RTS_UI64 lreal(double value)
{
    RTS_UI64 bits;

    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void a_trigger_compares_values_of_each_kind(void)
{
    const RTS_UI64 up[] = {1, 0x7F, 0x80, 0xFF};
    const RTS_UI64 words[] = {0xFFFF, 0x8000, 0, 5};
    const RTS_UI64 dints[] = {0x80000000, 0xFFFFFFFF, 0, 0x7FFFFFFF};
    const RTS_UI64 longs[] = {(RTS_UI64)1 << 63, 0xFFFFFFFFFFFFFFFF, 0, 0x100000000};
    const RTS_UI64 reals[] = {real(-3.5f), 0xFFC00000 /* NAN */, real(-1.0f), real(-0.0f), real(2.5f), 0x7F800000};
    const RTS_UI64 lreals[] = {lreal(-1e300), (RTS_UI64)0x7FF80000 << 32, lreal(-0.0), lreal(1e-300), lreal(2.0)};

    CHECK_EQUAL(fires_at(1, 0, TRACE_GREATER, 0x7F, up, 4), 2);
    CHECK_EQUAL(fires_at(1, TRACE_SIGNED, TRACE_LESS, 0, up, 4), 2);
    CHECK_EQUAL(fires_at(1, 0, TRACE_EQUAL, 0x80, up, 4), 2);
    CHECK_EQUAL(fires_at(1, 0, TRACE_LESS | TRACE_GREATER, 1, up, 4), 1);
    CHECK_EQUAL(fires_at(1, 0, TRACE_GREATER, 0xFF, up, 4), -1);
    CHECK_EQUAL(fires_at(2, 0, TRACE_LESS, 1, words, 4), 2);
    CHECK_EQUAL(fires_at(2, TRACE_SIGNED, TRACE_GREATER | TRACE_EQUAL, 0, words, 4), 2);
    CHECK_EQUAL(fires_at(4, TRACE_SIGNED, TRACE_GREATER, 0xFFFFFFFF, dints, 4), 2);
    CHECK_EQUAL(fires_at(4, 0, TRACE_LESS, 0x80000000, dints, 4), 2);
    CHECK_EQUAL(fires_at(8, TRACE_SIGNED, TRACE_GREATER, 0xFFFFFFFF, longs, 4), 3);
    CHECK_EQUAL(fires_at(8, 0, TRACE_LESS, 0x100000001, longs, 4), 2);
    CHECK_EQUAL(fires_at(4, TRACE_REAL, TRACE_GREATER, real(-2.0f), reals, 6), 2);
    CHECK_EQUAL(fires_at(4, TRACE_REAL, TRACE_EQUAL, real(0.0f), reals, 6), 3);
    CHECK_EQUAL(fires_at(4, TRACE_REAL, TRACE_GREATER, real(1e30f), reals, 6), 5);
    CHECK_EQUAL(fires_at(8, TRACE_REAL, TRACE_GREATER, lreal(0.0), lreals, 5), 3);
    CHECK_EQUAL(fires_at(8, TRACE_REAL, TRACE_EQUAL, lreal(0.0), lreals, 5), 2);
}

static void a_trigger_of_one_bit_looks_at_it_alone(void)
{
    const RTS_UI64 values[] = {0xFB, 0x00, 0x04, 0xFF};

    begin_program();
    begin_config(4);
    add(APP_AREA_DATA, 16, 1);
    set_trigger(16, 1, TRACE_EQUAL, 4, 3);
    config.head.trigger.mask = 4;
    CHECK_EQUAL(create(), ERR_OK);
    for (RTS_UI32 i = 0; i < 4; i++) {
        memcpy(at(APP_AREA_DATA, 16), &values[i], 1);
        run_cycles(1);
    }
    CHECK_EQUAL(read_all(), 3);
    CHECK_EQUAL(BytesGet32(state.trigger), 2);
}

static void a_trigger_keeps_so_many_samples_from_before_it(void)
{
    begin_program();
    begin_config(10);
    add(APP_AREA_DATA, 0, 4);
    set_trigger(0, 4, TRACE_GREATER, 50, 4);
    CHECK_EQUAL(create(), ERR_OK);
    run_cycles(40);
    CHECK_EQUAL(state_now(), TRACE_WAITING);
    run_cycles(40);
    CHECK_EQUAL(read_all(), 10);
    CHECK_EQUAL(BytesGet32(state.state), TRACE_COMPLETE);
    CHECK_EQUAL(BytesGet32(state.trigger) - BytesGet32(state.first), 4);
    CHECK_EQUAL(samples[4][2], 51);
    CHECK_EQUAL(samples[0][2], 47);
    CHECK_EQUAL(samples[9][2], 56);
}

static void a_trigger_waits_until_it_becomes_true_or_at_its_level_does_not(void)
{
    for (RTS_UI32 level = 0; level < 2; level++) {
        begin_program();
        run_cycles(5);
        begin_config(3);
        add(APP_AREA_DATA, 0, 4);
        set_trigger(0, 4, TRACE_GREATER, 2, 0);
        config.head.flags |= level ? TRACE_LEVEL : 0;
        CHECK_EQUAL(create(), ERR_OK);
        run_cycles(5);
        CHECK_EQUAL(state_now(), level ? TRACE_COMPLETE : TRACE_WAITING);
        memset(at(APP_AREA_DATA, 0), 0, 4);
        run_cycles(8);
        CHECK_EQUAL(state_now(), TRACE_COMPLETE);
    }
}

static void a_trigger_between_two_samples_is_not_missed(void)
{
    begin_program();
    begin_config(2);
    add(APP_AREA_DATA, 0, 4);
    BytesPut32(config.head.every, 100);
    set_trigger(0, 4, TRACE_EQUAL, 20, 0);
    CHECK_EQUAL(create(), ERR_OK);
    run_cycles(130);
    (void)read_all();
    CHECK_EQUAL(BytesGet32(state.state), TRACE_COMPLETE);
    CHECK_EQUAL(samples[BytesGet32(state.trigger) - BytesGet32(state.first)][2], 20);
}

/* ---- the list ---- */

static void the_phase_is_there_only_while_something_is_recorded(void)
{
    begin_program();
    for (RTS_UI32 i = 0; i < 3; i++) {
        CHECK_EQUAL(CyclePhasesGet(), 0);
        begin_config(2);
        add(APP_AREA_DATA, 0, 4);
        CHECK_EQUAL(create(), ERR_OK);
        CHECK(CyclePhasesGet() != 0);
        run_cycles(3);
        CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
        CHECK_EQUAL(CyclePhasesGet(), 0); /* it is complete */
        CHECK_EQUAL(read_all(), 2);
        CHECK_EQUAL(TraceDelete(id), ERR_OK);
        CHECK_EQUAL(TraceDelete(id), ERR_INVALIDID);
    }
}

static void packets_share_the_buffer_and_give_it_back(void)
{
    RTS_UI32 ids[3];
    RTS_UI32 capacity, size;

    begin_program();
    for (RTS_UI32 round = 0; round < 20; round++) {
        for (RTS_UI32 i = 0; i < 3; i++) {
            begin_config(0);
            add(APP_AREA_DATA, 4 * (i % 2), 4);
            CHECK_EQUAL(create(), ERR_OK);
            ids[i] = id;
        }
        run_cycles(3);
        for (RTS_UI32 i = 0; i < 3; i++) {
            id = ids[i];
            CHECK_EQUAL(read_all(), 3);
        }
        id = 0;
        for (RTS_UI32 i = 0; i < 3; i++) {
            CHECK(TraceGetNext(&id, &size) != NULL);
            CHECK_EQUAL(id, ids[i]);
            CHECK_EQUAL(size, sizeof(TRACE_CONFIG) + sizeof(MON2_PLACE));
        }
        CHECK(TraceGetNext(&id, &size) == NULL);
        for (RTS_UI32 i = 0; i < 3; i++)
            CHECK_EQUAL(TraceDelete(ids[(i + round) % 3]), ERR_OK);
    }
    begin_config(0xFFFFFFFF); /* all there is */
    add(APP_AREA_DATA, 0, 4);
    CHECK_EQUAL(create(), ERR_OK);
    (void)state_now();
    capacity = BytesGet32(state.capacity);
    CHECK(capacity > TRACE_BUFFER / 12 - 100);
    CHECK_EQUAL(create(), ERR_NOMEMORY);
    CHECK_EQUAL(TraceDelete(id), ERR_OK);
    BytesPut32(config.head.samples, 0); /* half of it */
    CHECK_EQUAL(create(), ERR_OK);
    (void)state_now();
    CHECK_EQUAL(BytesGet32(state.capacity), capacity / 2);
    CHECK_EQUAL(create(), ERR_OK);
    TraceDeleteAll();
}

static void a_packet_that_no_tool_asks_for_ends_unless_it_is_kept(void)
{
    RTS_UI32 kept;

    begin_program();
    begin_config(0);
    add(APP_AREA_DATA, 0, 4);
    config.head.flags = TRACE_KEEP;
    CHECK_EQUAL(create(), ERR_OK);
    kept = id;
    config.head.flags = 0;
    CHECK_EQUAL(create(), ERR_OK);
    for (RTS_UI32 i = 0; i < 3; i++) {
        run_cycles((TRACE_IDLE_MS - 1000) / 10);
        CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
        CHECK_EQUAL(state_now(), TRACE_TRIGGERED);
    }
    run_cycles((TRACE_IDLE_MS + 1000) / 10);
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
    CHECK_EQUAL(TraceDelete(id), ERR_INVALIDID);
    CHECK_EQUAL(TraceDelete(kept), ERR_OK);
}

static void packets_end_with_the_variables(void)
{
    RTS_UI32 none = 0;
    RTS_UI32 size;

    begin_program();
    for (RTS_UI32 option = RESET_OPTION_WARM; option <= RESET_OPTION_ORIGIN; option++) {
        load();
        begin_config(0);
        add(APP_AREA_DATA, 0, 4);
        config.head.flags = TRACE_KEEP;
        CHECK_EQUAL(create(), ERR_OK);
        CHECK_EQUAL(AppStopApplication(), ERR_OK);
        CHECK(TraceGetNext(&none, &size) != NULL);
        none = 0;
        CHECK_EQUAL(AppReset(option), ERR_OK);
        CHECK(TraceGetNext(&none, &size) == NULL);
        CHECK_EQUAL(CyclePhasesGet(), 0);
    }
    load();
    CHECK_EQUAL(create(), ERR_OK);
    load(); /* a download */
    CHECK(TraceGetNext(&none, &size) == NULL);
}

static void what_cannot_be_traced_is_refused(void)
{
    RTS_UI32 bad;

    begin_program();
    begin_config(10);
    CHECK_EQUAL(create(), ERR_PARAMETER); /* no record */
    add(APP_AREA_DATA, 0, 2);
    add(APP_AREA_DATA, 0, 4);
    CHECK_EQUAL(create(), ERR_PARAMETER); /* a larger one after a smaller one */
    for (RTS_UI32 size = 0; size <= 0xFF; size++) {
        begin_config(10);
        add(APP_AREA_DATA, 0, (RTS_UI8)size);
        if (size == 8)
            CHECK_EQUAL(create(), ERR_PARAMETER);
        else if (size != 1 && size != 2 && size != 4)
            CHECK_EQUAL(refused(&bad), MONITORING_ERR_UNSUPPORTED_DATATYPE);
    }
    begin_config(10);
    add(APP_AREA_DATA, 0, 4);
    add(APP_AREA_DATA, 61, 4);
    CHECK_EQUAL(refused(&bad), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(bad, 1);
    place(&config.records[1], APP_AREA_COUNT, 0, 4);
    CHECK_EQUAL(refused(&bad), MONITORING_ERR_INVALID_AREA);
    place(&config.records[1], TRACE_SYSTEM, 8, 4);
    CHECK_EQUAL(refused(&bad), MONITORING_ERR_INVALID_INDEX);
    place(&config.records[1], TRACE_SYSTEM, 2, 4);
    CHECK_EQUAL(refused(&bad), MONITORING_ERR_INVALID_INDEX);
    place(&config.records[1], APP_AREA_DATA, 0, 4);
    config.records[1].pointers = PLACE_POINTERS + 1;
    CHECK_EQUAL(refused(&bad), MONITORING_ERR_NESTING_DEPTH);
    config.head.records = 1;
    set_trigger(62, 4, TRACE_LESS, 1, 0);
    CHECK_EQUAL(refused(&bad), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(bad, 1);
    set_trigger(0, 2, TRACE_LESS, 1, 0);
    config.head.flags |= TRACE_REAL;
    CHECK_EQUAL(create(), ERR_PARAMETER);
    set_trigger(0, 4, TRACE_LESS, 0x7FC00000, 0);
    CHECK_EQUAL(create(), ERR_PARAMETER); /* NAN */
    set_trigger(0, 4, TRACE_LESS, 1, 10);
    CHECK_EQUAL(create(), ERR_PARAMETER); /* all samples from before the trigger */
    config.head.flags = 0;
    BytesPut32(config.head.before, 1);
    CHECK_EQUAL(create(), ERR_PARAMETER); /* before no trigger */
    BytesPut32(config.head.before, 0);
    BytesPut32(config.head.every, 0);
    CHECK_EQUAL(create(), ERR_PARAMETER);
    BytesPut32(config.head.every, 1);
    config.head.task = 2;
    CHECK_EQUAL(create(), ERR_INVALIDID);
    config.head.task = 0;
    memset(config.head.name, 'x', sizeof config.head.name);
    CHECK_EQUAL(create(), ERR_PARAMETER);
    config.head.name[0] = '\0';
    config.head.name[15] = '\0';
    config.head.image_crc[0] ^= 1;
    CHECK_EQUAL(create(), ERR_APP_INVALID_DATAID);
    config.head.image_crc[0] ^= 1;
    for (RTS_UI32 size = 0; size < config_size() + 40; size++) {
        MON_RESULT error;
        if (size != config_size())
            CHECK_EQUAL(TraceCreate((const RTS_UI8 *)&config, size, &id, &bad, &error), ERR_SIZE_MISMATCH);
    }
    CHECK_EQUAL(CyclePhasesGet(), 0);
    CHECK_EQUAL(create(), ERR_OK);
}

/* ---- persistent packets ---- */

enum { STORE = 16 * 1024 };

static RTS_RESULT put_file(const char *name, RTS_UI32 size)
{
    RTS_RESULT result = FileStoreBegin(name, size, CRC32Update(0, &config, size));

    if (result == ERR_OK)
        result = FileStoreWrite((const RTS_UI8 *)&config, size);
    return result == ERR_OK ? FileStoreEnd() : result;
}

static void begin_persistent(void)
{
    SimFileStoreSize = STORE;
    begin_program();
    begin_config(0);
    strcpy(config.head.name, "kept");
    config.head.flags = TRACE_KEEP;
    add(APP_AREA_DATA, 0, 4);
}

/* Whether a packet of this name records. */
static bool is_recorded(const char *name)
{
    RTS_UI32 size;
    const RTS_UI8 *found;

    id = 0;
    found = TraceGetNext(&id, &size);
    return found != NULL && strcmp(((const TRACE_CONFIG *)found)->name, name) == 0;
}

static void a_persistent_packet_begins_again_after_power_up_and_reset(void)
{
    begin_persistent();
    CHECK_EQUAL(create(), ERR_OK);
    CHECK_EQUAL(put_file("trace.kept", config_size()), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(is_recorded("kept"));
    run_cycles(5);
    CHECK(read_all() >= 5);
    CHECK_EQUAL(samples[0][2], 1); /* from the first cycle on */
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK(is_recorded("kept"));
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK(!is_recorded("kept"));
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK(is_recorded("kept"));
    CHECK_EQUAL(FileStoreDelete("trace.kept"), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(!is_recorded("kept"));
}

static void a_file_of_another_program_or_a_damaged_one_begins_nothing(void)
{
    begin_persistent();
    config.head.image_crc[2] ^= 1;
    CHECK_EQUAL(put_file("trace.other", config_size()), ERR_OK);
    CHECK_EQUAL(put_file("trace.short", config_size() - 1), ERR_OK);
    config.head.image_crc[2] ^= 1;
    CHECK_EQUAL(put_file("trace.long", sizeof config), ERR_OK);
    CHECK_EQUAL(put_file("kept", config_size()), ERR_OK);
    CHECK_EQUAL(put_file("trace.empty", 0), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(AppGetState(), AS_RUN);
    CHECK(!is_recorded("kept"));
}

static void put_it(void *unused)
{
    RTS_UNUSED(unused);
    (void)put_file("trace.kept", config_size());
}

static void a_power_cut_leaves_the_previous_packet_or_the_new_one(void)
{
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool finished = false;
        RTS_UI32 cut;
        for (cut = 1; !finished && cut < 500; cut++) {
            begin_persistent();
            strcpy(config.head.name, "old");
            CHECK_EQUAL(put_file("trace.kept", config_size()), ERR_OK);
            strcpy(config.head.name, "new");
            SimFlashCut(cut, mode);
            finished = SimCall(put_it, NULL) != SIM_POWER_CUT;
            SimFlashCut(0, 0);
            SimStop();
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK_EQUAL(AppGetState(), AS_RUN);
            CHECK(is_recorded(finished ? "new" : "old") || is_recorded("new"));
        }
        CHECK(finished && cut > 3);
    }
    SimFileStoreSize = 0;
}

int main(void)
{
    NEEDS_X86_64;
    RUN(each_cycle_of_the_task_is_recorded_with_its_time);
    RUN(a_packet_records_its_task_alone_and_every_nth_cycle);
    RUN(values_of_all_sizes_are_packed_and_unpacked);
    RUN(a_message_takes_as_many_as_fit_and_the_next_one_goes_on);
    RUN(what_the_ring_has_lost_is_left_out_and_said);
    RUN(a_pointer_is_followed_in_each_cycle);
    RUN(inputs_are_recorded_where_the_task_has_them_since_an_online_change);
    RUN(system_values_of_the_task_are_recorded);
    RUN(a_trigger_compares_values_of_each_kind);
    RUN(a_trigger_of_one_bit_looks_at_it_alone);
    RUN(a_trigger_keeps_so_many_samples_from_before_it);
    RUN(a_trigger_waits_until_it_becomes_true_or_at_its_level_does_not);
    RUN(a_trigger_between_two_samples_is_not_missed);
    RUN(the_phase_is_there_only_while_something_is_recorded);
    RUN(packets_share_the_buffer_and_give_it_back);
    RUN(a_packet_that_no_tool_asks_for_ends_unless_it_is_kept);
    RUN(packets_end_with_the_variables);
    RUN(what_cannot_be_traced_is_refused);
    RUN(a_persistent_packet_begins_again_after_power_up_and_reset);
    RUN(a_file_of_another_program_or_a_damaged_one_begins_nothing);
    RUN(a_power_cut_leaves_the_previous_packet_or_the_new_one);
    return test_result();
}
