/*
 * test_fdcan.c - FdCan.c on a model of the registers and the message memory of FDCAN (RM0440, chapter 44), as far as the
 * driver uses them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The model sends the buffer with the lowest identifier, of equal ones the first; filters frames by its elements; has two
 * FIFOs of three frames; and checks that registers are written only when the chip allows it. It is no chip: pins, time
 * and errors on the bus are not in it.
 */
#include "CanQueue.h"
#include "ChipRegister.h"
#include "CmpSettingsEmbedded.h"
#include "FdCan.h"
#include "SysTime.h"
#include "test.h"

enum { BASE = 0x40006400, MEMORY = 0x4000A400, CLOCK_HZ = 80000000, DEPTH = 3, BUFFERS = 3, FILTERS = 28, SENT = 256 };
enum { DBTP = 0x0C, CCCR = 0x18, NBTP = 0x1C, ECR = 0x40, PSR = 0x44, TDCR = 0x48, IR = 0x50, IE = 0x54, ILE = 0x5C };
enum { RXGFC = 0x80, RXF0S = 0x90, RXF0A = 0x94, RXF1S = 0x98, RXF1A = 0x9C, TXBC = 0xC0, TXFQS = 0xC4, TXBRP = 0xC8 };
enum { TXBAR = 0xCC, TXBCR = 0xD0, TXBTIE = 0xDC, SIZE = 0x104, MEMORY_SIZE = 0x350 };
enum { INIT = 1, CHANGE = 2, OFF = 1 << 7, SENT_FLAG = 1 << 7, ELEMENT = 72 };
enum { STANDARD_FILTERS = 0, EXTENDED_FILTERS = 0x70, RX = 0xB0, RX_FIFO = 216, TX = 0x278 };

const FDCAN BoardCan[BOARD_CAN_COUNT] = {{BASE, MEMORY, CLOCK_HZ}};

static struct {
    RTS_UI32 word[SIZE / 4];
    RTS_UI32 memory[MEMORY_SIZE / 4];
    RTS_UI32 first[2];
    RTS_UI32 count[2];
    bool recovers;
    bool is_stuck; /* it does not go into the initialisation */
    CAN_FRAME sent[SENT];
    RTS_UI32 sent_count;
    RTS_UI32 starts;
} chip;

static RTS_UI32 *at(RTS_UI32 offset)
{
    return &chip.word[offset / 4];
}

static RTS_UI32 *in_memory(RTS_UI32 offset)
{
    return &chip.memory[offset / 4];
}

/* ---- what the driver needs of others ---- */

RTS_I32 SettgGetIntValue(const char *component, const char *key, RTS_I32 otherwise)
{
    RTS_UNUSED(component);
    RTS_UNUSED(key);
    return otherwise;
}

RTS_I64 SysTimeGetNs(void)
{
    return 7000;
}

void BoardCanStart(RTS_UI32 index)
{
    RTS_UNUSED(index);
    chip.starts++;
}

/* ---- the registers ---- */

static void update_queue(void)
{
    RTS_UI32 put = 0;

    while (put < BUFFERS && (*at(TXBRP) >> put & 1) != 0)
        put++;
    *at(TXFQS) = put == BUFFERS ? 1u << 21 : put << 16;
}

static void update_fifos(void)
{
    for (RTS_UI32 fifo = 0; fifo < 2; fifo++)
        *at(RXF0S + 8 * fifo) = chip.count[fifo] | chip.first[fifo] << 8;
}

/* CCE can be set in the initialisation only, and forgets what is on its way. */
static void write_control(RTS_UI32 value)
{
    bool was_in = (*at(CCCR) & INIT) != 0;

    if (chip.is_stuck)
        return;
    if (!was_in || (value & INIT) == 0)
        value &= ~(RTS_UI32)CHANGE;
    if ((value & CHANGE) != 0 && (*at(CCCR) & CHANGE) == 0) {
        *at(TXBRP) = 0;
        memset(chip.count, 0, sizeof(chip.count));
        memset(chip.first, 0, sizeof(chip.first));
    }
    *at(CCCR) = value;
    chip.recovers = chip.recovers || (was_in && (value & INIT) == 0 && (*at(PSR) & OFF) != 0);
}

static bool is_protected(RTS_UI32 offset)
{
    return offset == DBTP || offset == NBTP || offset == TDCR || offset == RXGFC || offset == TXBC;
}

static void acknowledge(RTS_UI32 fifo, RTS_UI32 index)
{
    CHECK(chip.count[fifo] != 0 && index == chip.first[fifo]);
    chip.first[fifo] = (index + 1) % DEPTH;
    chip.count[fifo]--;
}

static void write_register(RTS_UI32 offset, RTS_UI32 value)
{
    CHECK(offset < SIZE);
    CHECK(!is_protected(offset) || (*at(CCCR) & (INIT | CHANGE)) == (INIT | CHANGE));
    CHECK(offset != ECR && offset != PSR && offset != TXBRP && offset != TXFQS && offset != RXF0S && offset != RXF1S);
    if (offset == CCCR)
        write_control(value);
    else if (offset == IR)
        *at(IR) &= ~value;
    else if (offset == TXBAR)
        *at(TXBRP) |= value;
    else if (offset == TXBCR)
        *at(TXBRP) &= ~value;
    else if (offset == RXF0A || offset == RXF1A)
        acknowledge(offset == RXF1A, value);
    else
        *at(offset) = value;
}

static bool is_in_use(RTS_UI32 offset)
{
    return offset >= TX && (*at(TXBRP) >> (offset - TX) / ELEMENT & 1) != 0;
}

void ChipWrite(RTS_UI32 address, RTS_UI32 value)
{
    CHECK(chip.starts != 0); /* without its clock it takes nothing */
    if (address - MEMORY < MEMORY_SIZE) {
        CHECK(!is_in_use(address - MEMORY));
        *in_memory(address - MEMORY) = value;
    } else {
        write_register(address - BASE, value);
    }
    update_queue();
    update_fifos();
}

RTS_UI32 ChipRead(RTS_UI32 address)
{
    return address - MEMORY < MEMORY_SIZE ? *in_memory(address - MEMORY) : *at(address - BASE);
}

/* ---- the bus ---- */

static void interrupt(void)
{
    for (RTS_UI32 i = 0; i < 10; i++) {
        if ((*at(IR) & *at(IE)) == 0 || *at(ILE) != 1)
            return;
        FdCanInterrupt(0);
    }
    CHECK(false); /* an interrupt that does not end */
}

static RTS_UI32 rank_of(RTS_UI32 buffer)
{
    RTS_UI32 id = *in_memory(TX + ELEMENT * buffer);
    bool is_extended = (id & 1 << 30) != 0;

    return (id >> 18 & 0x7FF) << 19 | (is_extended ? 1u << 18 | (id & 0x3FFFF) : 0);
}

static const RTS_UI8 sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static void log_frame(const RTS_UI32 *element)
{
    CAN_FRAME *frame = &chip.sent[chip.sent_count++ % SENT];
    bool is_extended = (element[0] & 1 << 30) != 0;

    memset(frame, 0, sizeof(*frame));
    frame->id = is_extended ? element[0] & 0x1FFFFFFF : element[0] >> 18 & 0x7FF;
    frame->size = sizes[element[1] >> 16 & 15];
    frame->flags =
        (RTS_UI8)((is_extended ? CAN_FLAG_EXTENDED : 0) | ((element[0] & 1 << 29) != 0 ? CAN_FLAG_REMOTE : 0) |
                  ((element[1] & 1 << 21) != 0 ? CAN_FLAG_FD : 0) | ((element[1] & 1 << 20) != 0 ? CAN_FLAG_FAST : 0));
    if ((frame->flags & CAN_FLAG_REMOTE) == 0)
        memcpy(frame->data, element + 2, frame->size);
}

/* One frame goes over the bus. */
static bool pass(void)
{
    RTS_UI32 best = BUFFERS;

    CHECK(*at(TXBC) == 1u << 24);
    for (RTS_UI32 i = 0; i < BUFFERS; i++)
        if ((*at(TXBRP) >> i & 1) != 0 && (best == BUFFERS || rank_of(i) < rank_of(best)))
            best = i;
    if (best == BUFFERS || (*at(PSR) & OFF) != 0 || (*at(CCCR) & INIT) != 0)
        return false;
    log_frame(in_memory(TX + ELEMENT * best));
    *at(TXBRP) &= ~(1u << best);
    if ((*at(TXBTIE) >> best & 1) != 0)
        *at(IR) |= SENT_FLAG;
    update_queue();
    interrupt();
    return true;
}

/* The FIFO of the first element that fits; 2: none. */
static RTS_UI32 find_fifo(const CAN_FRAME *frame)
{
    bool is_extended = (frame->flags & CAN_FLAG_EXTENDED) != 0;
    RTS_UI32 count = *at(RXGFC) >> (is_extended ? 24 : 16) & 0x1F;

    CHECK((*at(RXGFC) & 0x3C) == 0x28); /* what fits none is not taken */
    for (RTS_UI32 i = 0; i < count; i++) {
        const RTS_UI32 *element = in_memory(is_extended ? EXTENDED_FILTERS + 8 * i : STANDARD_FILTERS + 4 * i);
        RTS_UI32 to = is_extended ? element[0] >> 29 : element[0] >> 27 & 7;
        RTS_UI32 id = is_extended ? element[0] & 0x1FFFFFFF : element[0] >> 16 & 0x7FF;
        RTS_UI32 mask = is_extended ? element[1] & 0x1FFFFFFF : element[0] & 0x7FF;
        if (to != 0 && ((id ^ frame->id) & mask) == 0)
            return to - 1;
    }
    return 2;
}

/* A frame of another node, without an interrupt. */
static void arrive(const CAN_FRAME *frame)
{
    RTS_UI32 fifo = find_fifo(frame);
    RTS_UI32 dlc = 0;

    if (fifo == 2 || (*at(CCCR) & INIT) != 0)
        return;
    if (chip.count[fifo] == DEPTH) {
        *at(IR) |= 1u << (2 + 3 * fifo);
        return;
    }
    RTS_UI32 *element = in_memory(RX + RX_FIFO * fifo + ELEMENT * ((chip.first[fifo] + chip.count[fifo]++) % DEPTH));
    while (sizes[dlc] < frame->size)
        dlc++;
    element[0] = (frame->flags & CAN_FLAG_EXTENDED) != 0 ? frame->id | 1 << 30 : frame->id << 18;
    element[0] |= (frame->flags & CAN_FLAG_REMOTE) != 0 ? 1 << 29 : 0;
    element[1] = dlc << 16 | ((frame->flags & CAN_FLAG_FD) != 0 ? 1 << 21 : 0) |
                 ((frame->flags & CAN_FLAG_FAST) != 0 ? 1 << 20 : 0);
    memcpy(element + 2, frame->data, frame->size);
    *at(IR) |= 1u << 3 * fifo;
    update_fifos();
}

/* Bus off is the initialisation. */
static void set_errors(RTS_UI32 tx, RTS_UI32 rx)
{
    *at(PSR) = (tx >= 96 ? 1u << 6 : 0) | (tx >= 128 ? 1u << 5 : 0) | (tx > 255 ? (RTS_UI32)OFF : 0);
    *at(ECR) = (tx > 255 ? 0 : tx) | rx << 8;
    if (tx > 255)
        *at(CCCR) |= INIT;
}

#include "chip_can_tests.h"

static void open_at(RTS_UI32 data_bit_rate)
{
    static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};

    memset(&chip, 0, sizeof(chip));
    memset(chip.memory, 0xA5, sizeof(chip.memory)); /* it is not cleared by a reset */
    *at(CCCR) = INIT;
    update_queue();
    CHECK_EQUAL(SysCanOpen(0, 0, data_bit_rate), ERR_OK);
    CHECK_EQUAL(*at(CCCR) & INIT, 0);
    CHECK_EQUAL(SysCanSetFilters(0, all, 2), ERR_OK);
    SysCanSetUrgent(0, NULL);
}

static void open(void)
{
    open_at(0);
}

/* ---- tests ---- */

static void bit_timing_is_written_as_the_manual_says(void)
{
    open_at(2000000);
    CHECK_EQUAL(*at(NBTP), (20 - 1) << 25 | (1 - 1) << 16 | (139 - 1) << 8 | (20 - 1));       /* 160 quanta, 87.5 % */
    CHECK_EQUAL(*at(DBTP), 1 << 23 | (2 - 1) << 16 | (16 - 1) << 8 | (3 - 1) << 4 | (3 - 1)); /* 20 quanta, 85 % */
    CHECK_EQUAL(*at(TDCR), 34 << 8);
}

static void frames_of_can_fd_arrive_as_they_were_sent(void)
{
    CAN_FRAME got;

    open_at(2000000);
    CHECK(SysCanIsFd(0));
    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes); i++) {
        CAN_FRAME frame = {.id = 0x1F40017F, .flags = CAN_FLAG_EXTENDED | CAN_FLAG_FD, .size = sizes[i]};
        if (i % 2 != 0)
            frame.flags |= CAN_FLAG_FAST;
        for (RTS_UI32 k = 0; k < frame.size; k++)
            frame.data[k] = (RTS_UI8)(k + i);
        CHECK_EQUAL(SysCanSend(0, &frame), ERR_OK);
        CHECK(pass());
        CHECK(memcmp(&chip.sent[chip.sent_count - 1], &frame, sizeof(frame)) == 0);
        arrive(&frame);
        interrupt();
        CHECK_EQUAL(SysCanReceive(0, &got), ERR_OK);
        got.time_us = 0;
        CHECK(memcmp(&got, &frame, sizeof(frame)) == 0);
    }
}

static void classic_bus_has_no_frames_of_can_fd(void)
{
    const CAN_FRAME frame = {.id = 1, .flags = CAN_FLAG_FD, .size = 12};

    open();
    CHECK(!SysCanIsFd(0));
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_PARAMETER);
}

static void new_filters_do_not_lose_frames(void)
{
    static const CAN_FILTER one = {0x100, 0x7FF, false};
    CAN_FRAME frame = frame_of(0x200, 0, 1);

    open();
    for (RTS_UI32 i = 0; i < BUFFERS; i++)
        CHECK_EQUAL(send(0x300 + i, 0, 0), ERR_OK);
    arrive(&frame);
    CHECK_EQUAL(SysCanSetFilters(0, &one, 1), ERR_OK);
    interrupt();
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    CHECK(pass() && pass() && pass());
}

static void more_extended_filters_than_elements_let_all_pass(void)
{
    CAN_FILTER filters[9];
    CAN_FRAME frame;

    open();
    for (RTS_UI32 i = 0; i < RTS_COUNT(filters); i++)
        filters[i] = (CAN_FILTER){i, 0x1FFFFFFF, true};
    CHECK_EQUAL(SysCanSetFilters(0, filters, 8), ERR_OK);
    receive(100, CAN_FLAG_EXTENDED, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_NOTHING_TO_DO);
    receive(7, CAN_FLAG_EXTENDED, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    CHECK_EQUAL(SysCanSetFilters(0, filters, 9), ERR_OK);
    receive(100, CAN_FLAG_EXTENDED, 0);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
}

static void a_chip_that_does_not_reply_is_an_error_not_a_hang(void)
{
    open();
    SysCanClose(0);
    *at(CCCR) = 0;
    chip.is_stuck = true;
    CHECK_EQUAL(SysCanOpen(0, 0, 0), ERR_DEVICE);
    CHECK_EQUAL(send(1, 0, 0), ERR_DEVICE);
}

static void bit_rates_that_cannot_be_are_refused(void)
{
    open();
    CHECK_EQUAL(SysCanOpen(0, 700001, 0), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(SysCanOpen(0, 500000, 100000), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(SysCanOpen(1, 500000, 0), ERR_DEVICE);
}

int main(void)
{
    run_chip_can_tests();
    RUN(bit_timing_is_written_as_the_manual_says);
    RUN(frames_of_can_fd_arrive_as_they_were_sent);
    RUN(classic_bus_has_no_frames_of_can_fd);
    RUN(new_filters_do_not_lose_frames);
    RUN(more_extended_filters_than_elements_let_all_pass);
    RUN(a_chip_that_does_not_reply_is_an_error_not_a_hang);
    RUN(bit_rates_that_cannot_be_are_refused);
    return test_result();
}
