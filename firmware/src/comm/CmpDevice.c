/*
 * CmpDevice.c - the device services (group 1): identity, login, echo.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * There are no users. Without a password a login only prevents changes by programs that did not mean to make any.
 */
#include "CmpDevice.h"

#include "CMUtils.h"
#include "CmpBytes.h"
#include "CmpPackets.h"
#include "CmpSrv.h"
#include "CmpUserMgr.h"
#include "NodeName.h"
#include "SysSocket.h"
#include "SysTarget.h"
#include "rts_config.h"

/* u32 byte length with NUL, UTF-16LE, padding. */
static void write_wide_text(BTAG_WRITER *reply, RTS_UI32 id, const char *text, RTS_UI32 max)
{
    RTS_UI32 length = CMUtlStrNLen(text, max);
    RTS_UI32 size = 2 * (length + 1);

    BTagOpen(reply, id, BTAG_ALIGN_0);
    BTagAppend32(reply, size);
    RTS_UI8 *place = BTagReserve(reply, size);
    if (place != NULL)
        (void)CMUtlPutWide(place, text, length);
    BTagPad(reply);
    BTagClose(reply);
}

/* u16 length, ASCII, padding. */
static void write_serial_number(BTAG_WRITER *reply, const char *text)
{
    BTagOpen(reply, TAG_DEV_SERIAL_NUMBER, BTAG_ALIGN_2);
    BTagAppend16(reply, CMUtlStrNLen(text, NS_MAX_SERIAL));
    BTagAppendText(reply, text, NS_MAX_SERIAL);
    BTagClose(reply);
}

#if SRV_NETWORKS > 0
/* u16 count, and for each u32 address and u32 mask. */
static void write_networks(BTAG_WRITER *reply)
{
    SOCKNETWORK network;
    RTS_UI32 count = 0;

    BTagOpen(reply, TAG_DEV_NETWORKS, BTAG_ALIGN_2);
    RTS_UI8 *number = BTagReserve(reply, sizeof(WIRE_UI16));
    for (; count < SRV_NETWORKS && SysSockGetNetwork(count, &network) == ERR_OK; count++) {
        BTagAppend32(reply, network.ip);
        BTagAppend32(reply, network.mask);
    }
    if (number != NULL)
        BytesPut16(number, count);
    BTagClose(reply);
}
#else
static void write_networks(const BTAG_WRITER *reply)
{
    RTS_UNUSED(reply);
}
#endif

static void write_stack(BTAG_WRITER *reply)
{
    SYS_STACK stack = SysTargetGetStack();
    DEV_STACK content;

    BytesPut32(content.size, stack.size);
    BytesPut32(content.unused, stack.unused);
    BTagWrite(reply, TAG_DEV_STACK, BTAG_ALIGN_0, &content, sizeof(content));
}

static RTS_RESULT get_target_ident(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    const SYS_TARGET *target = SysTargetGet();
    RTS_RESULT match = ERR_OK;
    DEV_IDENT ident;
    BTAG tag;

    RTS_RESULT result = BTagFind(&request->tags, TAG_DEV_IDENT, sizeof(ident), request->tags.size, &tag);
    if (result == ERR_OK) {
        const DEV_IDENT *expected = (const DEV_IDENT *)tag.data;
        if (BytesGet32(expected->type) != target->type || BytesGet32(expected->id) != target->id)
            match = ERR_TYPE_MISMATCH;
    } else if (result != ERR_L7_TAG_MISSING) {
        return result;
    }
    BTagWrite16(reply, TAG_DEV_RESULT, match);
    BytesPut32(ident.type, target->type);
    BytesPut32(ident.id, target->id);
    BytesPut32(ident.version, target->version);
    BTagWrite(reply, TAG_DEV_IDENT, BTAG_ALIGN_0, &ident, sizeof(ident));
    BTagWrite32(reply, TAG_DEV_RTS_VERSION, RTS_VERSION);
    write_wide_text(reply, TAG_DEV_DEVICE_NAME, target->device_name, NS_MAX_TYPE_NAMES);
    write_wide_text(reply, TAG_DEV_VENDOR_NAME, target->vendor_name, NS_MAX_TYPE_NAMES);
    write_wide_text(reply, TAG_DEV_NODE_NAME, NodeNameOf(target), NS_MAX_NODE_NAME);
    BTagWrite16(reply, TAG_DEV_MAX_CHANNELS, COMM_MAX_CLIENTS);
    if (SRV_OTHER_CLIENTS)
        BTagWrite32(reply, TAG_DEV_FLAGS, 0); /* there is no encryption */
    write_serial_number(reply, target->serial_number);
    write_networks(reply);
    if (SRV_INFORMATION)
        write_stack(reply);
    request->reply_session = L7_SESSION_EMPTY;
    return ERR_OK;
}

static RTS_RESULT session_create(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTagWrite32(reply, TAG_DEV_SESSION_ID, SrvCreateSession(request->client));
    BTagWrite32(reply, TAG_DEV_AUTH_TYPE, AppHasPassword() ? DEV_CRYPT_PROOF : DEV_CRYPT_XOR);
    return ERR_OK;
}

/* The session of a client that has logged in. */
static void write_login(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTagWrite16(reply, TAG_DEV_LOGIN_RESULT, ERR_OK);
    BTagWrite32(reply, TAG_DEV_SESSION_ID, SrvLogin(request->client, request->session));
    BTagWrite32(reply, TAG_DEV_SETTINGS, DEV_SETTING_MONITOR2);
}

#if COMM_PASSWORD
/* The first step gets a challenge, the second one, on the same channel, has the proof. */
static RTS_RESULT login_with_password(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG proof;
    RTS_RESULT result = BTagFind(&request->tags, TAG_DEV_PROOF, sizeof(DEV_PROOF), sizeof(DEV_PROOF), &proof);

    if (result == ERR_L7_TAG_MISSING) {
        BTagWrite16(reply, TAG_DEV_LOGIN_RESULT, ERR_PENDING);
        BTagWrite(reply, TAG_DEV_CHALLENGE, BTAG_ALIGN_0, UserChallenge(request->client), sizeof(DEV_CHALLENGE));
        return ERR_OK;
    }
    if (result != ERR_OK)
        return result;
    result = UserCheckProof(request->client, (const DEV_PROOF *)proof.data);
    if (result == ERR_OK)
        write_login(request, reply);
    else
        BTagWrite16(reply, TAG_DEV_LOGIN_RESULT, result);
    return ERR_OK;
}
#else
static RTS_RESULT login_with_password(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    RTS_UNUSED(reply);
    return ERR_NOT_SUPPORTED;
}
#endif

/* Clients with a key look for the result, here always a refusal, in another container. */
static RTS_UI32 login_reply_tag(RTS_UI32 crypt)
{
    return SRV_OTHER_CLIENTS && crypt == DEV_CRYPT_ASYMMETRIC ? TAG_DEV_ONLINE_ACCESS : TAG_DEV_LOGIN_REPLY;
}

/* Without a password the user is not looked at, so that clients with odd encodings of "nobody" can log in, too. */
static RTS_RESULT login(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 crypt = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_DEV_CRYPT_TYPE, &crypt);

    if (result != ERR_OK)
        return result;
    BTagOpen(reply, login_reply_tag(crypt), BTAG_ALIGN_0);
    if (AppHasPassword() && (crypt & DEV_CRYPT_PROOF))
        result = login_with_password(request, reply);
    else if (AppHasPassword())
        BTagWrite16(reply, TAG_DEV_LOGIN_RESULT, ERR_NO_ACCESS_RIGHTS);
    else if (crypt & DEV_CRYPT_XOR)
        write_login(request, reply);
    else
        BTagWrite16(reply, TAG_DEV_LOGIN_RESULT, ERR_NOT_SUPPORTED);
    BTagClose(reply);
    return result;
}

static RTS_RESULT logout(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 session = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_DEV_LOGOUT_SESSION, &session);

    if (result == ERR_OK)
        BTagWrite16(reply, TAG_DEV_LOGOUT_REPLY, SrvLogout(request->client, session));
    return result;
}

#if SRV_INFORMATION
static RTS_RESULT echo(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    enum { ECHO_OVERHEAD = 24 }; /* headers of the three elements, result and length */
    RTS_UI32 wanted = 0;
    BTAG data = {0, NULL, 0};

    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_DEV_ECHO_REPLY_LENGTH, &wanted);
    if (result != ERR_OK)
        return result == ERR_L7_TAG_MISSING ? ERR_OK : result;
    result = BTagFind(&request->tags, TAG_DEV_ECHO_DATA, 0, request->tags.size, &data);
    if (result == ERR_L7_TAG_MISSING)
        data.size = 0;
    else if (result != ERR_OK)
        return result;
    RTS_UI32 room = BTagGetRoom(reply);
    room = room > ECHO_OVERHEAD ? room - ECHO_OVERHEAD : 0;
    RTS_UI32 size = wanted < room ? wanted : room;
    RTS_UI32 copied = data.size < size ? data.size : size;
    BTagWrite16(reply, TAG_SERVICE_RESULT, ERR_OK);
    BTagWrite32(reply, TAG_DEV_ECHO_REPLY_LENGTH, size);
    BTagOpen(reply, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0);
    BTagAppend(reply, data.data, copied);
    BTagAppendZeros(reply, size - copied);
    BTagClose(reply);
    return ERR_OK;
}
#endif

#if SRV_OTHER_CLIENTS
/* There is one: the program may be debugged and replaced. */
static RTS_RESULT get_operation_mode(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    BTagWrite32(reply, TAG_DEV_OPERATION_MODE, DEV_MODE_DEBUG);
    return ERR_OK;
}

static RTS_RESULT set_operation_mode(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 mode = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_DEV_OPERATION_MODE, &mode);

    if (result == ERR_OK)
        BTagWrite16(reply, TAG_SERVICE_RESULT, mode == DEV_MODE_DEBUG ? ERR_OK : ERR_NOT_SUPPORTED);
    return result;
}

/* Takes the low half of UTF-16 characters up to the first NUL; false when there are too many, or others than ASCII. */
static bool read_name(const BTAG *wide, char *name)
{
    for (RTS_UI32 i = 0; i <= NS_MAX_NODE_NAME; i++) {
        RTS_UI32 character = 2 * i + 2 <= wide->size ? BytesGet16(wide->data + 2 * i) : 0;
        name[i] = (char)character;
        if (character == 0)
            return true;
        if (character > '~')
            return false;
    }
    return false;
}

static RTS_RESULT set_node_name(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    char name[NS_MAX_NODE_NAME + 1];
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_DEV_NEW_NODE_NAME, 0, request->tags.size, &tag);

    if (result == ERR_OK)
        BTagWrite16(reply, TAG_SERVICE_RESULT, read_name(&tag, name) ? NodeNameSet(name) : ERR_PARAMETER);
    return result;
}

/* Settings are a file or constants of the firmware (CmpSettings.h): no service shows or changes them. Writing such
 * limits was how others were attacked (CVE-2020-7052). */
static RTS_RESULT refuse_setting(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    RTS_UNUSED(reply);
    return ERR_NO_ACCESS_RIGHTS;
}

static const SRV_SERVICE settings[] = {
    {SRV_SETTG_GET_INT, RIGHT_VIEW, refuse_setting},    {SRV_SETTG_SET_INT, RIGHT_VIEW, refuse_setting},
    {SRV_SETTG_GET_STRING, RIGHT_VIEW, refuse_setting}, {SRV_SETTG_SET_STRING, RIGHT_VIEW, refuse_setting},
    {SRV_SETTG_REMOVE, RIGHT_VIEW, refuse_setting},     {SRV_SETTG_READ_ALL, RIGHT_VIEW, refuse_setting},
    {SRV_SETTG_WRITE, RIGHT_VIEW, refuse_setting},
};

static RTS_RESULT register_settings(void)
{
    return SrvRegisterGroup(SG_SETTINGS, settings, RTS_COUNT(settings));
}
#else
static RTS_RESULT register_settings(void)
{
    return ERR_OK;
}
#endif

static const SRV_SERVICE services[] = {
    {SRV_DEV_GET_TARGET_IDENT, RIGHT_NONE, get_target_ident},
    {SRV_DEV_LOGIN, RIGHT_NONE, login},
    {SRV_DEV_LOGOUT, RIGHT_NONE, logout},
#if SRV_INFORMATION
    {SRV_DEV_ECHO, RIGHT_STATE, echo},
#endif
    {SRV_DEV_SESSION_CREATE, RIGHT_NONE, session_create},
#if SRV_OTHER_CLIENTS
    {SRV_DEV_GET_OPERATION_MODE, RIGHT_STATE, get_operation_mode},
    {SRV_DEV_SET_OPERATION_MODE, RIGHT_CONTROL, set_operation_mode},
    {SRV_DEV_SET_NODE_NAME, RIGHT_DOWNLOAD, set_node_name},
#endif
};

RTS_RESULT CmpDevice_Hook(CMP_HOOK hook)
{
    RTS_RESULT result = ERR_OK;

    if (hook == CH_INIT3)
        result = SrvRegisterGroup(SG_DEVICE, services, RTS_COUNT(services));
    if (hook == CH_INIT3 && result == ERR_OK)
        result = register_settings();
    return result;
}
