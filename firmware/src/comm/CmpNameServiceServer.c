/*
 * CmpNameServiceServer.c - answers who this node is (network scan).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpNameServiceServer.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpBytes.h"
#include "SysTarget.h"
#include "rts_config.h"

enum {
    REPLY_0400_SIZE = 48,
    REPLY_0103_SIZE = 32,
    REPLY_0101_SIZE = 22,
    NUL_SIZES = 3 * 2 + 1, /* of three wide names and the serial number */
    ROOM_FOR_TEXTS = NS_REPLY_SIZE - REPLY_0400_SIZE - NUL_SIZES,
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

/* What follows the first 8 bytes in versions 1.02, 1.03 and 4.00, the last one with more of it; returns the end. */
static RTS_UI8 *put_body(RTS_UI8 *reply, const SYS_TARGET *target, bool is_0400, RTS_UI8 driver_type)
{
    RTS_UI32 serial = CMUtlStrNLen(target->serial_number, NS_MAX_SERIAL);
    NAMES names = {reply + (is_0400 ? REPLY_0400_SIZE : REPLY_0103_SIZE), (ROOM_FOR_TEXTS - serial) / 2};

    BytesPut16(reply + 8, COMM_MAX_CLIENTS);
    reply[10] = 1; /* little endian */
    BytesPut16(reply + 14, put_name(&names, target->node_name, NS_MAX_NODE_NAME));
    RTS_UI32 device = put_name(&names, target->device_name, NS_MAX_TYPE_NAMES);
    BytesPut16(reply + 16, device);
    BytesPut16(reply + 18, put_name(&names, target->vendor_name, NS_MAX_TYPE_NAMES - device));
    BytesPut32(reply + 20, target->type);
    BytesPut32(reply + 24, target->id);
    BytesPut32(reply + 28, target->version);
    if (!is_0400)
        return names.place;
    reply[36] = (RTS_UI8)serial;
    reply[38] = driver_type;
    memcpy(names.place, target->serial_number, serial); /* the NUL is there */
    return names.place + serial + 1;
}

static RTS_UI8 *put_body_0101(RTS_UI8 *reply, const SYS_TARGET *target)
{
    NAMES names = {reply + REPLY_0101_SIZE, ROOM_FOR_TEXTS / 2};

    BytesPut32(reply + 8, target->type);
    BytesPut16(reply + 12, COMM_MAX_CLIENTS);
    reply[14] = 1; /* little endian */
    BytesPut16(reply + 18, put_name(&names, target->node_name, NS_MAX_NODE_NAME));
    BytesPut16(reply + 20, put_name(&names, target->device_name, NS_MAX_TYPE_NAMES));
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
    const char *own = SysTargetGet()->node_name;

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
    RTS_UI8 *end;

    BytesPut16(reply, NS_IDENTIFICATION);
    BytesPut16(reply + 2, version);
    memcpy(reply + 4, request_id, 4);
    if (NS_OLD_VERSIONS && version == NS_VERSION_0101)
        end = put_body_0101(reply, SysTargetGet());
    else
        end = put_body(reply, SysTargetGet(), !NS_OLD_VERSIONS || version == NS_VERSION_0400, peer->driver->type);
    BLK_PART part = {reply, (RTS_UI32)(end - reply)};
    /* Without room in the driver the scan goes unanswered; scanners ask again. */
    (void)RouterSend(peer, ROUTER_SVC_NAME_RESPONSE, &part, 1);
}

RTS_NOINLINE void NSHandleRequest(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size)
{
    if (size < NS_REQUEST_SIZE)
        return;
    RTS_UI16 type = BytesGet16(data);
    RTS_UI16 version = choose_version(BytesGet16(data + 2));
    bool asked = type == NS_RESOLVE_ADDRESS ||
                 (type == NS_RESOLVE_NAME && is_our_name(data + NS_REQUEST_SIZE, size - NS_REQUEST_SIZE));
    if (asked && version != 0)
        answer(peer, version, data + 4);
}

RTS_RESULT CmpNameServiceServer_Hook(CMP_HOOK hook)
{
    RTS_UNUSED(hook);
    return ERR_OK;
}
