/*
 * SimCan.c - a CAN bus on the virtual clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimCan.h"

#include <string.h>

#include "CmpSrvNumbers.h"
#include "SimTimes.h"

#define NS_PER_S 1000000000

enum {
    TAIL_BITS = 13,      /* delimiter, acknowledgement, end, pause */
    ERROR_BITS = 20,     /* of an error frame and the pause after it */
    OFF_BITS = 128 * 11, /* until a node takes part again */
    MAX_BITS = 640,      /* from the start of a frame to its check sum */
    FILTERS = CAN_FILTERS,
    WARNING = 96,
    PASSIVE = 128,
    OFF = 256,
    KNOWN = 2048,
};

typedef struct {
    CAN_FRAME frame[SIM_CAN_QUEUE];
    RTS_UI32 first;
    RTS_UI32 count;
} QUEUE;

typedef struct {
    bool started;
    bool off;
    RTS_I64 back_ns; /* when a node that was off takes part again */
    QUEUE out;
    QUEUE in;
    CAN_FILTER filter[FILTERS];
    RTS_UI32 filters;
    bool filtered;
    RTS_UI32 tx_errors;
    RTS_UI32 rx_errors;
    RTS_UI32 lost;
    RTS_UI32 destroy;
    RTS_UI32 lose_period;
    RTS_UI32 received;
    bool sends;   /* its first frame is on the bus */
    bool refused; /* the last frame that it was to send, for want of room */
} NODE;

static struct {
    RTS_UI32 bit_rate;
    RTS_UI32 data_bit_rate;
    CAN_ADDRESS address;
    PF_CAN_URGENT urgent;
    void (*catch_up)(void);
    RTS_I64 now_ns;
    RTS_I64 end_ns; /* of what is on the bus; NEVER: it is free */
    bool broken;    /* what is on the bus ends with an error */
    RTS_I64 busy_ns;
    RTS_UI32 frames;
    RTS_UI32 count; /* of nodes, up to the last one that was started */
    RTS_UI32 off;   /* nodes that are off, at most */
    NODE node[SIM_CAN_NODES];
} bus;

/* ---- queues ---- */

static bool push(QUEUE *queue, const CAN_FRAME *frame)
{
    if (queue->count == SIM_CAN_QUEUE)
        return false;
    queue->frame[(queue->first + queue->count++) % SIM_CAN_QUEUE] = *frame;
    return true;
}

/* Before the frames of 29 bits; the first `sent` frames are on the bus. */
static bool push_urgent(QUEUE *queue, const CAN_FRAME *frame, RTS_UI32 sent)
{
    RTS_UI32 place = queue->count;

    if (!push(queue, frame))
        return false;
    for (; place > sent; place--) {
        const CAN_FRAME *before = &queue->frame[(queue->first + place - 1) % SIM_CAN_QUEUE];
        if ((before->flags & CAN_FLAG_EXTENDED) == 0)
            break;
        queue->frame[(queue->first + place) % SIM_CAN_QUEUE] = *before;
    }
    queue->frame[(queue->first + place) % SIM_CAN_QUEUE] = *frame;
    return true;
}

static const CAN_FRAME *peek(const QUEUE *queue)
{
    return &queue->frame[queue->first];
}

static void drop(QUEUE *queue)
{
    queue->first = (queue->first + 1) % SIM_CAN_QUEUE;
    queue->count--;
}

/* ---- the time of a frame ---- */

/* Bits in the order of the bus, with their check sum and those that were stuffed. */
typedef struct {
    RTS_UI32 crc;
    RTS_UI32 run; /* equal bits up to here */
    RTS_UI32 last;
    RTS_UI32 stuffed;
    RTS_UI32 bits;
} BITS;

static void put_bit(BITS *bits, RTS_UI32 bit)
{
    RTS_UI32 next = bit ^ (bits->crc >> 14 & 1);

    bits->crc = (bits->crc << 1 & 0x7FFF) ^ (next != 0 ? 0x4599 : 0);
    bits->run = bits->bits != 0 && bit == bits->last ? bits->run + 1 : 1;
    bits->last = bit;
    bits->bits++;
    if (bits->run == 5) {
        bits->stuffed++;
        bits->last = !bit;
        bits->run = 1;
    }
}

static void put(BITS *bits, RTS_UI32 value, RTS_UI32 count)
{
    while (count-- > 0)
        put_bit(bits, value >> count & 1);
}

static RTS_UI32 length_code(RTS_UI32 size)
{
    static const RTS_UI8 sizes[] = {12, 16, 20, 24, 32, 48, 64};
    RTS_UI32 code = size < CAN_CLASSIC_SIZE ? size : CAN_CLASSIC_SIZE;

    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes) && size > CAN_CLASSIC_SIZE; i++)
        if (size == sizes[i])
            code = CAN_CLASSIC_SIZE + 1 + i;
    return code;
}

/* From the start of the frame to its control bits; BRS is the last one of an FD frame that has the bit rate of
 * arbitration. */
static void put_head(BITS *bits, const CAN_FRAME *frame)
{
    RTS_UI32 remote = (frame->flags & CAN_FLAG_REMOTE) != 0;
    RTS_UI32 fd = (frame->flags & CAN_FLAG_FD) != 0;

    put(bits, 0, 1);
    if ((frame->flags & CAN_FLAG_EXTENDED) != 0) {
        put(bits, frame->id >> 18, 11);
        put(bits, 3, 2);
        put(bits, frame->id, 18);
        put(bits, remote, 1);
        put(bits, fd, 1);
        put(bits, 0, 1);
    } else {
        put(bits, frame->id, 11);
        put(bits, remote, 1);
        put(bits, 0, 1);
        put(bits, fd, 1);
        put(bits, 0, fd);
    }
    if (fd)
        put(bits, (frame->flags & CAN_FLAG_FAST) != 0, 1);
}

static void put_body(BITS *bits, const CAN_FRAME *frame)
{
    put(bits, 0, (frame->flags & CAN_FLAG_FD) != 0); /* ESI */
    put(bits, length_code(frame->size), 4);
    for (RTS_UI32 i = 0; i < frame->size && (frame->flags & CAN_FLAG_REMOTE) == 0; i++)
        put(bits, frame->data[i], 8);
    if ((frame->flags & CAN_FLAG_FD) == 0)
        put(bits, bits->crc, 15);
}

static RTS_I64 bits_ns(RTS_UI32 bits, RTS_UI32 bit_rate)
{
    return (RTS_I64)bits * NS_PER_S / bit_rate;
}

static RTS_I64 count_frame_ns(const CAN_FRAME *frame)
{
    BITS bits = {0, 0, 0, 0, 0};
    bool fd = (frame->flags & CAN_FLAG_FD) != 0;
    bool fast = (frame->flags & CAN_FLAG_FAST) != 0;

    put_head(&bits, frame);
    RTS_UI32 slow = bits.bits + bits.stuffed;
    put_body(&bits, frame);
    RTS_UI32 body = bits.bits + bits.stuffed - slow;
    if (fd) /* count of stuffed bits, check sum, the bits that are always stuffed there */
        body += frame->size <= 16 ? 27 : 32;
    return bits_ns(slow + TAIL_BITS, bus.bit_rate) + bits_ns(body, fast ? bus.data_bit_rate : bus.bit_rate);
}

/* The last classic frame of an identifier, since most frames have the same data as the previous one. */
static struct {
    CAN_FRAME frame;
    RTS_I64 ns; /* 0: unknown */
} known[KNOWN];

static bool is_same(const CAN_FRAME *a, const CAN_FRAME *b)
{
    return a->flags == b->flags && a->size == b->size && memcmp(a->data, b->data, a->size) == 0;
}

RTS_I64 SimCanFrameNs(const CAN_FRAME *frame)
{
    RTS_UI32 place = frame->id % KNOWN;

    if (known[place].ns == 0 || known[place].frame.id != frame->id || !is_same(&known[place].frame, frame)) {
        known[place].frame = *frame;
        known[place].ns = count_frame_ns(frame);
    }
    return known[place].ns;
}

/* ---- the bus ---- */

static bool takes_part(const NODE *node)
{
    return node->started && !node->off;
}

/* What decides between frames that start together, the highest bit first: identifier, SRR or RTR, IDE, identifier. */
static RTS_UI32 arbitration_key(const CAN_FRAME *frame)
{
    RTS_UI32 remote = (frame->flags & CAN_FLAG_REMOTE) != 0;

    if ((frame->flags & CAN_FLAG_EXTENDED) == 0)
        return frame->id << 21 | remote << 20;
    return frame->id >> 18 << 21 | 1u << 20 | 1u << 19 | (frame->id & 0x3FFFF) << 1 | remote;
}

static bool wants_to_send(const NODE *node)
{
    return takes_part(node) && node->out.count != 0;
}

/* The node whose frame goes first; NULL when none has one. */
static NODE *find_winner(void)
{
    NODE *winner = NULL;

    for (NODE *node = bus.node; node < bus.node + bus.count; node++)
        if (wants_to_send(node) &&
            (winner == NULL || arbitration_key(peek(&node->out)) < arbitration_key(peek(&winner->out))))
            winner = node;
    return winner;
}

static void start_frame(void)
{
    const NODE *winner = find_winner();

    if (winner == NULL)
        return;
    const CAN_FRAME *frame = peek(&winner->out);
    RTS_I64 takes = SimCanFrameNs(frame);
    bus.broken = false;
    for (NODE *node = bus.node; node < bus.node + bus.count; node++) {
        node->sends = wants_to_send(node) && arbitration_key(peek(&node->out)) == arbitration_key(frame);
        if (node->sends && (node->destroy != 0 || !is_same(peek(&node->out), frame)))
            bus.broken = true;
        if (node->sends && node->destroy != 0)
            node->destroy--;
    }
    if (bus.broken)
        takes = takes / 2 + bits_ns(ERROR_BITS, bus.bit_rate);
    bus.end_ns = bus.now_ns + takes;
    bus.busy_ns += takes;
}

static void count_error(NODE *node, RTS_UI32 *counter, RTS_UI32 by)
{
    *counter += by;
    if (counter == &node->rx_errors && *counter > PASSIVE)
        *counter = PASSIVE;
    if (node->tx_errors >= OFF) {
        node->off = true;
        node->back_ns = NEVER;
        bus.off++;
    }
}

static void count_success(RTS_UI32 *counter)
{
    if (*counter != 0)
        --*counter;
}

/* At the end of the frame. */
static bool take_urgent(const NODE *node, const CAN_FRAME *frame)
{
    return node == &bus.node[SIM_CAN_DEVICE] && bus.urgent != NULL && (frame->flags & CAN_FLAG_EXTENDED) == 0 &&
           bus.urgent(0, frame);
}

static void deliver(NODE *node, const CAN_FRAME *frame)
{
    CAN_FRAME stamped = *frame;

    count_success(&node->rx_errors);
    if (node->filtered && !CanPasses(node->filter, node->filters, frame))
        return;
    stamped.time_us = (RTS_UI32)(bus.now_ns / 1000);
    node->received++;
    bool loses = node->lose_period != 0 && node->received % node->lose_period == 0;
    if (!loses && take_urgent(node, &stamped))
        return;
    if (loses || !push(&node->in, &stamped))
        node->lost++;
}

/* A frame without another node to acknowledge it is an error, which alone takes no node off the bus. */
static bool is_acknowledged(void)
{
    for (const NODE *node = bus.node; node < bus.node + bus.count; node++)
        if (takes_part(node) && !node->sends)
            return true;
    return false;
}

static void end_with_error(bool acknowledged)
{
    for (NODE *node = bus.node; node < bus.node + bus.count; node++) {
        if (!takes_part(node))
            continue;
        if (!node->sends)
            count_error(node, &node->rx_errors, 1);
        else if (acknowledged || node->tx_errors < PASSIVE)
            count_error(node, &node->tx_errors, 8);
        node->sends = false;
    }
}

static void end_frame(void)
{
    CAN_FRAME frame = {.size = 0};

    bus.end_ns = NEVER;
    if (bus.broken || !is_acknowledged()) {
        end_with_error(bus.broken);
        return;
    }
    bus.frames++;
    for (NODE *node = bus.node; node < bus.node + bus.count; node++) {
        if (takes_part(node) && node->sends) {
            frame = *peek(&node->out);
            drop(&node->out);
            count_success(&node->tx_errors);
        }
    }
    for (NODE *node = bus.node; node < bus.node + bus.count; node++) {
        if (takes_part(node) && !node->sends)
            deliver(node, &frame);
        node->sends = false;
    }
}

static void bring_back(void)
{
    for (NODE *node = bus.node; node < bus.node + bus.count && bus.off != 0; node++) {
        if (node->off && node->back_ns <= bus.now_ns) {
            node->off = false;
            bus.off--;
            node->tx_errors = 0;
            node->rx_errors = 0;
        }
    }
}

static RTS_I64 next_back(void)
{
    RTS_I64 next = NEVER;

    for (const NODE *node = bus.node; node < bus.node + bus.count && bus.off != 0; node++)
        if (node->off && node->back_ns < next)
            next = node->back_ns;
    return next;
}

RTS_I64 SimCanNext(void)
{
    RTS_I64 back = next_back();

    if (bus.end_ns == NEVER)
        start_frame();
    return back < bus.end_ns ? back : bus.end_ns;
}

void SimCanAdvance(RTS_I64 to_ns)
{
    RTS_I64 next;

    while ((next = SimCanNext()) <= to_ns) {
        bus.now_ns = next;
        bring_back();
        if (bus.end_ns <= next)
            end_frame();
    }
    if (to_ns > bus.now_ns)
        bus.now_ns = to_ns;
}

RTS_I64 SimCanNow(void)
{
    return bus.now_ns;
}

RTS_I64 SimCanBusyNs(void)
{
    return bus.busy_ns;
}

RTS_UI32 SimCanFrames(void)
{
    return bus.frames;
}

void SimCanReset(RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    memset(&bus, 0, sizeof(bus));
    memset(known, 0, sizeof(known));
    bus.bit_rate = bit_rate;
    bus.data_bit_rate = data_bit_rate;
    bus.end_ns = NEVER;
    bus.address = (CAN_ADDRESS){CAN_ID_BASE, 1};
}

void SimCanSetClock(void (*catch_up)(void))
{
    bus.catch_up = catch_up;
}

void SimCanSetAddress(RTS_UI32 node, RTS_UI32 base)
{
    bus.address = (CAN_ADDRESS){base, node};
}

/* ---- nodes ---- */

void SimCanStart(RTS_UI32 node)
{
    bus.node[node].started = true;
    if (bus.count <= node)
        bus.count = node + 1;
}

/* A frame that is on the bus is not finished: no node gets it. */
void SimCanStop(RTS_UI32 node)
{
    NODE *stopped = &bus.node[node];

    if (stopped->sends)
        bus.broken = true;
    memset(stopped, 0, sizeof(*stopped));
}

RTS_RESULT SimCanSetFilters(RTS_UI32 node, const CAN_FILTER *filters, RTS_UI32 count)
{
    NODE *set = &bus.node[node];

    if (count > FILTERS)
        return ERR_NOMEMORY;
    for (RTS_UI32 i = 0; i < count; i++)
        set->filter[i] = filters[i];
    set->filters = count;
    set->filtered = true;
    return ERR_OK;
}

RTS_RESULT SimCanSend(RTS_UI32 node, const CAN_FRAME *frame)
{
    if (!CanIsFrame(frame) || ((frame->flags & CAN_FLAG_FD) != 0 && bus.data_bit_rate == 0))
        return ERR_PARAMETER;
    if (!takes_part(&bus.node[node]))
        return ERR_DEVICE;
    QUEUE *out = &bus.node[node].out;
    bool is_urgent = (frame->flags & CAN_FLAG_EXTENDED) == 0;
    bool fits = is_urgent ? push_urgent(out, frame, bus.node[node].sends) : push(out, frame);
    bus.node[node].refused = !fits;
    return fits ? ERR_OK : ERR_NOBUFFER;
}

RTS_RESULT SimCanReceive(RTS_UI32 node, CAN_FRAME *frame)
{
    QUEUE *in = &bus.node[node].in;

    if (in->count == 0)
        return ERR_NOTHING_TO_DO;
    *frame = *peek(in);
    drop(in);
    return ERR_OK;
}

bool SimCanHasWork(RTS_UI32 node)
{
    const NODE *asked = &bus.node[node];

    return asked->in.count != 0 || (asked->refused && asked->out.count < SIM_CAN_QUEUE);
}

static CAN_BUS_STATE state_of(const NODE *node)
{
    RTS_UI32 worst = node->tx_errors > node->rx_errors ? node->tx_errors : node->rx_errors;

    if (!node->started)
        return CAN_BUS_STOPPED;
    if (node->off)
        return CAN_BUS_OFF;
    if (worst >= PASSIVE)
        return CAN_BUS_PASSIVE;
    return worst >= WARNING ? CAN_BUS_WARNING : CAN_BUS_ACTIVE;
}

void SimCanGetState(RTS_UI32 node, CAN_STATE *state)
{
    const NODE *asked = &bus.node[node];

    *state =
        (CAN_STATE){state_of(asked), bus.bit_rate, bus.data_bit_rate, asked->tx_errors, asked->rx_errors, asked->lost};
}

void SimCanRestart(RTS_UI32 node)
{
    NODE *off = &bus.node[node];

    if (!off->off || off->back_ns != NEVER)
        return;
    off->out.count = 0;
    off->back_ns = bus.now_ns + bits_ns(OFF_BITS, bus.bit_rate);
}

void SimCanDestroy(RTS_UI32 node, RTS_UI32 count)
{
    bus.node[node].destroy = count;
}

void SimCanLose(RTS_UI32 node, RTS_UI32 period)
{
    bus.node[node].lose_period = period;
}

/* ---- SysCan.h: node 0 ---- */

RTS_UI32 SysCanGetCount(void)
{
    return bus.bit_rate != 0;
}

void SysCanGetAddress(RTS_UI32 index, CAN_ADDRESS *address)
{
    RTS_UNUSED(index);
    *address = bus.address;
}

RTS_RESULT SysCanOpen(RTS_UI32 index, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    if (index >= SysCanGetCount())
        return ERR_DEVICE;
    if ((bit_rate != 0 && bit_rate != bus.bit_rate) || (data_bit_rate != 0 && data_bit_rate != bus.data_bit_rate))
        return ERR_NOT_SUPPORTED;
    SimCanStop(SIM_CAN_DEVICE);
    SimCanStart(SIM_CAN_DEVICE);
    return SimCanSetFilters(SIM_CAN_DEVICE, NULL, 0);
}

void SysCanClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
    SimCanStop(SIM_CAN_DEVICE);
}

bool SysCanIsFd(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return CAN_FD && bus.data_bit_rate != 0;
}

RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count)
{
    RTS_UNUSED(index);
    return SimCanSetFilters(SIM_CAN_DEVICE, filters, count);
}

RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    if (bus.catch_up != NULL)
        bus.catch_up();
    return SimCanSend(SIM_CAN_DEVICE, frame);
}

void SysCanSetUrgent(RTS_UI32 index, PF_CAN_URGENT handler)
{
    RTS_UNUSED(index);
    bus.urgent = handler;
}

RTS_RESULT SysCanReceive(RTS_UI32 index, CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    return SimCanReceive(SIM_CAN_DEVICE, frame);
}

void SysCanGetState(RTS_UI32 index, CAN_STATE *state)
{
    RTS_UNUSED(index);
    SimCanGetState(SIM_CAN_DEVICE, state);
}

void SysCanRestart(RTS_UI32 index)
{
    RTS_UNUSED(index);
    SimCanRestart(SIM_CAN_DEVICE);
}
