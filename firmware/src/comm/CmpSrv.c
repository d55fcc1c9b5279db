/*
 * CmpSrv.c - layer 7: headers, sessions, dispatch to the services.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpSrv.h"

#include <string.h>

#include "AppPassword.h"
#include "CmpBytes.h"
#include "CmpLog.h"
#include "CmpPackets.h"
#include "SysTarget.h"
#include "rts_config.h"

/* The validation bit, set in every session id we give. */
#define SESSION_VALID 0x80000000u

/* ---- session ---- */

static bool is_session(const COMM_CLIENT *client, RTS_UI32 id)
{
    return id != 0 && id == client->session.id;
}

RTS_UI32 SrvCreateSession(COMM_CLIENT *client)
{
    SrvEndSession(client);
    client->session.id = SysTargetRandom() | SESSION_VALID;
    return client->session.id;
}

RTS_UI32 SrvLogin(COMM_CLIENT *client, RTS_UI32 id)
{
    if (!is_session(client, id))
        SrvCreateSession(client);
    client->session.rights = RIGHT_ALL;
    return client->session.id;
}

RTS_RESULT SrvLogout(COMM_CLIENT *client, RTS_UI32 id)
{
    if (!is_session(client, id))
        return ERR_INVALID_SESSION_ID;
    SrvEndSession(client);
    return ERR_OK;
}

bool SrvIsLoggedIn(const COMM_CLIENT *client)
{
    return client->session.rights != RIGHT_NONE;
}

void SrvEndSession(COMM_CLIENT *client)
{
    memset(&client->session, 0, sizeof(client->session));
}

RTS_UI32 SrvCreateAppSession(COMM_CLIENT *client)
{
    client->session.app_session = SysTargetRandom() | 1;
    return client->session.app_session;
}

bool SrvIsAppSession(const COMM_CLIENT *client, RTS_UI32 id)
{
    return id != 0 && id == client->session.app_session;
}

void SrvEndAppSession(COMM_CLIENT *client)
{
    client->session.app_session = 0;
}

/* ---- dispatch ---- */

RTS_RESULT SrvRegisterGroup(RTS_UI16 group, const SRV_SERVICE *services, RTS_SIZE count)
{
    SRV_GROUP *place;

    for (place = srv_groups; place < srv_groups + srv_group_room; place++) {
        if (place->services == NULL) {
            *place = (SRV_GROUP){services, count, group};
            return ERR_OK;
        }
    }
    return CMNoRoom(SRV_OWN_GROUPS);
}

static const SRV_GROUP *find_group(RTS_UI16 group)
{
    const SRV_GROUP *place;

    for (place = srv_groups; place < srv_groups + srv_group_room; place++)
        if (place->group == group && place->services != NULL)
            return place;
    return NULL;
}

static const SRV_SERVICE *find_service(const SRV_GROUP *group, RTS_UI16 service)
{
    for (RTS_SIZE i = 0; i < group->count; i++)
        if (group->services[i].service == service)
            return &group->services[i];
    return NULL;
}

static RTS_RESULT check_right(const SRV_SERVICE *service, const SRV_REQUEST *request)
{
    if (service->right == RIGHT_NONE || (service->right == RIGHT_STATE && !AppHasPassword()))
        return ERR_OK;
    if (!is_session(request->client, request->session))
        return ERR_INVALID_SESSION_ID;
    return (request->client->session.rights & service->right) != 0 ? ERR_OK : ERR_NO_ACCESS_RIGHTS;
}

static RTS_RESULT dispatch(RTS_UI16 group_id, RTS_UI16 service_id, SRV_REQUEST *request, BTAG_WRITER *reply)
{
    const SRV_GROUP *group = find_group(group_id);

    if (group == NULL)
        return ERR_L7_UNKNOWNCMDGROUP;
    const SRV_SERVICE *service = find_service(group, service_id);
    if (service == NULL)
        return ERR_L7_UNKNOWNCMD;
    RTS_RESULT result = check_right(service, request);
    if (result == ERR_OK)
        result = service->handler(request, reply);
    if (result == ERR_OK && !BTagIsComplete(reply))
        result = ERR_BUFFERSIZE;
    return result;
}

/* The length in a header counts from after itself. */
enum { PREFIX = offsetof(L7_HEADER, group) };

/* Offset of the content; 0 when the header is wrong. */
static RTS_UI32 check_header(const L7_HEADER *header, RTS_UI32 size)
{
    if (size < PREFIX + L7_HEADER_LENGTH_SHORT || BytesGet16(header->protocol) != L7_PROTOCOL)
        return 0;
    RTS_UI32 length = BytesGet16(header->length);
    if (length < L7_HEADER_LENGTH_SHORT || length > L7_HEADER_LENGTH_MAX || PREFIX + length > size)
        return 0;
    return PREFIX + length;
}

/* `size` of the header, long or short. */
static void put_header(L7_HEADER *reply, RTS_UI32 size, const L7_HEADER *request, RTS_UI32 session, RTS_UI32 content)
{
    if (size == sizeof(*reply))
        BytesPut32(reply->customer, 0);
    BytesPut16(reply->protocol, L7_PROTOCOL);
    BytesPut16(reply->length, size - PREFIX);
    BytesPut16(reply->group, BytesGet16(request->group) | L7_REPLY);
    BytesPut16(reply->service, BytesGet16(request->service));
    BytesPut32(reply->session, session);
    BytesPut32(reply->size, content);
}

RTS_NOINLINE RTS_UI32 SrvHandleMessage(COMM_CLIENT *client, const RTS_UI8 *message, RTS_UI32 size, RTS_UI8 *reply,
                                       RTS_UI32 capacity)
{
    enum { ERROR_CONTENT = 8 };
    const L7_HEADER *head = (const L7_HEADER *)message;
    RTS_UI32 start = check_header(head, size);
    RTS_UI32 header = sizeof(*head);
    SRV_REQUEST request;
    BTAG_WRITER writer;
    RTS_RESULT result = ERR_L7_INCOMPLETE;

    if (start == PREFIX + L7_HEADER_LENGTH_SHORT)
        header = start;
    if (start == 0 || capacity < header + ERROR_CONTENT)
        return 0;
    request.client = client;
    request.session = BytesGet32(head->session);
    request.reply_session = request.session;
    RTS_UI32 content = BytesGet32(head->size);
    BTagWriterInit(&writer, reply + header, capacity - header);
    if (content <= size - start) {
        BTagReaderInit(&request.tags, message + start, content);
        result = dispatch(BytesGet16(head->group), BytesGet16(head->service), &request, &writer);
    }
    if (result != ERR_OK) {
        BTagWriterInit(&writer, reply + header, capacity - header);
        BTagWrite16(&writer, TAG_ERROR, result);
    }
    put_header((L7_HEADER *)reply, header, head, request.reply_session, writer.size);
    return header + writer.size;
}

RTS_RESULT CmpSrv_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT && !RTS_STARTS_ONCE)
        memset(srv_groups, 0, srv_group_room * sizeof srv_groups[0]);
    else if (hook == CH_INIT3 && (COMM_ENDPOINTS || COMM_PASSWORD) && !SysTargetHasGenerator())
        LogAdd(CMPID_CmpSrv, LOG_WARNING, ERR_OK, "No random generator: ids and challenges might be guessed");
    return ERR_OK;
}
