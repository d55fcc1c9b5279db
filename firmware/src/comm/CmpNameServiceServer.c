/*
 * CmpNameServiceServer.c - replies with the identity of this node (network scan).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpNameServiceServer.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpBytes.h"
#include "CmpPackets.h"
#include "NodeName.h"
#include "SysTarget.h"
#include "rts_config.h"

enum {
    NUL_SIZES = 3 * 2 + 1, /* of three wide names and the serial number */
    ROOM_FOR_TEXTS = NS_REPLY_SIZE - (int)sizeof(NS_REPLY_0400) - NUL_SIZES,
};

RTS_STATIC_ASSERT(NS_REPLY_SIZE <= NS_MAX_REPLY, ns_reply_fits_a_packet);
RTS_STATIC_ASSERT(ROOM_FOR_TEXTS >= (int)NS_MAX_SERIAL, ns_reply_holds_its_head_and_the_serial_number);

/* Where the next wide name goes, and how many characters of it and those after it there is room for. */
typedef struct {
    RTS_UI8 *place;
    RTS_UI32 room;
} NAMES;

/* Writes a name, cut to `max` characters and the room; returns its length. */
static RTS_UI32 put_name(NAMES *names, const char *text, RTS_UI32 max)
{
    RTS_UI32 length = CMUtlStrNLen(text, max < names->room ? max : names->room);

    names->place = CMUtlPutWide(names->place, text, length);
    names->room -= length;
    return length;
}

/* What follows the request id in versions 1.02, 1.03 and 4.00, the last one with more of it; returns the end. */
static RTS_UI8 *put_body(NS_REPLY_0400 *reply, const SYS_TARGET *target, bool is_0400, RTS_UI8 driver_type)
{
    NS_REPLY_0103 *old = &reply->old;
    RTS_UI32 serial = CMUtlStrNLen(target->serial_number, NS_MAX_SERIAL);
    NAMES names = {is_0400 ? (RTS_UI8 *)(reply + 1) : (RTS_UI8 *)(old + 1), (ROOM_FOR_TEXTS - serial) / 2};

    BytesPut16(old->max_channels, COMM_MAX_CLIENTS);
    old->little_endian = 1;
    BytesPut16(old->node_length, put_name(&names, NodeNameOf(target), NS_MAX_NODE_NAME));
    RTS_UI32 device = put_name(&names, target->device_name, NS_MAX_TYPE_NAMES);
    BytesPut16(old->device_length, device);
    BytesPut16(old->vendor_length, put_name(&names, target->vendor_name, NS_MAX_TYPE_NAMES - device));
    BytesPut32(old->target_type, target->type);
    BytesPut32(old->target_id, target->id);
    BytesPut32(old->target_version, target->version);
    if (!is_0400)
        return names.place;
    reply->serial_length = (RTS_UI8)serial;
    reply->driver_type = driver_type;
    reply->left_out = CMHasLeftOut();
    memcpy(names.place, target->serial_number, serial); /* the NUL is there */
    return names.place + serial + 1;
}

static RTS_UI8 *put_body_0101(NS_REPLY_0101 *reply, const SYS_TARGET *target)
{
    NAMES names = {(RTS_UI8 *)(reply + 1), ROOM_FOR_TEXTS / 2};

    BytesPut32(reply->target_type, target->type);
    BytesPut16(reply->max_channels, COMM_MAX_CLIENTS);
    reply->little_endian = 1;
    BytesPut16(reply->node_length, put_name(&names, NodeNameOf(target), NS_MAX_NODE_NAME));
    BytesPut16(reply->device_length, put_name(&names, target->device_name, NS_MAX_TYPE_NAMES));
    return names.place;
}

/* The version to answer with; 0 for one that never existed. */
static RTS_UI16 choose_version(RTS_UI16 wanted)
{
    if (wanted >= NS_VERSION_0400)
        return NS_VERSION_0400;
    if (!NS_OLD_VERSIONS)
        return 0;
    if (wanted == 0x0201) /* bytes swapped by old clients, as the next */
        return NS_VERSION_0102;
    if (wanted >= NS_VERSION_0103)
        return NS_VERSION_0103;
    return wanted == NS_VERSION_0102 || wanted == NS_VERSION_0101 ? wanted : 0;
}

/* Compares UTF-16LE text, with or without NUL, with our node name. */
static bool is_our_name(const RTS_UI8 *text, RTS_UI32 size)
{
    const char *own = NodeNameOf(SysTargetGet());

    for (RTS_UI32 i = 0;; i++) {
        RTS_UI32 character = 2 * i + 2 <= size ? BytesGet16(text + 2 * i) : 0;
        RTS_UI32 expected = i < NS_MAX_NODE_NAME ? (RTS_UI8)own[i] : 0;
        if (character != expected)
            return false;
        if (expected == 0)
            return true;
    }
}

static void answer(const ROUTER_PEER *peer, RTS_UI16 version, const RTS_UI8 *request_id)
{
    RTS_UI8 reply[NS_REPLY_SIZE] = {0};
    NS_REQUEST *head = (NS_REQUEST *)reply; /* replies start like requests */
    RTS_UI8 *end;

    BytesPut16(head->type, NS_IDENTIFICATION);
    BytesPut16(head->version, version);
    memcpy(head->request_id, request_id, sizeof(head->request_id));
    if (NS_OLD_VERSIONS && version == NS_VERSION_0101)
        end = put_body_0101((NS_REPLY_0101 *)reply, SysTargetGet());
    else
        end = put_body((NS_REPLY_0400 *)reply, SysTargetGet(), !NS_OLD_VERSIONS || version == NS_VERSION_0400,
                       peer->driver->type);
    BLK_PART part = {reply, (RTS_UI32)(end - reply)};
    /* Without room in the driver the scan goes unanswered; scanners ask again. */
    (void)RouterSend(peer, ROUTER_SVC_NAME_RESPONSE, &part, 1);
}

RTS_NOINLINE void NSHandleRequest(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size)
{
    const NS_REQUEST *request = (const NS_REQUEST *)data;

    if (size < sizeof(*request))
        return;
    RTS_UI16 type = BytesGet16(request->type);
    RTS_UI16 version = choose_version(BytesGet16(request->version));
    bool asked = type == NS_RESOLVE_ADDRESS ||
                 (type == NS_RESOLVE_NAME && is_our_name(data + sizeof(*request), size - (RTS_UI32)sizeof(*request)));
    if (asked && version != 0)
        answer(peer, version, request->request_id);
}

RTS_RESULT CmpNameServiceServer_Hook(CMP_HOOK hook)
{
    RTS_UNUSED(hook);
    return ERR_OK;
}
