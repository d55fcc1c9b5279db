/*
 * IecSocket.c - UDP and TCP for programs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecSocket.h"

#if APP_CALLS > 0

#include "CmpAppCalls.h"

enum { VERSION = 0x00010000 };

#if IEC_SOCKETS > 0

#include <string.h>

#include "AppEventIds.h"
#include "AppState.h"
#include "CMUtils.h"
#include "CmpBytes.h"
#include "CmpEventMgr.h"
#include "CmpLog.h"
#include "CmpSrvNumbers.h"
#include "NodeName.h"
#include "SysNet.h"
#include "SysTime.h"

enum {
    SLOTS = 256, /* in a handle: its slot, and how many sockets there were before */
    OPERATION_MASK = 0xFFFF,
    PORT_SHIFT = 16,
    STRANGERS = 16,   /* so many datagrams of peers that the program may not reach are dropped at once */
    REPORT_MS = 1000, /* at most one address in so long is reported */
};

RTS_STATIC_ASSERT(IEC_SOCKETS <= SLOTS, sockets_have_numbers);

/* The last three have no socket of the port. */
typedef enum { CLOSED, UDP, LISTENER, CONNECTION, NEW_DATAGRAM, NEW_STREAM, SHUT } USE;

typedef struct {
    USE use;
    RTS_UI32 handle; /* of the program */
    RTS_HANDLE socket;
    SOCKADDRESS own; /* of a new one for connections */
} OPEN_SOCKET;

static struct {
    RTS_UI32 opened;  /* sockets ever */
    RTS_UI32 session; /* counts how often all of them were closed */
    RTS_UI32 count;   /* of those that are open */
    RTS_UI32 reported_ms;
    OPEN_SOCKET socket[IEC_SOCKETS];
} sockets;

/* ---- open sockets ---- */

static OPEN_SOCKET *find_any(RTS_UI32 handle)
{
    OPEN_SOCKET *found = &sockets.socket[handle % SLOTS % IEC_SOCKETS];

    return found->use != CLOSED && found->handle == handle ? found : NULL;
}

static OPEN_SOCKET *find_closed(void)
{
    for (RTS_UI32 i = 0; i < IEC_SOCKETS; i++) {
        if (sockets.socket[i].use == CLOSED)
            return &sockets.socket[i];
    }
    return NULL;
}

static RTS_UI32 use_socket(OPEN_SOCKET *found, USE use, RTS_HANDLE socket)
{
    found->use = use;
    found->socket = socket;
    found->handle = (++sockets.opened % (UINT32_MAX / SLOTS) + 1) * SLOTS + (RTS_UI32)(found - sockets.socket);
    sockets.count++;
    return found->handle;
}

static void end_socket(OPEN_SOCKET *found, USE use)
{
    if (found->use <= CONNECTION)
        SysNetClose(found->socket);
    found->use = use;
}

static void close_socket(OPEN_SOCKET *found)
{
    end_socket(found, CLOSED);
    sockets.count--;
}

static void close_all(void)
{
    if (sockets.count > 0)
        sockets.session++;
    for (RTS_UI32 i = 0; i < IEC_SOCKETS; i++) {
        if (sockets.socket[i].use != CLOSED)
            close_socket(&sockets.socket[i]);
    }
}

/* ---- addresses ---- */

static SOCKADDRESS address_of(const APP_CALL *call)
{
    return (SOCKADDRESS){call->value, (RTS_UI16)(call->operation >> PORT_SHIFT)};
}

static void report(const SOCKADDRESS *peer)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (sockets.reported_ms != 0 && now_ms - sockets.reported_ms < REPORT_MS)
        return;
    sockets.reported_ms = now_ms | 1;
    LogAdd(CMPID_IecSocket, LOG_WARNING, ERR_NO_ACCESS_RIGHTS,
           "The program may not reach %u.%u.%u.%u port %u: allow it with --net", (unsigned)(peer->ip >> 24),
           (unsigned)(peer->ip >> 16 & 0xFF), (unsigned)(peer->ip >> 8 & 0xFF), (unsigned)(peer->ip & 0xFF),
           peer->port);
}

static bool may_reach(const SOCKADDRESS *peer)
{
    bool may = SysNetMayReach(peer);

    if (!may)
        report(peer);
    return may;
}

/* The port of a peer that calls is one that was free there. */
static bool may_hear(const SOCKADDRESS *peer)
{
    return may_reach(&(SOCKADDRESS){peer->ip, 0});
}

static void put_head(APP_CALL *call, const SOCKADDRESS *peer, RTS_UI32 count)
{
    BytesPut32(call->data, peer->ip);
    BytesPut16(call->data + 4, peer->port);
    call->data[6] = 1;
    call->data[7] = 0;
    call->size = IEC_SOCKET_HEAD + count;
}

/* ---- opening ---- */

static RTS_I32 open_error(RTS_RESULT result, RTS_I32 otherwise)
{
    return result == ERR_NOBUFFER ? IEC_SOCKET_TOO_MANY : otherwise;
}

static RTS_I32 open_socket(APP_CALL *call, SYSNET_KIND kind, USE use, RTS_I32 error)
{
    SOCKADDRESS address = address_of(call);
    OPEN_SOCKET *found = find_closed();
    RTS_HANDLE socket;

    if (found == NULL)
        return IEC_SOCKET_TOO_MANY;
    if (kind == SYSNET_CLIENT && (address.port == 0 || !may_reach(&address)))
        return IEC_SOCKET_INVALID_ADDR;
    RTS_RESULT result = SysNetOpen(kind, &address, &socket);
    if (result != ERR_OK)
        return open_error(result, error);
    call->result = use_socket(found, use, socket);
    return 0;
}

/* Connections of peers that the program may not reach are closed at once. */
static RTS_I32 accept_connection(APP_CALL *call, const OPEN_SOCKET *listener)
{
    OPEN_SOCKET *found = find_closed();
    SOCKADDRESS peer;
    RTS_HANDLE socket;

    if (found == NULL)
        return IEC_SOCKET_TOO_MANY;
    if (SysNetAccept(listener->socket, &peer, &socket) != ERR_OK)
        return 0;
    if (!may_hear(&peer)) {
        SysNetClose(socket);
        return 0;
    }
    call->result = use_socket(found, CONNECTION, socket);
    put_head(call, &peer, 0);
    return 0;
}

/* ---- UDP ---- */

static RTS_I32 send_to(const APP_CALL *call, const OPEN_SOCKET *found)
{
    SOCKADDRESS peer = address_of(call);

    if (peer.port == 0 || !may_reach(&peer))
        return IEC_SOCKET_INVALID_ADDR;
    RTS_RESULT result = SysNetSendTo(found->socket, call->data, call->size, &peer);
    if (result == ERR_NOBUFFER)
        return APP_CALL_PENDING;
    return result == ERR_OK ? 0 : IEC_SOCKET_UDP_SEND_ERROR;
}

static bool is_peek(const APP_CALL *call)
{
    return address_of(call).port == IEC_SOCKET_PEEK;
}

/* A datagram of a peer that the program may not reach is dropped, also from a call that leaves what it reads. */
static void drop_datagram(const APP_CALL *call, const OPEN_SOCKET *found)
{
    SOCKADDRESS peer;
    RTS_UI32 size;
    RTS_UI8 none;

    if (is_peek(call))
        (void)SysNetRecvFrom(found->socket, &none, 0, &peer, &size);
}

static RTS_RESULT read_datagram(APP_CALL *call, const OPEN_SOCKET *found, RTS_UI32 room, SOCKADDRESS *peer,
                                RTS_UI32 *size)
{
    RTS_UI8 *data = call->data + IEC_SOCKET_HEAD;

    return is_peek(call) ? SysNetPeek(found->socket, data, room, peer, size)
                         : SysNetRecvFrom(found->socket, data, room, peer, size);
}

static RTS_I32 receive(APP_CALL *call, const OPEN_SOCKET *found)
{
    RTS_UI32 room = sizeof call->data - IEC_SOCKET_HEAD;
    RTS_UI32 size = 0;
    SOCKADDRESS peer;

    if (room > call->value)
        room = call->value;
    call->data[6] = 0;
    for (RTS_UI32 i = 0; i < STRANGERS; i++) {
        if (read_datagram(call, found, room, &peer, &size) != ERR_OK)
            return 0;
        if (!may_hear(&peer)) {
            drop_datagram(call, found);
            continue;
        }
        if (size > room)
            return IEC_SOCKET_INVALID_DATASIZE;
        put_head(call, &peer, size);
        call->result = size;
        return 0;
    }
    return 0;
}

/* ---- connections ---- */

/* A connection that is refused is closed: its block has only an error. */
static RTS_I32 get_state(APP_CALL *call, OPEN_SOCKET *found)
{
    RTS_RESULT result = SysNetGetConnected(found->socket);

    call->result = result == ERR_OK;
    if (result == ERR_OK || result == ERR_PENDING)
        return 0;
    close_socket(found);
    return IEC_SOCKET_TCP_CONNECT_ERROR;
}

static RTS_I32 read_data(APP_CALL *call, const OPEN_SOCKET *found)
{
    RTS_UI32 room = call->value < sizeof call->data ? call->value : sizeof call->data;

    if (room == 0) /* else it looks as if the peer had closed the connection */
        return IEC_SOCKET_INVALID_DATASIZE;
    RTS_RESULT result = is_peek(call) ? SysNetPeek(found->socket, call->data, room, NULL, &call->result)
                                      : SysNetRecv(found->socket, call->data, room, &call->result);
    return result == ERR_OK ? 0 : IEC_SOCKET_NO_CONNECTION;
}

static RTS_I32 write_data(APP_CALL *call, const OPEN_SOCKET *found)
{
    RTS_RESULT result = SysNetSend(found->socket, call->data, call->size, &call->result);

    return result == ERR_OK ? 0 : IEC_SOCKET_NO_CONNECTION;
}

/* ---- the steps of Berkeley sockets ---- */

static RTS_I32 create(APP_CALL *call)
{
    OPEN_SOCKET *found = find_closed();

    if (call->value != IEC_SOCKET_STREAM && call->value != IEC_SOCKET_DATAGRAM)
        return IEC_SOCKET_WRONG_PARAMETER;
    if (found == NULL)
        return IEC_SOCKET_TOO_MANY;
    found->own = (SOCKADDRESS){0, 0};
    call->result = use_socket(found, call->value == IEC_SOCKET_STREAM ? NEW_STREAM : NEW_DATAGRAM, RTS_INVALID_HANDLE);
    return 0;
}

static RTS_I32 open_new(OPEN_SOCKET *found, SYSNET_KIND kind, const SOCKADDRESS *address, USE use, RTS_I32 error)
{
    RTS_HANDLE socket;
    RTS_RESULT result = SysNetOpen(kind, address, &socket);

    if (result != ERR_OK)
        return open_error(result, error);
    found->socket = socket;
    found->use = use;
    return 0;
}

static RTS_I32 bind_to(OPEN_SOCKET *found, const SOCKADDRESS *own)
{
    if (found->use == NEW_DATAGRAM)
        return open_new(found, SYSNET_UDP, own, UDP, IEC_SOCKET_UDP_OPEN_ERROR);
    if (found->use != NEW_STREAM)
        return IEC_SOCKET_WRONG_PARAMETER;
    found->own = *own;
    return 0;
}

static RTS_I32 listen_with(OPEN_SOCKET *found)
{
    if (found->use != NEW_STREAM)
        return IEC_SOCKET_WRONG_PARAMETER;
    return open_new(found, SYSNET_LISTENER, &found->own, LISTENER, IEC_SOCKET_TCP_OPEN_ERROR);
}

/* The own address is chosen by the system. */
static RTS_I32 connect_with(OPEN_SOCKET *found, const SOCKADDRESS *peer)
{
    if (found->use == CONNECTION)
        return SysNetGetConnected(found->socket) == ERR_PENDING ? IEC_SOCKET_CONNECTING : IEC_SOCKET_IS_CONNECTED;
    if (found->use != NEW_STREAM)
        return IEC_SOCKET_WRONG_PARAMETER;
    if (peer->port == 0 || !may_reach(peer))
        return IEC_SOCKET_INVALID_ADDR;
    return open_new(found, SYSNET_CLIENT, peer, CONNECTION, IEC_SOCKET_TCP_CONNECT_ERROR);
}

static RTS_I32 poll_any(APP_CALL *call, const OPEN_SOCKET *found)
{
    RTS_UI32 waiting = 0;

    if (found->use <= CONNECTION)
        call->result = SysNetPoll(found->socket, &waiting);
    call->result |= waiting << IEC_SOCKET_WAITING;
    return 0;
}

static RTS_I32 take_step(APP_CALL *call, RTS_UI32 operation)
{
    OPEN_SOCKET *found = find_any(call->handle);
    SOCKADDRESS address = address_of(call);

    if (found == NULL)
        return IEC_SOCKET_INVALID_HANDLE;
    if (operation == IEC_SOCKET_CLOSE) {
        close_socket(found);
        return 0;
    }
    if (found->use == SHUT)
        return IEC_SOCKET_SHUT;
    switch (operation) {
    case IEC_SOCKET_BIND:
        return bind_to(found, &address);
    case IEC_SOCKET_LISTEN:
        return listen_with(found);
    case IEC_SOCKET_CONNECT:
        return connect_with(found, &address);
    case IEC_SOCKET_POLL:
        return poll_any(call, found);
    default:
        end_socket(found, SHUT);
        return 0;
    }
}

/* ---- in main ---- */

static USE use_of(RTS_UI32 operation)
{
    switch (operation) {
    case IEC_SOCKET_SEND_TO:
    case IEC_SOCKET_RECEIVE:
        return UDP;
    case IEC_SOCKET_ACCEPT:
        return LISTENER;
    default:
        return CONNECTION;
    }
}

static RTS_I32 do_with_open(APP_CALL *call, RTS_UI32 operation)
{
    OPEN_SOCKET *found = find_any(call->handle);

    if (found != NULL && found->use == NEW_DATAGRAM && operation == IEC_SOCKET_SEND_TO)
        (void)bind_to(found, &found->own);
    if (found != NULL && found->use == SHUT)
        return IEC_SOCKET_SHUT;
    if (found == NULL || found->use != use_of(operation))
        return IEC_SOCKET_INVALID_HANDLE;
    switch (operation) {
    case IEC_SOCKET_SEND_TO:
        return send_to(call, found);
    case IEC_SOCKET_RECEIVE:
        return receive(call, found);
    case IEC_SOCKET_ACCEPT:
        return accept_connection(call, found);
    case IEC_SOCKET_STATE:
        return get_state(call, found);
    case IEC_SOCKET_READ:
        return read_data(call, found);
    case IEC_SOCKET_WRITE:
        return write_data(call, found);
    default:
        return IEC_SOCKET_WRONG_PARAMETER;
    }
}

/* No block knows the socket that an abandoned call has opened. */
static RTS_I32 undo(const APP_CALL *call, RTS_UI32 operation)
{
    bool opens =
        operation <= IEC_SOCKET_TCP_CONNECT || operation == IEC_SOCKET_ACCEPT || operation == IEC_SOCKET_CREATE;
    OPEN_SOCKET *found = opens ? find_any(call->result) : NULL;

    if (found != NULL)
        close_socket(found);
    return 0;
}

static RTS_I32 get_host_name(APP_CALL *call)
{
    const char *name = NodeNameOf(SysTargetGet());

    call->result = CMUtlStrNLen(name, NS_MAX_NODE_NAME);
    call->size = call->result;
    memcpy(call->data, name, call->result);
    return 0;
}

static RTS_I32 carry_out(APP_CALL *call)
{
    RTS_UI32 operation = call->operation & OPERATION_MASK;

    if (call->error == APP_CALL_ABANDONED)
        return undo(call, operation);
    switch (operation) {
    case IEC_SOCKET_UDP_OPEN:
        return open_socket(call, SYSNET_UDP, UDP, IEC_SOCKET_UDP_OPEN_ERROR);
    case IEC_SOCKET_TCP_LISTEN:
        return open_socket(call, SYSNET_LISTENER, LISTENER, IEC_SOCKET_TCP_OPEN_ERROR);
    case IEC_SOCKET_TCP_CONNECT:
        return open_socket(call, SYSNET_CLIENT, CONNECTION, IEC_SOCKET_TCP_CONNECT_ERROR);
    case IEC_SOCKET_CREATE:
        return create(call);
    case IEC_SOCKET_HOST_NAME:
        return get_host_name(call);
    case IEC_SOCKET_CLOSE:
    case IEC_SOCKET_BIND:
    case IEC_SOCKET_LISTEN:
    case IEC_SOCKET_CONNECT:
    case IEC_SOCKET_POLL:
    case IEC_SOCKET_SHUTDOWN:
        return take_step(call, operation);
    default:
        return do_with_open(call, operation);
    }
}

static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    close_all();
}

/* Sockets end with the program that asks for their data; the calls of a cycle are not to wait for the next pass. */
static void poll_sockets(void)
{
    if (sockets.count == 0)
        return;
    RTS_UI32 state = AppGetState();
    if (state == AS_NONE || state == AS_STOP)
        close_all();
    else
        SysTimeWantPass(1);
}

static RTS_UI32 get_session(void)
{
    return sockets.session;
}

static RTS_RESULT begin(void)
{
    return EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
}

static RTS_RESULT live(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(sockets);
    else if (hook == CH_COMM_CYCLE)
        poll_sockets();
    else if (hook == CH_INIT3)
        return begin();
    return ERR_OK;
}

#else

static RTS_I32 carry_out(APP_CALL *call)
{
    RTS_UNUSED(call);
    return IEC_SOCKET_NO_NETWORK;
}

static RTS_UI32 get_session(void)
{
    return 0;
}

static RTS_RESULT live(CMP_HOOK hook)
{
    RTS_UNUSED(hook);
    return ERR_OK;
}

#endif

/* ---- what the library calls ---- */

static RTS_I32 socket_call(RTS_UI32 operation, RTS_UI32 handle, RTS_UI32 value)
{
    const APP_CALL_ARGUMENTS arguments = {operation, handle, value};

    return AppCallTake(carry_out, &arguments);
}

/* Another number than before: all sockets have been closed since. */
static RTS_UI32 socket_session(void)
{
    return get_session();
}

APP_GATE(socket_call);

static const CMP_EXT_FUNCTION functions[] = {
    {"socket_call", 0x76D446DA, VERSION, (RTS_PFN)APP_GATED(socket_call)}, /* socket_call(UDINT,UDINT,UDINT):DINT */
    {"socket_session", 0xDEA70346, VERSION, (RTS_PFN)socket_session},      /* socket_session():UDINT */
};

RTS_RESULT IecSocket_Hook(CMP_HOOK hook)
{
    RTS_RESULT result = live(hook);

    return hook == CH_INIT3 && result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
