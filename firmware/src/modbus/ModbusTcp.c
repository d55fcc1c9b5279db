/*
 * ModbusTcp.c - frames of Modbus on a TCP connection.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusTcp.h"

#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "rts_config.h"

enum {
    NS_PER_MS = 1000000,
    LENGTH_MIN = 2,
    LENGTH_MAX = 1 + MODBUS_MAX_PDU,
    RTU_ROOM = MODBUS_FRAME_SIZE - MODBUS_AT_UNIT,
};

static const RTS_I64 LONG_AGO_NS = -(RTS_I64)MODBUS_RECONNECT_MS * NS_PER_MS;

static const MODBUS_LINK_TYPE of_client = {ModbusTcpReady,  ModbusTcpReceive, ModbusTcpSend,
                                           ModbusTcpGiveUp, ModbusTcpClose,   false};
static const MODBUS_LINK_TYPE of_server = {ModbusTcpReady, ModbusTcpReceive, ModbusTcpSend,
                                           ModbusTcpClose, ModbusTcpClose,   false};

static RTS_UI32 receive_rtu(MODBUS_LINK *link, RTS_I64 now_ns);
static void send_rtu(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns);

static const MODBUS_LINK_TYPE of_rtu_client = {ModbusTcpReady,  receive_rtu,    send_rtu,
                                               ModbusTcpGiveUp, ModbusTcpClose, true};

static bool is_open(const MODBUS_LINK *link)
{
    return link->handle != RTS_INVALID_HANDLE;
}

/* Where what is on the wire begins in the buffer. */
static RTS_UI8 *frame_of(MODBUS_LINK *link)
{
    return link->frame + (link->type == &of_rtu_client ? MODBUS_AT_UNIT : 0);
}

/* ---- connections ---- */

static void begin(MODBUS_LINK *link, RTS_HANDLE socket, RTS_I64 now_ns)
{
    link->handle = socket;
    link->sending = false;
    link->connecting = false;
    link->fill = 0;
    link->accepted = false;
    link->replied = false;
    link->began_ns = link->moved_ns = now_ns;
}

void ModbusTcpBeginServer(MODBUS_LINK *link, RTS_HANDLE socket, RTS_I64 now_ns)
{
    link->type = &of_server;
    begin(link, socket, now_ns);
}

void ModbusTcpBeginClient(MODBUS_LINK *link, const SOCKADDRESS *peer)
{
    link->type = &of_client;
    begin(link, RTS_INVALID_HANDLE, LONG_AGO_NS);
    link->failed_ns = LONG_AGO_NS;
    link->breaks = 0;
    link->closings = 0;
    link->peer = *peer;
#if SYSSOCK_NAMES
    link->host = NULL;
    link->lookup = ERR_OK;
#endif
}

void ModbusTcpBeginRtuClient(MODBUS_LINK *link, const SOCKADDRESS *peer)
{
    ModbusTcpBeginClient(link, peer);
    link->type = &of_rtu_client;
}

void ModbusTcpClose(MODBUS_LINK *link)
{
    if (is_open(link) && (link->type != &of_server || link->sending))
        SysSockReset(link->handle);
    else if (is_open(link))
        SysSockClose(link->handle);
    link->handle = RTS_INVALID_HANDLE;
    link->sending = false;
    link->connecting = false;
    link->fill = 0;
}

/* The peer was there, and is connected to again at once. */
void ModbusTcpGiveUp(MODBUS_LINK *link)
{
    ModbusTcpClose(link);
}

/* The connection, or the attempt, has ended, and not because the client gave it up. */
static void fail(MODBUS_LINK *link, RTS_I64 now_ns)
{
    bool is_short = now_ns - link->began_ns < (RTS_I64)MODBUS_SHORT_CONNECTION_MS * NS_PER_MS;

    ModbusTcpClose(link);
    if (!link->replied)
        link->failed_ns = link->began_ns;
    else if (!is_short)
        link->closings = 0;
    else if (link->closings <= MODBUS_CLOSINGS)
        link->closings++;
    if (!link->replied || link->closings <= MODBUS_CLOSINGS)
        link->breaks++;
}

#if SYSSOCK_NAMES
void ModbusTcpSetHost(MODBUS_LINK *link, const char *host)
{
    link->host = host;
}

const char *ModbusTcpExplainName(const MODBUS_LINK *link)
{
    switch (link->lookup) {
    case ERR_NO_OBJECT:
        return "its host name is not known";
    case ERR_TIMEOUT:
    case ERR_NOT_READY_YET:
        return "no name server replies";
    default:
        return NULL;
    }
}

static RTS_HANDLE open_socket(const MODBUS_LINK *link)
{
    return link->host != NULL ? SysSockConnectName(link->host, link->peer.port) : SysSockConnect(&link->peer);
}

/* A name server takes its time, for which the connection is not to blame. */
static void note_lookup(MODBUS_LINK *link, RTS_RESULT result, RTS_I64 now_ns)
{
    link->lookup = result;
    if (result == ERR_NOT_READY_YET)
        link->began_ns = now_ns;
}
#else
const char *ModbusTcpExplainName(const MODBUS_LINK *link)
{
    RTS_UNUSED(link);
    return NULL;
}

static RTS_HANDLE open_socket(const MODBUS_LINK *link)
{
    return SysSockConnect(&link->peer);
}

static void note_lookup(MODBUS_LINK *link, RTS_RESULT result, RTS_I64 now_ns)
{
    RTS_UNUSED(link);
    RTS_UNUSED(result);
    RTS_UNUSED(now_ns);
}
#endif

static void connect_again(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (now_ns - link->failed_ns < (RTS_I64)MODBUS_RECONNECT_MS * NS_PER_MS)
        return;
    begin(link, open_socket(link), now_ns);
    link->connecting = is_open(link);
    if (!is_open(link))
        fail(link, now_ns);
}

static void look_at_connecting(MODBUS_LINK *link, RTS_I64 now_ns)
{
    RTS_RESULT result = SysSockGetConnected(link->handle);

    note_lookup(link, result, now_ns);
    link->accepted = result == ERR_OK;
    if (result == ERR_OK)
        link->connecting = false;
    else if ((result != ERR_PENDING && result != ERR_NOT_READY_YET) ||
             now_ns - link->began_ns >= (RTS_I64)MODBUS_CONNECT_MS * NS_PER_MS)
        fail(link, now_ns);
}

bool ModbusTcpReady(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (!is_open(link))
        connect_again(link, now_ns);
    if (link->connecting)
        look_at_connecting(link, now_ns);
    return is_open(link) && !link->connecting && !link->sending;
}

/* ---- sending ---- */

static void transmit(MODBUS_LINK *link, RTS_I64 now_ns)
{
    RTS_UI32 taken;

    if (SysSockSend(link->handle, frame_of(link) + link->sent, (RTS_UI32)link->fill - link->sent, &taken) != ERR_OK) {
        fail(link, now_ns);
        return;
    }
    if (taken != 0)
        link->moved_ns = now_ns;
    link->sent = (RTS_UI16)(link->sent + taken);
    if (link->sent < link->fill)
        return;
    link->sending = false;
    link->fill = 0;
}

void ModbusTcpSend(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns)
{
    ModbusPut16(link->frame + MODBUS_AT_PROTOCOL, 0);
    ModbusPut16(link->frame + MODBUS_AT_LENGTH, 1 + pdu_size);
    link->fill = (RTS_UI16)(MODBUS_AT_PDU + pdu_size);
    link->sent = 0;
    link->sending = true;
    transmit(link, now_ns);
}

/* ---- receiving ---- */

static RTS_UI32 length_of(const MODBUS_LINK *link)
{
    return ModbusGet16(link->frame + MODBUS_AT_LENGTH);
}

/* Reads up to `end` bytes of the frame; true when they are all there. */
static bool has_read(MODBUS_LINK *link, RTS_UI32 end, RTS_I64 now_ns)
{
    RTS_UI32 size;

    if (link->fill >= end)
        return true;
    if (SysSockRecv(link->handle, frame_of(link) + link->fill, end - link->fill, &size) != ERR_OK) {
        fail(link, now_ns);
        return false;
    }
    if (size != 0)
        link->moved_ns = now_ns;
    link->fill = (RTS_UI16)(link->fill + size);
    return link->fill == end;
}

static bool is_header_good(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (ModbusGet16(link->frame + MODBUS_AT_PROTOCOL) == 0 && length_of(link) >= LENGTH_MIN &&
        length_of(link) <= LENGTH_MAX)
        return true;
    link->bad_frames++;
    fail(link, now_ns);
    return false;
}

/* Goes on with what is on its way. True: the connection is there, and nothing is sent on it. */
static bool may_receive(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (link->connecting)
        look_at_connecting(link, now_ns);
    if (!is_open(link) || link->connecting)
        return false;
    if (!link->sending)
        return true;
    transmit(link, now_ns);
    return false;
}

RTS_UI32 ModbusTcpReceive(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (!may_receive(link, now_ns))
        return 0;
    if (!has_read(link, MODBUS_AT_PDU, now_ns) || !is_header_good(link, now_ns) ||
        !has_read(link, MODBUS_AT_UNIT + length_of(link), now_ns))
        return 0;
    link->replied = true;
    return length_of(link) - 1;
}

/* ---- frames of a serial line ---- */

static void send_rtu(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns)
{
    ModbusRtuBeginFrame(link, pdu_size);
    transmit(link, now_ns);
}

static bool has_room(MODBUS_LINK *link)
{
    if (link->looks_for == MODBUS_LOOKS_FOR_REPLY && link->fill < RTU_ROOM)
        return true;
    link->bad_frames += link->fill == RTU_ROOM;
    ModbusLinkDrop(link);
    return link->looks_for == MODBUS_LOOKS_FOR_REPLY;
}

/* What comes while nothing is looked for is dropped. */
static RTS_UI32 receive_rtu(MODBUS_LINK *link, RTS_I64 now_ns)
{
    RTS_UI32 size;

    if (!may_receive(link, now_ns))
        return 0;
    (void)has_read(link, RTU_ROOM, now_ns);
    size = is_open(link) ? ModbusRtuFindFrame(link) : 0;
    if (size != 0)
        link->replied = true;
    else
        (void)has_room(link);
    return size;
}
