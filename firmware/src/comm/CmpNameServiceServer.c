/*
 * CmpNameServiceServer.c - answers who this node is (network scan).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpNameServiceServer.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "SysTarget.h"
#include "rts_config.h"

enum {
    REPLY_0400_SIZE = 48,
    REPLY_0103_SIZE = 32,
    REPLY_0101_SIZE = 22,
    NUL_SIZES = 3 * 2 + 1, /* of three wide names and the serial number */
};

RTS_STATIC_ASSERT(NS_REPLY_SIZE <= NS_MAX_REPLY, ns_reply_fits_a_packet);
RTS_STATIC_ASSERT(NS_REPLY_SIZE >= REPLY_0400_SIZE + NUL_SIZES, ns_reply_holds_its_head);

/* The names with their lengths, bounded as the protocol wants it and by the room in the reply. */
typedef struct {
    const char *text;
    RTS_UI32 length;
} NAME;

static NAME bound_name(const char *text, RTS_UI32 max, RTS_UI32 character_size, RTS_UI32 *room)
{
    NAME name = {text, 0};

    while (name.length < max && text[name.length] != '\0' && *room >= character_size) {
        name.length++;
        *room -= character_size;
    }
    return name;
}

typedef struct {
    NAME node;
    NAME device;
    NAME vendor;
    NAME serial;
} NAMES;

static void get_names(const SYS_TARGET *target, NAMES *names)
{
    RTS_UI32 room = NS_REPLY_SIZE - REPLY_0400_SIZE - NUL_SIZES;

    names->node = bound_name(target->node_name, NS_MAX_NODE_NAME, 2, &room);
    names->serial = bound_name(target->serial_number, NS_MAX_SERIAL, 1, &room);
    names->device = bound_name(target->device_name, NS_MAX_TYPE_NAMES, 2, &room);
    names->vendor = bound_name(target->vendor_name, NS_MAX_TYPE_NAMES - names->device.length, 2, &room);
}

/* UTF-16LE and NUL; returns where it ends. */
static RTS_UI8 *put_wide(RTS_UI8 *place, const NAME *name)
{
    for (RTS_UI32 i = 0; i < name->length; i++, place += 2)
        BytesPut16(place, (RTS_UI8)name->text[i]);
    BytesPut16(place, 0);
    return place + 2;
}

/* The fields that versions 1.02, 1.03 and 4.00 have in common; returns their end. */
static RTS_UI8 *put_common(RTS_UI8 *reply, const SYS_TARGET *target, const NAMES *names)
{
    BytesPut16(reply + 8, CHANNEL_MAX_CHANNELS);
    reply[10] = 1; /* little endian */
    BytesPut16(reply + 14, names->node.length);
    BytesPut16(reply + 16, names->device.length);
    BytesPut16(reply + 18, names->vendor.length);
    BytesPut32(reply + 20, target->type);
    BytesPut32(reply + 24, target->id);
    BytesPut32(reply + 28, target->version);
    return reply + REPLY_0103_SIZE;
}

static RTS_UI8 *put_0101(RTS_UI8 *reply, const SYS_TARGET *target, const NAMES *names)
{
    BytesPut32(reply + 8, target->type);
    BytesPut16(reply + 12, CHANNEL_MAX_CHANNELS);
    reply[14] = 1; /* little endian */
    BytesPut16(reply + 18, names->node.length);
    BytesPut16(reply + 20, names->device.length);
    return put_wide(put_wide(reply + REPLY_0101_SIZE, &names->node), &names->device);
}

static RTS_UI8 *put_wide_names(RTS_UI8 *place, const NAMES *names)
{
    return put_wide(put_wide(put_wide(place, &names->node), &names->device), &names->vendor);
}

static RTS_UI8 *put_0400(RTS_UI8 *reply, const SYS_TARGET *target, const NAMES *names, RTS_UI8 driver_type)
{
    put_common(reply, target, names);
    reply[36] = (RTS_UI8)names->serial.length;
    reply[38] = driver_type;
    RTS_UI8 *place = put_wide_names(reply + REPLY_0400_SIZE, names);
    memcpy(place, names->serial.text, names->serial.length);
    return place + names->serial.length + 1;
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
static bool is_our_name(const RTS_UI8 *text, RTS_UI32 size, const NAME *node)
{
    RTS_UI32 length = 0;

    while (2 * length + 2 <= size && BytesGet16(text + 2 * length) != 0)
        length++;
    if (length != node->length)
        return false;
    for (RTS_UI32 i = 0; i < length; i++)
        if (BytesGet16(text + 2 * i) != (RTS_UI8)node->text[i])
            return false;
    return true;
}

static void answer(const ROUTER_PEER *peer, RTS_UI16 version, const RTS_UI8 *request_id, const NAMES *names)
{
    const SYS_TARGET *target = SysTargetGet();
    RTS_UI8 reply[NS_REPLY_SIZE] = {0};
    RTS_UI8 *end;
    BLK_PART part = {reply, 0};

    BytesPut16(reply, NS_IDENTIFICATION);
    BytesPut16(reply + 2, version);
    memcpy(reply + 4, request_id, 4);
    if (!NS_OLD_VERSIONS || version == NS_VERSION_0400)
        end = put_0400(reply, target, names, peer->driver->type);
    else if (version == NS_VERSION_0101)
        end = put_0101(reply, target, names);
    else
        end = put_wide_names(put_common(reply, target, names), names);
    part.size = (RTS_UI32)(end - reply);
    /* Without room in the driver the scan goes unanswered; scanners ask again. */
    (void)RouterSend(peer, ROUTER_SVC_NAME_RESPONSE, &part, 1);
}

void NSHandleRequest(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size)
{
    NAMES names;

    if (size < NS_REQUEST_SIZE)
        return;
    RTS_UI16 type = BytesGet16(data);
    RTS_UI16 version = choose_version(BytesGet16(data + 2));
    get_names(SysTargetGet(), &names);
    bool asked = type == NS_RESOLVE_ADDRESS ||
                 (type == NS_RESOLVE_NAME && is_our_name(data + NS_REQUEST_SIZE, size - NS_REQUEST_SIZE, &names.node));
    if (asked && version != 0)
        answer(peer, version, data + 4, &names);
}

RTS_RESULT CmpNameServiceServer_Hook(CMP_HOOK hook)
{
    RTS_UNUSED(hook);
    return ERR_OK;
}
