/*
 * CmpBlkDrvCan.c - the CAN block driver: packets over ISO-TP, to several tools at once.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A session is a packet on its way: from a tool, or to one. There are a few of each; between two packets a session belongs
 * to no tool. A tool has one packet on its way in each direction.
 */
#include "CmpBlkDrvCan.h"

#include <string.h>

#include "../can/CanWatch.h"
#include "CmpBytes.h"
#include "CmpCan.h"
#include "CmpLog.h"
#include "CmpPackets.h"
#include "IsoTp.h"
#include "SysCan.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "rts_config.h"

#if COMM_ENDPOINTS /* a port without CAN may compile all of firmware/src */

enum {
    CONTROLLER = 0,
    SCANS = 2, /* requests that wait for their moment */
    FILTERS = 3,
    ROUTER_HEADER_MAX = sizeof(ROUTER_HEADER) + 4 * ROUTER_MAX_ADDRESS + 2,
    /* A packet with the largest message of the channel in one block. No packet is larger, in either direction. */
    MESSAGE_MAX = ROUTER_HEADER_MAX + CHANNEL_FIRST_SIZE + NETSERVER_MESSAGE_SIZE,
    PACKET_MAX = MESSAGE_MAX < BLK_MAX_SIZE ? MESSAGE_MAX : BLK_MAX_SIZE,
    TAKES_MAX = CAN_PACKET_SIZE > BLK_MAX_SIZE ? CAN_PACKET_SIZE : PACKET_MAX,
};

RTS_STATIC_ASSERT(CAN_PACKET_SIZE >= BLK_MAX_SIZE && TAKES_MAX <= (int)ISOTP_MAX_PACKET, a_packet_fits_into_isotp);
RTS_STATIC_ASSERT(NS_REPLY_SIZE + ROUTER_HEADER_MAX <= PACKET_MAX, can_packet_holds_the_name_service_reply);
RTS_STATIC_ASSERT(sizeof(CAN_SCAN) == CAN_CLASSIC_SIZE && sizeof(CAN_CLAIM) == CAN_CLASSIC_SIZE, they_are_frames);

typedef struct {
    RTS_UI8 tool; /* 0: free */
    ISOTP_RX rx;
    RTS_UI8 packet[TAKES_MAX];
} RX_SESSION;

typedef struct {
    RTS_UI8 tool;
    ISOTP_TX tx;
    RTS_UI8 packet[PACKET_MAX];
} TX_SESSION;

/* A request of a tool, for which the moment to answer it has not come. */
typedef struct {
    RTS_UI8 tool; /* 0: none */
    RTS_UI32 due_ms;
    WIRE_UI16 version;
    WIRE_UI32 request_id;
} SCAN_REQUEST;

static struct {
    bool open : 1;
    bool told_same_node : 1;
    bool fd : 1;
    CAN_ADDRESS own;
    BLK_DRV driver;
    SCAN_REQUEST scan[SCANS];
    RX_SESSION rx[CAN_RX_SESSIONS];
    TX_SESSION tx[CAN_TX_SESSIONS];
} can;

/* ---- the controller ---- */

static void take_frame(const CAN_FRAME *frame, RTS_UI32 now_ms);
static void note_off(void);

static void get_filters(CAN_FILTER *filters)
{
    const RTS_UI32 to = CAN_BASE_MASK | (RTS_UI32)CAN_ADDRESS_MASK << CAN_TARGET_SHIFT;

    filters[0] = (CAN_FILTER){can.own.base | can.own.node << CAN_TARGET_SHIFT, to, true};
    filters[1] = (CAN_FILTER){can.own.base | (RTS_UI32)CAN_TO_ALL << CAN_TARGET_SHIFT, to, true};
    filters[2] = (CAN_FILTER){can.own.base | can.own.node, CAN_BASE_MASK | CAN_ADDRESS_MASK, true}; /* its own number */
}

#if CAN_SHARED
static CAN_FILTER own_filters[FILTERS];

static void take_shared(RTS_UI32 index, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UNUSED(index);
    take_frame(frame, now_ms);
}

static void note_bus(RTS_UI32 index, bool off)
{
    RTS_UNUSED(index);
    if (off)
        note_off();
}

static CAN_USER user = {.filters = own_filters, .filter_count = FILTERS, .take = take_shared, .note_bus = note_bus};

static RTS_RESULT open_controller(void)
{
    get_filters(own_filters);
    return CanAttach(CONTROLLER, &user);
}

static void close_controller(void)
{
    CanDetach(CONTROLLER, &user);
}

static RTS_RESULT send(const CAN_FRAME *frame)
{
    return CanSend(CONTROLLER, frame);
}

static bool is_off(void)
{
    return CanIsOff(CONTROLLER);
}

/* CmpCan does both. */
static void receive(void)
{
}

static void watch_bus(RTS_UI32 now_ms)
{
    RTS_UNUSED(now_ms);
}
#else
enum { READ_MAX = 64 }; /* frames per cycle, so that a busy bus does not stop the rest of the runtime */

static CAN_WATCH watch;

static RTS_RESULT open_controller(void)
{
    CAN_FILTER filters[FILTERS];

    CMP_CLEAR(watch);
    get_filters(filters);
    RTS_RESULT result = SysCanOpen(CONTROLLER, 0, 0);
    return result == ERR_OK ? SysCanSetFilters(CONTROLLER, filters, FILTERS) : result;
}

static void close_controller(void)
{
    SysCanClose(CONTROLLER);
}

static RTS_RESULT send(const CAN_FRAME *frame)
{
    return SysCanSend(CONTROLLER, frame);
}

static bool is_off(void)
{
    return watch.off;
}

/* Each frame at its own time: a service that the previous one has completed may take long. */
static void receive(void)
{
    CAN_FRAME frame;

    for (RTS_UI32 i = 0; i < READ_MAX && SysCanReceive(CONTROLLER, &frame) == ERR_OK; i++)
        take_frame(&frame, SysTimeGetMs());
}

static void watch_bus(RTS_UI32 now_ms)
{
    if (CanWatchPoll(&watch, CONTROLLER, CMPID_CmpBlkDrvCan, now_ms) && watch.off)
        note_off();
}
#endif

static CAN_COUNTERS counters;

static const char *const counter_names[] = {
    "packets", "aborted", "too long", "without session", "unsent", "scans", "frames of the same node", "bus off"};
RTS_STATIC_ASSERT(sizeof(CAN_COUNTERS) == sizeof(RTS_UI32) * RTS_COUNT(counter_names), each_counter_has_a_name);
const BLK_COUNTERS BlkDrvCanCounters = {"CAN", counter_names, RTS_COUNT(counter_names), &counters.packets, 1};

#define FOR_EACH_RX(session) for (RX_SESSION *session = can.rx; session < can.rx + CAN_RX_SESSIONS; session++)
#define FOR_EACH_TX(session) for (TX_SESSION *session = can.tx; session < can.tx + CAN_TX_SESSIONS; session++)

/* ---- frames ---- */

static RTS_RESULT send_frame(RTS_UI32 to, const RTS_UI8 *data, RTS_UI32 size)
{
    CAN_FRAME frame;

    frame.id = can.own.base | to << CAN_TARGET_SHIFT | can.own.node;
    frame.flags = CAN_FLAG_EXTENDED | (can.fd ? CAN_FLAG_FD | CAN_FLAG_FAST : 0);
    frame.size = (RTS_UI8)CanRoundSize(size);
    memcpy(frame.data, data, size);
    memset(frame.data + size, 0, frame.size - size);
    return send(&frame);
}

/* ---- receiving packets ---- */

static RX_SESSION *find_rx(RTS_UI32 tool)
{
    FOR_EACH_RX (session)
        if (session->tool == tool)
            return session;
    return NULL;
}

/* What the tool has, or a free one; NULL when there is none. */
static RX_SESSION *claim_rx(RTS_UI32 tool)
{
    RX_SESSION *session = find_rx(tool);

    if (session == NULL)
        session = find_rx(0);
    if (session == NULL)
        return NULL;
    session->tool = (RTS_UI8)tool;
    session->rx.buffer = session->packet;
    session->rx.capacity = sizeof(session->packet);
    session->rx.block_size = CAN_BLOCK_SIZE;
    session->rx.separation = CAN_SEPARATION_MS;
    return session;
}

/* Flow control goes before all else that waits. If there is no room for it now, the next cycle tries again. */
static void send_flow(RX_SESSION *session)
{
    RTS_UI8 flow[ISOTP_FLOW_SIZE];

    if (IsoTpFlow(&session->rx, flow) && send_frame(session->tool, flow, sizeof(flow)) == ERR_OK)
        IsoTpFlowSent(&session->rx);
    if (!IsoTpIsReceiving(&session->rx) && !IsoTpFlow(&session->rx, flow))
        session->tool = 0;
}

static void take_data(RTS_UI32 tool, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    bool starts = IsoTpKind(frame->data, frame->size) != ISOTP_CONSECUTIVE;
    RX_SESSION *session = starts ? claim_rx(tool) : find_rx(tool);
    RTS_UI32 size;

    if (session == NULL) {
        if (starts)
            COMM_COUNT(counters.no_session);
        return;
    }
    switch (IsoTpReceive(&session->rx, frame->data, frame->size, now_ms, &size)) {
    case ISOTP_RX_DONE:
        COMM_COUNT(counters.packets);
        RouterHandleDataFrom(&can.driver, tool, session->packet, size);
        break;
    case ISOTP_RX_ABORTED:
        COMM_COUNT(counters.aborted);
        break;
    case ISOTP_RX_TOO_LONG:
        COMM_COUNT(counters.too_long);
        break;
    default:
        break;
    }
    send_flow(session);
}

static void take_flow(RTS_UI32 tool, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    FOR_EACH_TX (session)
        if (IsoTpIsSending(&session->tx) && session->tool == tool &&
            IsoTpTakeFlow(&session->tx, frame->data, frame->size, now_ms) == ISOTP_TX_FAILED)
            COMM_COUNT(counters.unsent);
}

/* ---- scans ---- */

/* Nodes answer at random moments, so that a tool is not flooded. A tool that asks again has not the patience for more
 * than one reply. */
static void take_scan(RTS_UI32 tool, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    const CAN_SCAN *asked = (const CAN_SCAN *)frame->data;
    SCAN_REQUEST *place = NULL;

    if (frame->size < sizeof(*asked))
        return;
    for (SCAN_REQUEST *scan = can.scan; scan < can.scan + SCANS; scan++)
        if (scan->tool == tool || (scan->tool == 0 && place == NULL))
            place = scan;
    if (place == NULL || place->tool == tool)
        return;
    place->tool = (RTS_UI8)tool;
    place->due_ms = now_ms + SysTargetRandom() % (asked->window * (RTS_UI32)CAN_SCAN_UNIT_MS + 1);
    memcpy(place->version, asked->version, sizeof(place->version));
    memcpy(place->request_id, asked->request_id, sizeof(place->request_id));
}

/* As if the tool had sent the whole packet. */
static void answer_scan(const SCAN_REQUEST *scan)
{
    struct {
        ROUTER_HEADER head;
        RTS_UI8 sender[2];
        NS_REQUEST request;
    } packet = {{ROUTER_MAGIC, ROUTER_HOP_COUNT << ROUTER_HOP_SHIFT | sizeof(ROUTER_HEADER) / 2,
                 ROUTER_PRIO_NORMAL << ROUTER_PRIO_SHIFT, ROUTER_SVC_NAME_REQUEST, 0, 1 << 4},
                {0, scan->tool},
                {{0}, {0}, {0}}};

    BytesPut16(packet.request.type, NS_RESOLVE_ADDRESS);
    memcpy(packet.request.version, scan->version, sizeof(scan->version));
    memcpy(packet.request.request_id, scan->request_id, sizeof(scan->request_id));
    COMM_COUNT(counters.scans);
    RouterHandleDataFrom(&can.driver, scan->tool, (const RTS_UI8 *)&packet, sizeof(packet));
}

static void answer_scans(RTS_UI32 now_ms)
{
    for (SCAN_REQUEST *scan = can.scan; scan < can.scan + SCANS; scan++) {
        if (scan->tool == 0 || (RTS_I32)(now_ms - scan->due_ms) < 0)
            continue;
        answer_scan(scan);
        scan->tool = 0;
    }
}

/* ---- what arrives ---- */

static void notice_same_node(void)
{
    COMM_COUNT(counters.same_node);
    if (!can.told_same_node)
        LogAdd(CMPID_CmpBlkDrvCan, LOG_ERROR, ERR_DUPLICATE, "CAN: another device has the node number %u",
               (unsigned)can.own.node);
    can.told_same_node = true;
}

static void take_isotp(RTS_UI32 tool, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    ISOTP_KIND kind = IsoTpKind(frame->data, frame->size);

    if (kind == ISOTP_FLOW)
        take_flow(tool, frame, now_ms);
    else if (kind != ISOTP_OTHER)
        take_data(tool, frame, now_ms);
}

/* Filters let more pass than is for us. */
static void take_frame(const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 source = frame->id & CAN_ADDRESS_MASK;
    RTS_UI32 target = frame->id >> CAN_TARGET_SHIFT & CAN_ADDRESS_MASK;
    RTS_UI32 base = frame->id & ~(RTS_UI32)(CAN_ADDRESS_MASK << CAN_TARGET_SHIFT | CAN_ADDRESS_MASK);
    RTS_UI8 wanted = frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_REMOTE);

    if (wanted != CAN_FLAG_EXTENDED || base != can.own.base)
        return;
    if (source == can.own.node)
        notice_same_node();
    if (target != can.own.node && target != CAN_TO_ALL)
        return;
    if (source < CAN_TOOL_MIN || source > CAN_TOOL_MAX || frame->size == 0)
        return;
    if (frame->data[0] == CAN_FRAME_SCAN)
        take_scan(source, frame, now_ms);
    else if (target == can.own.node)
        take_isotp(source, frame, now_ms);
}

/* ---- sending packets ---- */

/* A free session; NULL when there is none, or the tool has one. */
static TX_SESSION *claim_tx(RTS_UI32 tool)
{
    TX_SESSION *found = NULL;

    FOR_EACH_TX (session) {
        if (!IsoTpIsSending(&session->tx))
            found = session;
        else if (session->tool == tool)
            return NULL;
    }
    return found;
}

static RTS_UI32 join(RTS_UI8 *packet, const BLK_PART *parts, RTS_UI32 count)
{
    RTS_UI32 size = 0;

    for (RTS_UI32 i = 0; i < count; i++) {
        if (parts[i].size > PACKET_MAX - size)
            return 0;
        memcpy(packet + size, parts[i].data, parts[i].size);
        size += parts[i].size;
    }
    return size;
}

static RTS_RESULT can_send(const ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count)
{
    RTS_UI32 tool = (RTS_UI32)peer->endpoint;
    TX_SESSION *session = claim_tx(tool);

    if (session == NULL || is_off())
        return ERR_NOBUFFER;
    RTS_UI32 size = join(session->packet, parts, count);
    session->tool = (RTS_UI8)tool;
    return IsoTpStart(&session->tx, session->packet, size, can.fd ? CAN_FD_SIZE : CAN_CLASSIC_SIZE, SysTimeGetMs());
}

/* One frame of a session; false when there is none now, or no room for it. */
static bool send_next(TX_SESSION *session, RTS_UI32 now_ms)
{
    RTS_UI8 frame[ISOTP_MAX_FRAME];
    RTS_UI32 size = IsoTpNext(&session->tx, frame, now_ms);

    if (size == 0 || send_frame(session->tool, frame, size) != ERR_OK)
        return false;
    IsoTpSent(&session->tx, now_ms);
    return true;
}

/* In turn, so that a long packet does not keep others waiting. */
static void transmit(RTS_UI32 now_ms)
{
    bool more = true;

    while (more) {
        more = false;
        FOR_EACH_TX (session)
            more = send_next(session, now_ms) || more;
    }
}

/* ---- time ---- */

static void expire(RTS_UI32 now_ms)
{
    FOR_EACH_RX (session) {
        if (IsoTpReceiveExpired(&session->rx, now_ms))
            COMM_COUNT(counters.aborted);
        if (session->tool != 0)
            send_flow(session);
    }
    FOR_EACH_TX (session) {
        if (IsoTpIsUnheard(&session->tx, now_ms))
            RouterUnreachable(&can.driver, session->tool);
        if (IsoTpSendExpired(&session->tx, now_ms))
            COMM_COUNT(counters.unsent);
    }
}

static void forget_packets(void)
{
    memset(can.scan, 0, sizeof(can.scan));
    memset(can.rx, 0, sizeof(can.rx));
    memset(can.tx, 0, sizeof(can.tx));
}

static void note_off(void)
{
    COMM_COUNT(counters.bus_off);
    forget_packets();
}

static void cycle(void)
{
    if (!can.open)
        return;
    receive();
    RTS_UI32 now_ms = SysTimeGetMs();
    expire(now_ms);
    answer_scans(now_ms);
    transmit(now_ms);
    watch_bus(now_ms);
}

/* ---- life ---- */

/* Says what is not. */
static bool is_address_possible(const CAN_ADDRESS *address)
{
    if (address->node > CAN_NODE_MAX)
        LogAdd(CMPID_CmpBlkDrvCan, LOG_ERROR, ERR_OUT_OF_LIMITS, "CAN is off: node %u is not 1 to %u",
               (unsigned)address->node, (unsigned)CAN_NODE_MAX);
    else if ((address->base & ~(RTS_UI32)CAN_BASE_MASK) != 0)
        LogAdd(CMPID_CmpBlkDrvCan, LOG_ERROR, ERR_OUT_OF_LIMITS,
               "CAN is off: base 0x%X lacks its 16 zeros, or is above 29 bits", (unsigned)address->base);
    else
        return true;
    return false;
}

#if COMM_HOST_CHANNELS
/* The tool, whatever addresses its packets have. On which machine it runs is not known. */
static RTS_UI32 host_of(const ROUTER_PEER *peer)
{
    return (RTS_UI32)peer->endpoint;
}
#endif

static void open_bus(void)
{
    CMP_CLEAR(can);
    if (SysCanGetCount() == 0)
        return;
    SysCanGetAddress(CONTROLLER, &can.own);
    if (can.own.node == 0 || !is_address_possible(&can.own))
        return;
    can.driver.type = BLK_DRV_TYPE_CAN;
    can.driver.point_to_point = 1;
    can.driver.address_words = 1;
    can.driver.address[1] = (RTS_UI8)can.own.node;
#if BLK_LONG_PACKETS
    can.driver.takes = CAN_PACKET_SIZE;
#endif
    can.driver.send = can_send;
#if COMM_HOST_CHANNELS
    can.driver.host_of = host_of;
#endif
    RTS_RESULT result = open_controller();
    can.open = result == ERR_OK;
    can.fd = can.open && SysCanIsFd(CONTROLLER);
    if (!can.open)
        LogAdd(CMPID_CmpBlkDrvCan, LOG_ERROR, result, "The CAN controller cannot be opened");
}

static void close_bus(void)
{
    if (can.open) {
        transmit(SysTimeGetMs());
        close_controller();
    }
    can.open = false;
}

const CAN_COUNTERS *BlkDrvCanGetCounters(void)
{
    return &counters;
}

RTS_RESULT CmpBlkDrvCan_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT && COMM_COUNTERS)
        CMP_CLEAR(counters);
    else if (hook == CH_INIT3) /* before an application can take the line */
        open_bus();
    else if (hook == CH_COMM_CYCLE)
        cycle();
    else if (hook == CH_EXIT3) /* not CH_EXIT_COMM: there the channel server takes leave */
        close_bus();
    return ERR_OK;
}

#endif
