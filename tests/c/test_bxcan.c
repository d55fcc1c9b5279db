/*
 * test_bxcan.c - BxCan.c on a model of the registers of bxCAN (RM0090, chapter 32), as far as the driver uses them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The model sends the mailbox with the lowest identifier, of equal ones the first; filters frames by its banks; has two
 * FIFOs of three frames; and checks that registers are written only when the chip allows it. It is no chip: pins, time
 * and errors on the bus are not in it.
 */
#include "BxCan.h"
#include "CanQueue.h"
#include "ChipRegister.h"
#include "CmpSettingsEmbedded.h"
#include "SysTime.h"
#include "test.h"

enum { BASE = 0x40006400, CLOCK_HZ = 42000000, BANKS = 28, FILTERS = BANKS, DEPTH = 3, MAILBOXES = 3, SENT = 256 };
enum {
    MCR = 0x00,
    MSR = 0x04,
    TSR = 0x08,
    RF0R = 0x0C,
    IER = 0x14,
    ESR = 0x18,
    BTR = 0x1C,
    TI0R = 0x180,
    RI0R = 0x1B0
};
enum { FMR = 0x200, FM1R = 0x204, FS1R = 0x20C, FFA1R = 0x214, FA1R = 0x21C, F0R1 = 0x240, SIZE = 0x320 };
enum { BUS_OFF = 1 << 2, TXRQ = 1, INIT = 1 };

const BXCAN BoardCan[BOARD_CAN_COUNT] = {{BASE, CLOCK_HZ, BASE, 0, BANKS, BANKS}};

static struct {
    RTS_UI32 word[SIZE / 4];
    struct {
        RTS_UI32 word[4];
    } fifo[2][DEPTH];
    RTS_UI32 count[2];
    bool pending[MAILBOXES];
    bool recovers;
    bool is_stuck; /* the bus does not let it into the initialisation */
    CAN_FRAME sent[SENT];
    RTS_UI32 sent_count;
    RTS_UI32 starts;
} chip;

static RTS_UI32 *at(RTS_UI32 offset)
{
    return &chip.word[offset / 4];
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

static void write_status(RTS_UI32 value)
{
    for (RTS_UI32 i = 0; i < MAILBOXES; i++) {
        if ((value >> 8 * i & 1) != 0)
            *at(TSR) &= ~(0x0Fu << 8 * i);
        if ((value >> (8 * i + 7) & 1) != 0 && chip.pending[i]) {
            chip.pending[i] = false;
            *at(TSR) |= 1u << 8 * i | 1u << (26 + i);
        }
    }
}

static void write_fifo(RTS_UI32 fifo, RTS_UI32 value)
{
    if ((value & 1 << 4) != 0)
        *at(RF0R + 4 * fifo) &= ~(RTS_UI32)(1 << 4);
    if ((value & 1 << 5) == 0 || chip.count[fifo] == 0)
        return;
    chip.count[fifo]--;
    memmove(chip.fifo[fifo], chip.fifo[fifo] + 1, chip.count[fifo] * sizeof(chip.fifo[0][0]));
    *at(RF0R + 4 * fifo) = (*at(RF0R + 4 * fifo) & ~3u) | chip.count[fifo];
}

static void write_control(RTS_UI32 value)
{
    bool was_in = (*at(MSR) & INIT) != 0;

    *at(MCR) = value;
    if (!chip.is_stuck)
        *at(MSR) = (*at(MSR) & ~(RTS_UI32)INIT) | (value & INIT);
    if (was_in && (value & INIT) == 0 && (*at(ESR) & BUS_OFF) != 0)
        chip.recovers = true;
}

static void write_mailbox(RTS_UI32 offset, RTS_UI32 value)
{
    RTS_UI32 mailbox = (offset - TI0R) / 0x10;

    CHECK(!chip.pending[mailbox]); /* it is write protected */
    *at(offset) = value;
    if ((offset & 0x0C) != 0 || (value & TXRQ) == 0)
        return;
    chip.pending[mailbox] = true;
    *at(TSR) &= ~(0x0Fu << 8 * mailbox | 1u << (26 + mailbox));
}

static void write_filter(RTS_UI32 offset, RTS_UI32 value)
{
    bool is_bank = offset >= F0R1;
    RTS_UI32 bank = (offset - F0R1) / 8;

    if (offset != FMR && offset != FA1R)
        CHECK((*at(FMR) & INIT) != 0);
    if (is_bank)
        CHECK((*at(FA1R) >> bank & 1) == 0);
    *at(offset) = value;
}

void ChipWrite(RTS_UI32 address, RTS_UI32 value)
{
    RTS_UI32 offset = address - BASE;

    CHECK(offset < SIZE);
    CHECK(chip.starts != 0); /* without its clock it takes nothing */
    if (offset == MCR)
        write_control(value);
    else if (offset == TSR)
        write_status(value);
    else if (offset == RF0R || offset == RF0R + 4)
        write_fifo((offset - RF0R) / 4, value);
    else if (offset >= TI0R && offset < RI0R)
        write_mailbox(offset, value);
    else if (offset >= FMR)
        write_filter(offset, value);
    else
        *at(offset) = value;
    if (offset == BTR)
        CHECK((*at(MSR) & INIT) != 0);
    CHECK(offset != ESR && offset != MSR);
}

RTS_UI32 ChipRead(RTS_UI32 address)
{
    RTS_UI32 offset = address - BASE;
    RTS_UI32 fifo = (offset - RI0R) / 0x10;

    if (offset >= RI0R && offset < RI0R + 0x20)
        return chip.count[fifo] != 0 ? chip.fifo[fifo][0].word[offset % 0x10 / 4] : 0xDEADBEEF;
    return *at(offset);
}

/* ---- the bus ---- */

static void interrupt(void)
{
    for (RTS_UI32 i = 0; i < 10; i++) {
        bool sent = (*at(TSR) & 0x010101) != 0 && (*at(IER) & 1) != 0;
        bool received =
            (chip.count[0] != 0 && (*at(IER) & 1 << 1) != 0) || (chip.count[1] != 0 && (*at(IER) & 1 << 4) != 0);
        if (!sent && !received)
            return;
        BxCanInterrupt(0);
    }
    CHECK(false); /* an interrupt that does not end */
}

static RTS_UI32 rank_of(RTS_UI32 mailbox)
{
    RTS_UI32 id = *at(TI0R + 0x10 * mailbox);

    return (id >> 21) << 19 | ((id & 4) != 0 ? 1u << 18 | (id >> 3 & 0x3FFFF) : 0);
}

static void log_frame(RTS_UI32 mailbox)
{
    const RTS_UI32 *word = at(TI0R + 0x10 * mailbox);
    CAN_FRAME *frame = &chip.sent[chip.sent_count++ % SENT];
    bool is_extended = (word[0] & 4) != 0;

    *frame = (CAN_FRAME){.id = is_extended ? word[0] >> 3 : word[0] >> 21, .size = (RTS_UI8)(word[1] & 15)};
    frame->flags = (RTS_UI8)((is_extended ? CAN_FLAG_EXTENDED : 0) | ((word[0] & 2) != 0 ? CAN_FLAG_REMOTE : 0));
    memcpy(frame->data, word + 2, 8);
}

/* One frame goes over the bus. */
static bool pass(void)
{
    RTS_UI32 best = MAILBOXES;

    for (RTS_UI32 i = 0; i < MAILBOXES; i++)
        if (chip.pending[i] && (best == MAILBOXES || rank_of(i) < rank_of(best)))
            best = i;
    if (best == MAILBOXES || (*at(ESR) & BUS_OFF) != 0 || (*at(MSR) & INIT) != 0)
        return false;
    log_frame(best);
    chip.pending[best] = false;
    *at(TSR) |= 3u << 8 * best | 1u << (26 + best);
    interrupt();
    return true;
}

static RTS_UI32 word_of(const CAN_FRAME *frame)
{
    RTS_UI32 id = (frame->flags & CAN_FLAG_EXTENDED) != 0 ? frame->id << 3 | 4 : frame->id << 21;

    return id | ((frame->flags & CAN_FLAG_REMOTE) != 0 ? 2 : 0);
}

/* The FIFO that a bank with this frame has; 2: none. */
static RTS_UI32 find_fifo(RTS_UI32 word)
{
    for (RTS_UI32 i = 0; i < BANKS && (*at(FMR) & INIT) == 0; i++) {
        RTS_UI32 bit = 1u << i;
        if ((*at(FA1R) & bit) == 0)
            continue;
        CHECK((*at(FS1R) & bit) != 0 && (*at(FM1R) & bit) == 0);
        if (((*at(F0R1 + 8 * i) ^ word) & *at(F0R1 + 8 * i + 4)) == 0)
            return *at(FFA1R) >> i & 1;
    }
    return 2;
}

/* A frame of another node, without an interrupt. */
static void arrive(const CAN_FRAME *frame)
{
    RTS_UI32 fifo = find_fifo(word_of(frame));

    if (fifo == 2)
        return;
    if (chip.count[fifo] == DEPTH) {
        *at(RF0R + 4 * fifo) |= 1 << 4;
        chip.count[fifo]--;
    }
    RTS_UI32 *word = chip.fifo[fifo][chip.count[fifo]++].word;
    word[0] = word_of(frame);
    word[1] = frame->size;
    memcpy(word + 2, frame->data, 8);
    *at(RF0R + 4 * fifo) = (*at(RF0R + 4 * fifo) & ~3u) | chip.count[fifo];
}

static void set_errors(RTS_UI32 tx, RTS_UI32 rx)
{
    RTS_UI32 flags = (tx >= 96 ? 1u : 0) | (tx >= 128 ? 2u : 0) | (tx > 255 ? (RTS_UI32)BUS_OFF : 0);

    *at(ESR) = flags | (tx > 255 ? 255 : tx) << 16 | rx << 24;
}

#include "chip_can_tests.h"

static void open(void)
{
    static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};

    memset(&chip, 0, sizeof(chip));
    *at(MCR) = *at(MSR) = 2; /* it sleeps after a reset */
    *at(TSR) = 7u << 26;
    *at(FMR) = 0x2A1C0E01;
    CHECK_EQUAL(SysCanOpen(0, 0, 0), ERR_OK);
    CHECK_EQUAL(*at(MSR) & INIT, 0);
    CHECK_EQUAL(SysCanSetFilters(0, all, 2), ERR_OK);
    SysCanSetUrgent(0, NULL);
}

/* ---- tests ---- */

static void bit_rate_is_written_as_the_manual_says(void)
{
    open();
    CHECK_EQUAL(*at(BTR), (6 - 1) | (11 - 1) << 16 | (2 - 1) << 20 | (2 - 1) << 24); /* 14 quanta, sampled at 85.7 % */
}

static void bit_rates_that_cannot_be_are_refused(void)
{
    CAN_TIMING timing;
    static const CAN_TIMING_LIMITS limits = {1024, 16, 8, 4};

    open();
    CHECK_EQUAL(SysCanOpen(0, 800000, 0), ERR_NOT_SUPPORTED); /* 52.5 clocks */
    CHECK_EQUAL(SysCanOpen(0, 500000, 2000000), ERR_NOT_SUPPORTED);
    CHECK(!CanFindTiming(CLOCK_HZ, 0, &limits, &timing));
    CHECK(!CanFindTiming(CLOCK_HZ, 0xFFFFFFFF, &limits, &timing));
    CHECK(!CanFindTiming(CLOCK_HZ, 1, &limits, &timing));
    CHECK_EQUAL(SysCanOpen(1, 500000, 0), ERR_DEVICE);
}

static void a_bus_that_is_stuck_is_an_error_not_a_hang(void)
{
    open();
    SysCanClose(0);
    *at(MSR) = 0;
    chip.is_stuck = true;
    CHECK_EQUAL(SysCanOpen(0, 0, 0), ERR_DEVICE);
    CHECK_EQUAL(send(1, 0, 0), ERR_DEVICE);
}

int main(void)
{
    run_chip_can_tests();
    RUN(bit_rate_is_written_as_the_manual_says);
    RUN(bit_rates_that_cannot_be_are_refused);
    RUN(a_bus_that_is_stuck_is_an_error_not_a_hang);
    return test_result();
}
