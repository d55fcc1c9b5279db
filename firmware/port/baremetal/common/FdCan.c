/*
 * FdCan.c - SysCan.h on FDCAN.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The transmit buffers are a queue: sent by identifier. Of one identifier only one frame is in them, and the last free one
 * is for frames of 11 bits. FIFO 0 receives frames of 11 bits, FIFO 1 others. Bus off is ended by SysCanRestart.
 */
#include "FdCan.h"

#include <string.h>

#include "CanQueue.h"
#include "ChipRegister.h"
#include "SysTime.h"

#define DBTP 0x00Cu
#define CCCR 0x018u
#define NBTP 0x01Cu
#define ECR 0x040u
#define PSR 0x044u
#define TDCR 0x048u
#define IR 0x050u
#define IE 0x054u
#define ILS 0x058u
#define ILE 0x05Cu
#define RXGFC 0x080u
#define RXFS(fifo) (0x090u + 8u * (fifo))
#define RXFA(fifo) (0x094u + 8u * (fifo))
#define TXBC 0x0C0u
#define TXFQS 0x0C4u
#define TXBRP 0x0C8u
#define TXBAR 0x0CCu
#define TXBCR 0x0D0u
#define TXBTIE 0x0DCu

/* The message memory. */
#define STANDARD_FILTER(n) (0x000u + 4u * (n))
#define EXTENDED_FILTER(n) (0x070u + 8u * (n))
#define RX_ELEMENT(fifo, n) (0x0B0u + 0x0D8u * (fifo) + 72u * (n))
#define TX_ELEMENT(n) (0x278u + 72u * (n))

enum { CCCR_INIT = 1 << 0, CCCR_CHANGE = 1 << 1, CCCR_FD = 1 << 8, CCCR_FAST = 1 << 9 };
enum { PSR_PASSIVE = 1 << 5, PSR_WARNING = 1 << 6, PSR_OFF = 1 << 7, ECR_TX = 0xFF, ECR_RX_SHIFT = 8, ECR_RX = 0x7F };
enum { I_RECEIVED = 1 << 0 | 1 << 3, I_SENT = 1 << 7, I_LOST0 = 1 << 2, I_LOST1 = 1 << 5 };
enum { RXGFC_REJECT_OTHERS = 2 << 2 | 2 << 4, RXGFC_STANDARD_SHIFT = 16, RXGFC_EXTENDED_SHIFT = 24 };
enum { RXFS_COUNT = 0x0F, RXFS_GET_SHIFT = 8, RXFS_GET = 3 };
enum { TXBC_QUEUE = 1 << 24, TXFQS_FULL = 1 << 21, TXFQS_PUT_SHIFT = 16, TXFQS_PUT = 3 };
enum { E_EXTENDED = 1 << 30, E_REMOTE = 1 << 29, E_STANDARD_SHIFT = 18, E_STANDARD = 0x7FF, E_ID = 0x1FFFFFFF };
enum { E_FD = 1 << 21, E_FAST = 1 << 20, E_DLC_SHIFT = 16, E_DLC = 0x0F };
enum { MAX_STANDARD = 28, MAX_EXTENDED = 8, FIFOS = 2, BUFFERS = 3, ALL_BUFFERS = 7, MAX_ERRORS = 256 };
enum { CLASSIC_DLC = 8, MAX_WORDS = CAN_DATA_SIZE / 4 };

typedef struct {
    bool is_open;
    bool is_fd;
    RTS_UI32 bit_rate;
    RTS_UI32 data_bit_rate;
    RTS_UI32 overruns;
    RTS_UI32 rank[BUFFERS]; /* of what is in a buffer */
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

static const RTS_UI8 fd_sizes[] = {12, 16, 20, 24, 32, 48, 64};

static RTS_UI32 dlc_of(RTS_UI32 size)
{
    RTS_UI32 more = 0;

    if (size <= CLASSIC_DLC)
        return size;
    while (fd_sizes[more] < size)
        more++;
    return CLASSIC_DLC + 1 + more;
}

static void fill(RTS_UI32 index, RTS_UI32 buffer, const CAN_FRAME *frame)
{
    RTS_UI32 place = BoardCan[index].memory + TX_ELEMENT(buffer);
    RTS_UI32 words[MAX_WORDS];
    bool is_extended = (frame->flags & CAN_FLAG_EXTENDED) != 0;
    RTS_UI32 id = is_extended ? frame->id | E_EXTENDED : frame->id << E_STANDARD_SHIFT;
    RTS_UI32 control = dlc_of(frame->size) << E_DLC_SHIFT;

    if ((frame->flags & CAN_FLAG_REMOTE) != 0)
        id |= E_REMOTE;
    if ((frame->flags & CAN_FLAG_FD) != 0)
        control |= E_FD;
    if ((frame->flags & CAN_FLAG_FAST) != 0)
        control |= E_FAST;
    ChipWrite(place, id);
    ChipWrite(place + 4, control);
    CanToWords(frame->data, frame->size, words);
    for (RTS_UI32 i = 0; 4 * i < frame->size; i++)
        ChipWrite(place + 8 + 4 * i, words[i]);
    controllers[index].rank[buffer] = CanRank(frame);
    ChipWrite(at(index, TXBAR), 1u << buffer);
}

/* With the interrupt for sending off, or in it. */
static void fill_buffers(RTS_UI32 index)
{
    RTS_UI32 busy[BUFFERS];
    RTS_UI32 count;
    CAN_FRAME frame;

    do {
        RTS_UI32 pending = ChipRead(at(index, TXBRP));
        RTS_UI32 status = ChipRead(at(index, TXFQS));
        count = 0;
        for (RTS_UI32 i = 0; i < BUFFERS; i++)
            if ((pending >> i & 1) != 0)
                busy[count++] = controllers[index].rank[i];
        if ((status & TXFQS_FULL) != 0 || !CanTxTake(&controllers[index].tx, busy, count, count == BUFFERS - 1, &frame))
            return;
        fill(index, status >> TXFQS_PUT_SHIFT & TXFQS_PUT, &frame);
    } while (count < BUFFERS - 1);
}

RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    CONTROLLER *controller = &controllers[index];

    if (!controller->is_open || (ChipRead(at(index, PSR)) & PSR_OFF) != 0)
        return ERR_DEVICE;
    if (!CanIsFrame(frame) || ((frame->flags & CAN_FLAG_FD) != 0 && !controller->is_fd))
        return ERR_PARAMETER;
    ChipClear(at(index, IE), I_SENT);
    (void)ChipRead(at(index, IE)); /* it is off from here on */
    bool has_room = CanTxPut(&controller->tx, frame);
    fill_buffers(index);
    ChipSet(at(index, IE), I_SENT);
    return has_room ? ERR_OK : ERR_NOBUFFER;
}

/* ---- receiving ---- */

static RTS_UI32 size_of(RTS_UI32 control)
{
    RTS_UI32 dlc = control >> E_DLC_SHIFT & E_DLC;
    RTS_UI32 size = dlc;

    if (dlc > CLASSIC_DLC)
        size = (control & E_FD) != 0 ? fd_sizes[dlc - CLASSIC_DLC - 1] : CLASSIC_DLC;
    return size < CAN_DATA_SIZE ? size : CAN_DATA_SIZE;
}

static void read_frame(RTS_UI32 place, CAN_FRAME *frame)
{
    RTS_UI32 id = ChipRead(place);
    RTS_UI32 control = ChipRead(place + 4);
    RTS_UI32 words[MAX_WORDS];
    bool is_extended = (id & E_EXTENDED) != 0;

    memset(frame, 0, sizeof(*frame));
    frame->id = is_extended ? id & E_ID : id >> E_STANDARD_SHIFT & E_STANDARD;
    frame->flags = (RTS_UI8)((is_extended ? CAN_FLAG_EXTENDED : 0) | ((id & E_REMOTE) != 0 ? CAN_FLAG_REMOTE : 0) |
                             ((control & E_FD) != 0 ? CAN_FLAG_FD : 0) | ((control & E_FAST) != 0 ? CAN_FLAG_FAST : 0));
    frame->size = (RTS_UI8)size_of(control);
    frame->time_us = (RTS_UI32)(SysTimeGetNs() / 1000);
    if ((id & E_REMOTE) != 0)
        return;
    for (RTS_UI32 i = 0; 4 * i < frame->size; i++)
        words[i] = ChipRead(place + 8 + 4 * i);
    CanFromWords(words, frame->size, frame->data);
}

static void receive(RTS_UI32 index, RTS_UI32 fifo)
{
    RTS_UI32 status;
    CAN_FRAME frame;

    while (((status = ChipRead(at(index, RXFS(fifo)))) & RXFS_COUNT) != 0) {
        RTS_UI32 get = status >> RXFS_GET_SHIFT & RXFS_GET;
        read_frame(BoardCan[index].memory + RX_ELEMENT(fifo, get), &frame);
        ChipWrite(at(index, RXFA(fifo)), get);
        CanRxPut(&controllers[index].rx, index, &frame);
    }
}

void FdCanInterrupt(RTS_UI32 index)
{
    RTS_UI32 flags = ChipRead(at(index, IR));

    ChipWrite(at(index, IR), flags & (RTS_UI32)(I_RECEIVED | I_LOST0 | I_LOST1));
    controllers[index].overruns += (flags & I_LOST0) != 0;
    controllers[index].overruns += (flags & I_LOST1) != 0;
    for (RTS_UI32 fifo = 0; fifo < FIFOS; fifo++)
        receive(index, fifo);
    if ((flags & I_SENT) == 0 || (ChipRead(at(index, IE)) & I_SENT) == 0)
        return;
    ChipWrite(at(index, IR), I_SENT);
    fill_buffers(index);
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

enum { CLASSIC_FILTER = 2u, TO_FIFO0 = 1u, TO_FIFO1 = 2u };

/* An element that is 0 is off; the word that turns it on is written last. */
static void set_filter(const FDCAN *chip, RTS_UI32 number, const CAN_FILTER *filter)
{
    if (filter->extended) {
        ChipWrite(chip->memory + EXTENDED_FILTER(number) + 4, (RTS_UI32)CLASSIC_FILTER << 30 | filter->mask);
        ChipWrite(chip->memory + EXTENDED_FILTER(number), (RTS_UI32)TO_FIFO1 << 29 | filter->id);
    } else {
        ChipWrite(chip->memory + STANDARD_FILTER(number),
                  (RTS_UI32)CLASSIC_FILTER << 30 | (RTS_UI32)TO_FIFO0 << 27 | filter->id << 16 | filter->mask);
    }
}

static void clear_filters(const FDCAN *chip)
{
    for (RTS_UI32 i = 0; i < MAX_STANDARD; i++)
        ChipWrite(chip->memory + STANDARD_FILTER(i), 0);
    for (RTS_UI32 i = 0; i < MAX_EXTENDED; i++)
        ChipWrite(chip->memory + EXTENDED_FILTER(i), 0);
}

static RTS_UI32 count_of(const CAN_FILTER *filters, RTS_UI32 count, bool extended)
{
    RTS_UI32 found = 0;

    for (RTS_UI32 i = 0; i < count; i++)
        found += filters[i].extended == extended;
    return found;
}

/* The chip always looks at all elements: their number can be changed in the initialisation only, which would lose the
 * frames that wait in the chip. */
RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count)
{
    static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};
    RTS_UI32 numbers[2] = {0, 0};

    if (!controllers[index].is_open)
        return ERR_DEVICE;
    if (count_of(filters, count, false) > MAX_STANDARD || count_of(filters, count, true) > MAX_EXTENDED) {
        filters = all; /* who receives looks at the identifiers */
        count = RTS_COUNT(all);
    }
    clear_filters(&BoardCan[index]);
    for (RTS_UI32 i = 0; i < count; i++)
        set_filter(&BoardCan[index], numbers[filters[i].extended]++, &filters[i]);
    return ERR_OK;
}

/* ---- opening, state ---- */

static bool set_timing(RTS_UI32 index, RTS_UI32 bit_rate)
{
    static const CAN_TIMING_LIMITS limits = {512, 256, 128, 128};
    CAN_TIMING timing;

    if (!CanFindTiming(BoardCan[index].clock_hz, bit_rate, &limits, &timing))
        return false;
    ChipWrite(at(index, NBTP), (timing.jump - 1u) << 25 | (timing.prescaler - 1u) << 16 | (timing.segment1 - 1u) << 8 |
                                   (timing.segment2 - 1u));
    return true;
}

/* The transmitter looks at its own bits at the sample point, after the delay of the transceiver, which it measures. */
static bool set_data_timing(RTS_UI32 index, RTS_UI32 bit_rate)
{
    static const CAN_TIMING_LIMITS limits = {2, 32, 16, 16};
    enum { COMPENSATE = 1 << 23, OFFSET_SHIFT = 8, MAX_OFFSET = 0x7F };
    CAN_TIMING timing;

    if (!CanFindTiming(BoardCan[index].clock_hz, bit_rate, &limits, &timing))
        return false;
    RTS_UI32 offset = (1u + timing.segment1) * timing.prescaler;
    ChipWrite(at(index, DBTP), (RTS_UI32)COMPENSATE | (timing.prescaler - 1u) << 16 | (timing.segment1 - 1u) << 8 |
                                   (timing.segment2 - 1u) << 4 | (timing.jump - 1u));
    ChipWrite(at(index, TDCR), (offset < MAX_OFFSET ? offset : MAX_OFFSET) << OFFSET_SHIFT);
    return true;
}

static void forget(RTS_UI32 index)
{
    ChipWrite(at(index, TXBCR), ALL_BUFFERS);
    controllers[index].tx.count = 0;
}

static bool begin(RTS_UI32 index)
{
    ChipWrite(at(index, CCCR), CCCR_INIT);
    if (!ChipWaitFor(at(index, CCCR), CCCR_INIT, CCCR_INIT))
        return false;
    ChipWrite(at(index, CCCR), CCCR_INIT | CCCR_CHANGE);
    return true;
}

RTS_RESULT SysCanOpen(RTS_UI32 index, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    CONTROLLER *controller = &controllers[index];

    if (index >= BOARD_CAN_COUNT)
        return ERR_DEVICE;
    memset(controller, 0, sizeof(*controller));
    BoardCanStart(index);
    if (!begin(index))
        return ERR_DEVICE;
    controller->bit_rate = bit_rate != 0 ? bit_rate : CAN_BIT_RATE;
    controller->is_fd = CAN_FD && data_bit_rate != 0;
    controller->data_bit_rate = controller->is_fd ? data_bit_rate : 0;
    if (!set_timing(index, controller->bit_rate) || (data_bit_rate != 0 && !controller->is_fd) ||
        (controller->is_fd && !set_data_timing(index, data_bit_rate)))
        return ERR_NOT_SUPPORTED;
    if (controller->is_fd)
        ChipSet(at(index, CCCR), CCCR_FD | CCCR_FAST);
    ChipWrite(at(index, TXBC), TXBC_QUEUE);
    ChipWrite(at(index, TXBTIE), ALL_BUFFERS);
    ChipWrite(at(index, ILS), 0);
    ChipWrite(at(index, ILE), 1);
    ChipWrite(at(index, IE), I_RECEIVED | I_SENT | I_LOST0 | I_LOST1);
    ChipWrite(at(index, RXGFC), RXGFC_REJECT_OTHERS | (RTS_UI32)MAX_STANDARD << RXGFC_STANDARD_SHIFT |
                                    (RTS_UI32)MAX_EXTENDED << RXGFC_EXTENDED_SHIFT);
    clear_filters(&BoardCan[index]);
    controller->is_open = true;
    ChipClear(at(index, CCCR), CCCR_INIT);
    return ERR_OK;
}

void SysCanClose(RTS_UI32 index)
{
    ChipWrite(at(index, IE), 0);
    ChipWrite(at(index, CCCR), CCCR_INIT);
    controllers[index].is_open = false;
}

bool SysCanIsFd(RTS_UI32 index)
{
    return controllers[index].is_fd;
}

static CAN_BUS_STATE state_of(RTS_UI32 status)
{
    if ((status & PSR_OFF) != 0)
        return CAN_BUS_OFF;
    if ((status & PSR_PASSIVE) != 0)
        return CAN_BUS_PASSIVE;
    return (status & PSR_WARNING) != 0 ? CAN_BUS_WARNING : CAN_BUS_ACTIVE;
}

void SysCanGetState(RTS_UI32 index, CAN_STATE *state)
{
    CONTROLLER *controller = &controllers[index];

    memset(state, 0, sizeof(*state));
    if (!controller->is_open)
        return;
    RTS_UI32 errors = ChipRead(at(index, ECR));
    state->bus = state_of(ChipRead(at(index, PSR)));
    state->bit_rate = controller->bit_rate;
    state->data_bit_rate = controller->data_bit_rate;
    state->tx_errors = state->bus == CAN_BUS_OFF ? MAX_ERRORS : errors & ECR_TX;
    state->rx_errors = errors >> ECR_RX_SHIFT & ECR_RX;
    state->lost = controller->rx.lost + controller->overruns;
}

/* The chip has gone into the initialisation by itself; leaving it begins the recovery. */
void SysCanRestart(RTS_UI32 index)
{
    if (!controllers[index].is_open || (ChipRead(at(index, PSR)) & PSR_OFF) == 0)
        return;
    forget(index);
    ChipClear(at(index, CCCR), CCCR_INIT);
}
