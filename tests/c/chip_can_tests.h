/*
 * chip_can_tests.h - tests of drivers of CAN controllers on a model of their registers.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Before it is included the model of a chip defines: `chip` with what was `sent`, `sent_count` and whether it `recovers`
 * from bus off; DEPTH, frames of a FIFO; FILTERS, the most of 11 bits; CLOCK_HZ; and the functions open (all frames pass),
 * arrive (of a frame), interrupt, pass (one frame goes over the bus) and set_errors (counters; 256: bus off).
 */
#ifndef CHIP_CAN_TESTS_H
#define CHIP_CAN_TESTS_H

static void open(void);

static CAN_FRAME frame_of(RTS_UI32 id, RTS_UI8 flags, RTS_UI8 number)
{
    return (CAN_FRAME){.id = id, .flags = flags, .size = 8, .data = {number, 1, 2, 3, 4, 5, 6, 7}};
}

static RTS_RESULT send(RTS_UI32 id, RTS_UI8 flags, RTS_UI8 number)
{
    CAN_FRAME frame = frame_of(id, flags, number);

    return SysCanSend(0, &frame);
}

static void receive(RTS_UI32 id, RTS_UI8 flags, RTS_UI8 number)
{
    CAN_FRAME frame = frame_of(id, flags, number);

    arrive(&frame);
    interrupt();
}

static void bit_timing_is_exact_and_samples_late(void)
{
    static const RTS_UI32 clocks[] = {8000000, 24000000, 30000000, 36000000, 42000000, 45000000, 48000000};
    static const RTS_UI32 rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 1000000};
    static const CAN_TIMING_LIMITS limits = {1024, 16, 8, 4};

    for (RTS_UI32 i = 0; i < RTS_COUNT(clocks); i++)
        for (RTS_UI32 k = 0; k < RTS_COUNT(rates); k++) {
            CAN_TIMING t;
            CHECK(CanFindTiming(clocks[i], rates[k], &limits, &t));
            RTS_UI32 quanta = 1u + t.segment1 + t.segment2;
            CHECK_EQUAL(t.prescaler * quanta * rates[k], clocks[i]);
            CHECK(t.segment1 <= 16 && t.segment2 <= 8 && t.jump <= 4 && t.jump <= t.segment2 && t.jump != 0);
            CHECK(t.segment2 * 1000 / quanta >= 100 && t.segment2 * 1000 / quanta <= 200);
        }
}

static void frames_of_all_kinds_arrive_as_they_were_sent(void)
{
    static const RTS_UI8 flags[] = {0, CAN_FLAG_EXTENDED, CAN_FLAG_REMOTE, CAN_FLAG_EXTENDED | CAN_FLAG_REMOTE};

    open();
    for (RTS_UI32 i = 0; i < RTS_COUNT(flags); i++)
        for (RTS_UI8 size = 0; size <= 8; size++) {
            CAN_FRAME got, frame = {.id = (flags[i] & 1) != 0 ? 0x1F40017F : 0x6A5, .flags = flags[i], .size = size};
            if ((flags[i] & CAN_FLAG_REMOTE) == 0)
                memset(frame.data, 0xA5, size);
            CHECK_EQUAL(SysCanSend(0, &frame), ERR_OK);
            CHECK(pass());
            CAN_FRAME sent = chip.sent[chip.sent_count - 1];
            CHECK(sent.id == frame.id && sent.flags == frame.flags && sent.size == size);
            CHECK(memcmp(sent.data, frame.data, 8) == 0);
            arrive(&frame);
            interrupt();
            CHECK_EQUAL(SysCanReceive(0, &got), ERR_OK);
            CHECK_EQUAL(got.time_us, 7);
            CHECK(got.id == frame.id && got.flags == frame.flags && got.size == size);
            CHECK(memcmp(got.data, frame.data, 8) == 0);
            CHECK_EQUAL(SysCanReceive(0, &got), ERR_NOTHING_TO_DO);
        }
}

static void frames_of_one_identifier_keep_their_order(void)
{
    RTS_UI8 next = 0;

    open();
    for (RTS_UI8 number = 0; number < 100; number++) {
        CHECK_EQUAL(send(0x1F400180, CAN_FLAG_EXTENDED, number), ERR_OK);
        if (number % 3 == 2)
            CHECK(pass() && pass() && pass());
    }
    while (pass())
        ;
    CHECK_EQUAL(chip.sent_count, 100);
    for (RTS_UI32 i = 0; i < chip.sent_count; i++)
        CHECK_EQUAL(chip.sent[i].data[0], next++);
}

/* What is in the mailboxes when it comes may be on the bus already; the mailbox for it is free. */
static void a_frame_of_eleven_bits_goes_before_all_that_wait(void)
{
    open();
    for (RTS_UI8 number = 0; number < 10; number++)
        CHECK_EQUAL(send(0x1F400180u + number, CAN_FLAG_EXTENDED, number), ERR_OK);
    CHECK_EQUAL(send(0x6FF, 0, 0), ERR_OK);
    CHECK_EQUAL(send(0x080, 0, 0), ERR_OK);
    CHECK(pass() && pass());
    CHECK(chip.sent[0].flags == 0 && chip.sent[1].flags == 0);
}

static void frames_that_find_no_room_are_refused_and_the_others_leave(void)
{
    RTS_UI32 count = 0;

    open();
    while (send(0x1F400180u + count, CAN_FLAG_EXTENDED, 0) == ERR_OK)
        count++;
    CHECK_EQUAL(count, CAN_DRIVER_TX_FRAMES + 2);
    CHECK_EQUAL(send(0x1F400180, CAN_FLAG_EXTENDED, 0), ERR_NOBUFFER);
    while (pass())
        ;
    CHECK_EQUAL(chip.sent_count, count);
    CHECK_EQUAL(send(0x800, 0, 0), ERR_PARAMETER);
    CHECK_EQUAL(send(0x100, CAN_FLAG_FD, 0), ERR_PARAMETER);
}

static void filters_let_pass_what_they_say(void)
{
    static const CAN_FILTER filters[] = {{0x180, 0x780, false}, {0x1F400500, 0x1FFFFF00, true}};
    CAN_FRAME frame;

    open();
    CHECK_EQUAL(SysCanSetFilters(0, filters, 2), ERR_OK);
    for (RTS_UI32 id = 0; id < 0x800; id++) {
        receive(id, 0, 0);
        CHECK_EQUAL(SysCanReceive(0, &frame), id >= 0x180 && id < 0x200 ? ERR_OK : ERR_NOTHING_TO_DO);
    }
    receive(0x180, CAN_FLAG_EXTENDED, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_NOTHING_TO_DO);
    receive(0x1F4005AA, CAN_FLAG_EXTENDED, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    CHECK_EQUAL(SysCanSetFilters(0, NULL, 0), ERR_OK);
    receive(0x180, 0, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_NOTHING_TO_DO);
}

static void more_filters_than_banks_let_all_pass(void)
{
    CAN_FILTER filters[FILTERS + 1];
    CAN_FRAME frame;

    open();
    for (RTS_UI32 i = 0; i <= FILTERS; i++)
        filters[i] = (CAN_FILTER){i, 0x7FF, false};
    CHECK_EQUAL(SysCanSetFilters(0, filters, FILTERS + 1), ERR_OK);
    receive(0x555, 0, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    CHECK_EQUAL(SysCanSetFilters(0, filters, FILTERS), ERR_OK);
    receive(0x555, 0, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_NOTHING_TO_DO);
    receive(FILTERS - 1, 0, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
}

static RTS_UI32 shown;

static bool take_low(RTS_UI32 index, const CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    CHECK_EQUAL(frame->flags & CAN_FLAG_EXTENDED, 0);
    shown++;
    return frame->id < 0x400;
}

static void frames_of_eleven_bits_are_shown_in_the_interrupt(void)
{
    CAN_FRAME frame;

    open();
    shown = 0;
    SysCanSetUrgent(0, take_low);
    receive(0x181, 0, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_NOTHING_TO_DO);
    receive(0x581, 0, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    receive(0x123, CAN_FLAG_EXTENDED, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    CHECK_EQUAL(shown, 2);
}

static void frames_that_were_lost_are_counted(void)
{
    CAN_STATE state;
    CAN_FRAME frame;
    RTS_UI32 count = 0;

    open();
    for (RTS_UI32 i = 0; i < DEPTH + 2; i++) { /* interrupts are masked for so long */
        frame = frame_of(0x100, 0, (RTS_UI8)i);
        arrive(&frame);
    }
    interrupt();
    SysCanGetState(0, &state);
    CHECK_EQUAL(state.lost, 1); /* the chip says only that there was one */
    for (RTS_UI32 i = 0; i < CAN_DRIVER_RX_FRAMES; i++)
        receive(0x100, 0, 0);
    SysCanGetState(0, &state);
    CHECK_EQUAL(state.lost, 1 + DEPTH);
    while (SysCanReceive(0, &frame) == ERR_OK)
        count++;
    CHECK_EQUAL(count, CAN_DRIVER_RX_FRAMES);
}

static void errors_are_seen(void)
{
    static const struct {
        RTS_UI32 tx;
        CAN_BUS_STATE bus;
        RTS_UI32 shown;
    } cases[] = {
        {0, CAN_BUS_ACTIVE, 0},
        {96, CAN_BUS_WARNING, 96},
        {130, CAN_BUS_PASSIVE, 130},
        {256, CAN_BUS_OFF, 256},
    };
    CAN_STATE state;

    open();
    for (RTS_UI32 i = 0; i < RTS_COUNT(cases); i++) {
        set_errors(cases[i].tx, 17);
        SysCanGetState(0, &state);
        CHECK_EQUAL(state.bus, cases[i].bus);
        CHECK_EQUAL(state.tx_errors, cases[i].shown);
        CHECK_EQUAL(state.rx_errors, 17);
        CHECK_EQUAL(state.bit_rate, 500000);
    }
    SysCanClose(0);
    SysCanGetState(0, &state);
    CHECK_EQUAL(state.bus, CAN_BUS_STOPPED);
}

static void bus_off_is_ended_by_a_restart_and_old_frames_are_forgotten(void)
{
    open();
    for (RTS_UI32 times = 0; times < 1000; times++) {
        for (RTS_UI8 i = 0; i < 5; i++)
            CHECK_EQUAL(send(0x100, 0, i), ERR_OK);
        set_errors(256, 0);
        CHECK(!pass());
        CHECK_EQUAL(send(0x100, 0, 0), ERR_DEVICE);
        SysCanRestart(0);
        CHECK(chip.recovers);
        CHECK_EQUAL(send(0x100, 0, 0), ERR_DEVICE); /* until the bus has been quiet */
        set_errors(0, 0);
        chip.recovers = false;
        CHECK_EQUAL(send(0x101, 0, 9), ERR_OK);
        chip.sent_count = 0;
        CHECK(pass() && !pass());
        CHECK_EQUAL(chip.sent[0].id, 0x101);
    }
    SysCanRestart(0); /* nothing to end */
    CHECK(!chip.recovers);
}

static void run_chip_can_tests(void)
{
    RUN(bit_timing_is_exact_and_samples_late);
    RUN(frames_of_all_kinds_arrive_as_they_were_sent);
    RUN(frames_of_one_identifier_keep_their_order);
    RUN(a_frame_of_eleven_bits_goes_before_all_that_wait);
    RUN(frames_that_find_no_room_are_refused_and_the_others_leave);
    RUN(filters_let_pass_what_they_say);
    RUN(more_filters_than_banks_let_all_pass);
    RUN(frames_of_eleven_bits_are_shown_in_the_interrupt);
    RUN(frames_that_were_lost_are_counted);
    RUN(errors_are_seen);
    RUN(bus_off_is_ended_by_a_restart_and_old_frames_are_forgotten);
}

#endif
