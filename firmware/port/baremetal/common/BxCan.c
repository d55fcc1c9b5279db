/*
 * BxCan.c - SysCan.h on bxCAN.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Mailboxes are sent by identifier (TXFP 0). Of one identifier only one frame is in them, and the last free one is for
 * frames of 11 bits, which so need not wait for those of tools. FIFO 0 receives frames of 11 bits, FIFO 1 others. Bus off
 * is ended by SysCanRestart (ABOM 0).
 */
#include "BxCan.h"

#include <string.h>

#include "CanQueue.h"
#include "ChipRegister.h"
#include "SysTime.h"

#define MCR 0x000u
#define MSR 0x004u
#define TSR 0x008u
#define RFR(fifo) (0x00Cu + 4u * (fifo))
#define IER 0x014u
#define ESR 0x018u
#define BTR 0x01Cu
#define TIR(mailbox) (0x180u + 0x10u * (mailbox))
#define RIR(fifo) (0x1B0u + 0x10u * (fifo))
#define FMR 0x200u
#define FM1R 0x204u
#define FS1R 0x20Cu
#define FFA1R 0x214u
#define FA1R 0x21Cu
#define FR(bank, half) (0x240u + 8u * (bank) + 4u * (half))

/* Of a mailbox: after its identifier. */
enum { DLC = 4, LOW = 8, HIGH = 12 };

enum { MCR_INIT = 1 << 0, MCR_SLEEP = 1 << 1 };
enum { MSR_INIT = 1 << 0 };
enum { RFR_COUNT = 3, RFR_OVERRUN = 1 << 4, RFR_RELEASE = 1 << 5 };
enum { IER_SENT = 1 << 0, IER_RECEIVED = 1 << 1 | 1 << 4 };
enum {
    ESR_WARNING = 1 << 0,
    ESR_PASSIVE = 1 << 1,
    ESR_OFF = 1 << 2,
    ESR_TX_SHIFT = 16,
    ESR_RX_SHIFT = 24,
    ESR_COUNT = 0xFF
};
enum { TIR_REQUEST = 1 << 0, IR_REMOTE = 1 << 1, IR_EXTENDED = 1 << 2, IR_EXTENDED_SHIFT = 3, IR_STANDARD_SHIFT = 21 };
enum { FMR_INIT = 1 << 0, FMR_SECOND_SHIFT = 8, FMR_SECOND = 0x3F << 8 };
enum { MAILBOXES = 3, FIFOS = 2, DLC_BITS = 0x0F, MAX_ERRORS = 256 };
#define TSR_DONE(mailbox) (1u << 8 * (mailbox))
#define TSR_ABORT(mailbox) (1u << (8 * (mailbox) + 7))
#define TSR_EMPTY(mailbox) (1u << (26 + (mailbox)))

typedef struct {
    bool is_open;
    RTS_UI32 bit_rate;
    RTS_UI32 overruns;
    RTS_UI32 rank[MAILBOXES]; /* of what is in a mailbox */
    CAN_TX tx;
    CAN_RX rx;
} CONTROLLER;

static CONTROLLER controllers[BOARD_CAN_COUNT];

static RTS_UI32 at(RTS_UI32 index, RTS_UI32 offset)
{
    return BoardCan[index].base + offset;
}

RTS_UI32 SysCanGetCount(void)
{
    return BOARD_CAN_COUNT;
}

/* ---- sending ---- */

static void fill(RTS_UI32 index, RTS_UI32 mailbox, const CAN_FRAME *frame)
{
    RTS_UI32 place = at(index, TIR(mailbox));
    RTS_UI32 words[2] = {0, 0};
    RTS_UI32 id = (frame->flags & CAN_FLAG_EXTENDED) != 0 ? frame->id << IR_EXTENDED_SHIFT | IR_EXTENDED
                                                          : frame->id << IR_STANDARD_SHIFT;

    CanToWords(frame->data, frame->size, words);
    if ((frame->flags & CAN_FLAG_REMOTE) != 0)
        id |= IR_REMOTE;
    controllers[index].rank[mailbox] = CanRank(frame);
    ChipWrite(place + DLC, frame->size);
    ChipWrite(place + LOW, words[0]);
    ChipWrite(place + HIGH, words[1]);
    ChipWrite(place, id | TIR_REQUEST);
}

/* What is in the mailboxes: fills `busy`. */
static RTS_UI32 list_busy(RTS_UI32 index, RTS_UI32 status, RTS_UI32 *busy)
{
    RTS_UI32 count = 0;

    for (RTS_UI32 i = 0; i < MAILBOXES; i++)
        if ((status & TSR_EMPTY(i)) == 0)
            busy[count++] = controllers[index].rank[i];
    return count;
}

/* With the interrupt for sending off, or in it. */
static void fill_mailboxes(RTS_UI32 index)
{
    RTS_UI32 busy[MAILBOXES];
    CAN_FRAME frame;

    for (RTS_UI32 i = 0; i < MAILBOXES; i++) {
        RTS_UI32 status = ChipRead(at(index, TSR));
        RTS_UI32 count = list_busy(index, status, busy);
        if ((status & TSR_EMPTY(i)) == 0)
            continue;
        if (!CanTxTake(&controllers[index].tx, busy, count, count == MAILBOXES - 1, &frame))
            return;
        fill(index, i, &frame);
    }
}

RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    CONTROLLER *controller = &controllers[index];

    if (!controller->is_open || (ChipRead(at(index, ESR)) & ESR_OFF) != 0)
        return ERR_DEVICE;
    if (!CanIsFrame(frame) || (frame->flags & CAN_FLAG_FD) != 0)
        return ERR_PARAMETER;
    ChipClear(at(index, IER), IER_SENT);
    (void)ChipRead(at(index, IER)); /* it is off from here on */
    bool has_room = CanTxPut(&controller->tx, frame);
    fill_mailboxes(index);
    ChipSet(at(index, IER), IER_SENT);
    return has_room ? ERR_OK : ERR_NOBUFFER;
}

/* ---- receiving ---- */

static void read_frame(RTS_UI32 index, RTS_UI32 fifo, CAN_FRAME *frame)
{
    RTS_UI32 place = at(index, RIR(fifo));
    RTS_UI32 id = ChipRead(place);
    RTS_UI32 size = ChipRead(place + DLC) & DLC_BITS;
    const RTS_UI32 words[2] = {ChipRead(place + LOW), ChipRead(place + HIGH)};

    memset(frame, 0, sizeof(*frame));
    frame->flags = (RTS_UI8)((id & IR_EXTENDED) != 0 ? CAN_FLAG_EXTENDED : 0);
    frame->id = (id & IR_EXTENDED) != 0 ? id >> IR_EXTENDED_SHIFT : id >> IR_STANDARD_SHIFT;
    frame->size = (RTS_UI8)(size < CAN_CLASSIC_SIZE ? size : CAN_CLASSIC_SIZE);
    frame->time_us = (RTS_UI32)(SysTimeGetNs() / 1000);
    if ((id & IR_REMOTE) != 0)
        frame->flags |= CAN_FLAG_REMOTE;
    else
        CanFromWords(words, frame->size, frame->data);
}

static void receive(RTS_UI32 index, RTS_UI32 fifo)
{
    RTS_UI32 status;
    CAN_FRAME frame;

    while (((status = ChipRead(at(index, RFR(fifo)))) & RFR_COUNT) != 0) {
        read_frame(index, fifo, &frame);
        controllers[index].overruns += (status & RFR_OVERRUN) != 0;
        ChipWrite(at(index, RFR(fifo)), RFR_RELEASE | (status & RFR_OVERRUN));
        (void)ChipWaitFor(at(index, RFR(fifo)), RFR_RELEASE, 0);
        CanRxPut(&controllers[index].rx, index, &frame);
    }
}

void BxCanInterrupt(RTS_UI32 index)
{
    RTS_UI32 status = ChipRead(at(index, TSR));
    RTS_UI32 done = status & (TSR_DONE(0) | TSR_DONE(1) | TSR_DONE(2));

    for (RTS_UI32 fifo = 0; fifo < FIFOS; fifo++)
        receive(index, fifo);
    if (done == 0 || (ChipRead(at(index, IER)) & IER_SENT) == 0)
        return;
    ChipWrite(at(index, TSR), done);
    fill_mailboxes(index);
}

RTS_RESULT SysCanReceive(RTS_UI32 index, CAN_FRAME *frame)
{
    return CanRxTake(&controllers[index].rx, frame) ? ERR_OK : ERR_NOTHING_TO_DO;
}

#if CAN_SHARED
/* The interrupt is above main: the handler does not run while main is here. */
void SysCanSetUrgent(RTS_UI32 index, PF_CAN_URGENT handler)
{
    controllers[index].rx.urgent = handler;
}
#endif

/* ---- filters ---- */

static void set_bank(const BXCAN *chip, RTS_UI32 bank, const CAN_FILTER *filter)
{
    RTS_UI32 shift = filter->extended ? IR_EXTENDED_SHIFT : IR_STANDARD_SHIFT;
    RTS_UI32 kind = filter->extended ? IR_EXTENDED : 0;

    ChipClear(chip->filters + FM1R, 1u << bank); /* a mask */
    ChipSet(chip->filters + FS1R, 1u << bank);   /* of 32 bits */
    if (filter->extended)
        ChipSet(chip->filters + FFA1R, 1u << bank);
    else
        ChipClear(chip->filters + FFA1R, 1u << bank);
    ChipWrite(chip->filters + FR(bank, 0), filter->id << shift | kind);
    ChipWrite(chip->filters + FR(bank, 1), filter->mask << shift | IR_EXTENDED);
    ChipSet(chip->filters + FA1R, 1u << bank);
}

RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count)
{
    static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};
    const BXCAN *chip = &BoardCan[index];

    if (!controllers[index].is_open)
        return ERR_DEVICE;
    if (count > chip->bank_count) { /* who receives looks at the identifiers */
        filters = all;
        count = RTS_COUNT(all);
    }
    ChipSet(chip->filters + FMR, FMR_INIT);
    ChipClear(chip->filters + FA1R, ((1u << chip->bank_count) - 1) << chip->first_bank);
    for (RTS_UI32 i = 0; i < count; i++)
        set_bank(chip, chip->first_bank + i, &filters[i]);
    ChipClear(chip->filters + FMR, FMR_INIT);
    return ERR_OK;
}

/* ---- opening, state ---- */

static bool set_timing(RTS_UI32 index, RTS_UI32 bit_rate)
{
    static const CAN_TIMING_LIMITS limits = {1024, 16, 8, 4};
    CAN_TIMING timing;

    if (!CanFindTiming(BoardCan[index].clock_hz, bit_rate, &limits, &timing))
        return false;
    ChipWrite(at(index, BTR), (timing.prescaler - 1u) | (timing.segment1 - 1u) << 16 | (timing.segment2 - 1u) << 20 |
                                  (timing.jump - 1u) << 24);
    return true;
}

static void forget(RTS_UI32 index)
{
    ChipClear(at(index, IER), IER_SENT);
    ChipWrite(at(index, TSR), TSR_ABORT(0) | TSR_ABORT(1) | TSR_ABORT(2));
    controllers[index].tx.count = 0;
}

/* Takes part in the bus from its next 11 recessive bits on; nothing waits for them. */
static void join(RTS_UI32 index)
{
    ChipSet(at(index, IER), IER_SENT | IER_RECEIVED);
    ChipClear(at(index, MCR), MCR_INIT);
}

RTS_RESULT SysCanOpen(RTS_UI32 index, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    const BXCAN *chip = &BoardCan[index];

    if (index >= BOARD_CAN_COUNT)
        return ERR_DEVICE;
    memset(&controllers[index], 0, sizeof(controllers[index]));
    BoardCanStart(index);
    ChipWrite(at(index, MCR), MCR_INIT);
    if (!ChipWaitFor(at(index, MSR), MSR_INIT, MSR_INIT))
        return ERR_DEVICE;
    if (data_bit_rate != 0 || !set_timing(index, bit_rate != 0 ? bit_rate : CAN_BIT_RATE))
        return ERR_NOT_SUPPORTED;
    controllers[index].is_open = true;
    controllers[index].bit_rate = bit_rate != 0 ? bit_rate : CAN_BIT_RATE;
    forget(index);
    if (chip->second_bank != 0)
        ChipWrite(chip->filters + FMR, (ChipRead(chip->filters + FMR) & ~(RTS_UI32)FMR_SECOND) | FMR_INIT |
                                           (RTS_UI32)chip->second_bank << FMR_SECOND_SHIFT);
    (void)SysCanSetFilters(index, NULL, 0);
    join(index);
    return ERR_OK;
}

void SysCanClose(RTS_UI32 index)
{
    ChipWrite(at(index, IER), 0);
    ChipWrite(at(index, MCR), MCR_INIT);
    controllers[index].is_open = false;
}

bool SysCanIsFd(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return false;
}

static CAN_BUS_STATE state_of(RTS_UI32 errors)
{
    if ((errors & ESR_OFF) != 0)
        return CAN_BUS_OFF;
    if ((errors & ESR_PASSIVE) != 0)
        return CAN_BUS_PASSIVE;
    return (errors & ESR_WARNING) != 0 ? CAN_BUS_WARNING : CAN_BUS_ACTIVE;
}

void SysCanGetState(RTS_UI32 index, CAN_STATE *state)
{
    CONTROLLER *controller = &controllers[index];
    RTS_UI32 errors = controller->is_open ? ChipRead(at(index, ESR)) : 0;

    memset(state, 0, sizeof(*state));
    if (!controller->is_open)
        return;
    state->bus = state_of(errors);
    state->bit_rate = controller->bit_rate;
    state->tx_errors = state->bus == CAN_BUS_OFF ? MAX_ERRORS : errors >> ESR_TX_SHIFT & ESR_COUNT;
    state->rx_errors = errors >> ESR_RX_SHIFT & ESR_COUNT;
    state->lost = controller->rx.lost + controller->overruns;
}

/* Leaving the initialisation begins the recovery, 128 times 11 recessive bits, which the controller counts. */
void SysCanRestart(RTS_UI32 index)
{
    if (!controllers[index].is_open || (ChipRead(at(index, ESR)) & ESR_OFF) == 0)
        return;
    forget(index);
    ChipSet(at(index, MCR), MCR_INIT);
    (void)ChipWaitFor(at(index, MSR), MSR_INIT, MSR_INIT);
    join(index);
}
