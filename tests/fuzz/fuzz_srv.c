/*
 * fuzz_srv.c - any layer-7 message of a client that is logged in: the reply is well-formed, memory outside the areas
 * is safe.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: a message without its first 4 bytes. When bit 7 of the group is set the session and the application session
 * are repaired wherever they are expected; when bit 6 is, the device has a password, and a challenge has been asked for.
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpSrv.h"
#include "CmpUserMgr.h"
#include "comm_fakes.h"
#include "comm_client.h"
#include "fuzz.h"

enum { HEAD = 16 }; /* group, service, session, content length, customer id */
enum { HAS_PASSWORD = 0x40 };

static size_t seed(uint8_t *data, uint8_t group, uint8_t service, const char *content, size_t size)
{
    memset(data, 0, HEAD);
    data[0] = group;
    data[1] = 0x80; /* repair */
    data[2] = service;
    memcpy(data + HEAD, content, size);
    return HEAD + size;
}

/* A service without content, in the order of those that components have registered; 0 after the last one. */
static size_t seed_of_service(unsigned index, uint8_t *data)
{
    fakes_start();
    for (const SRV_GROUP *group = srv_groups; group < srv_groups + srv_group_room; group++) {
        if (index < group->count)
            return seed(data, (uint8_t)group->group, (uint8_t)group->services[index].service, "", 0);
        index -= (unsigned)group->count;
    }
    return 0;
}

enum { CONTENTS = 43 }; /* seeds with a content */

/* clang-format off */
#define SEED(group, service, content) seed(data, group, service, content, sizeof(content) - 1)
#define APP "\x01\x14" "SSSS" "\x4F\x3E\x2D\x1C" "\0\0\0\0\0\0\0\0\0\0\0\0"
#define POSITION "\x02\x10" "\0\0\0\0" "\0\0\0\0" "\x20\0\0\0" "\x01\x02\x03\x04"

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    (void)capacity;
    switch (index) {
    case 0:
        return SEED(SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, "\x01\x0C\0\x10\0\0\x02\0\x01\0\0\0\0\0");
    case 1:
        return SEED(SG_DEVICE, SRV_DEV_LOGIN, "\x22\x02\x01\x00\x81\x01\x04\x10\x02\x00\x00");
    case 2:
        return SEED(SG_DEVICE, SRV_DEV_LOGOUT, "\x01\x04" "SSSS");
    case 3:
        return SEED(SG_DEVICE, SRV_DEV_ECHO, "\x52\x04\x10\0\0\0\x53\x03" "abc");
    case 4:
        return SEED(SG_DEVICE, SRV_DEV_SESSION_CREATE, "\x46\x84\x80\x00\x03\0\0\0");
    case 5:
        return SEED(SG_APPLICATION, SRV_APP_LOGIN, "\x01\x0B" "Application");
    case 6:
        return SEED(SG_APPLICATION, SRV_APP_CREATE, "\x81\x01\x90\x00\x10\x0E" "Application\0\0");
    case 7:
        return SEED(SG_APPLICATION, SRV_APP_START, "\x81\x01\x06\x11\x04" "SSSS");
    case 8:
        return SEED(SG_APPLICATION, SRV_APP_RESET, "\x81\x01\x0C\x11\x04" "SSSS" "\x10\x04\x01\0\0\0");
    case 9:
        return SEED(SG_APPLICATION, SRV_APP_READ_STATUS, "\x81\x01\x06\x11\x04" "SSSS");
    case 10:
        return SEED(SG_APPLICATION, SRV_APP_READ_APPLICATION_LIST, "\x01\x08\0\0\0\0\xFF\xFF\xFF\x7F");
    case 11:
        return SEED(SG_APPLICATION, SRV_APP_READ_APPLICATION_INFO, "");
    case 12:
        return SEED(SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, POSITION "\x03\x10" "0123456789abcdef");
    case 13:
        return SEED(SG_APPLICATION, SRV_APP_READ_TASK_INFO, "");
    case 14:
        return SEED(SG_MONITORING2, SRV_MON2_READ, APP "\x81\x01\x1E" "\x82\x01\x0A\x02\x01\x04\x05\x05\x02\x10\x00\x06\x00"
                                 "\x82\x01\x0E\x01\x01\x07\x02\x01\x08\x05\x07\x03\x10\x00\x00\x00\x06\x01");
    case 15:
        return SEED(SG_MONITORING2, SRV_MON2_WRITE, APP "\x03\x0E" "\0\0\x01\0\0\0\x55\x05\x00\x02\x10\x00\x06\x00");
    case 16:
        return SEED(SG_MONITORING2, SRV_MON2_WRITE, APP "\x03\x25" "\0\0\x02\0\0\0\x55\xAA\x1B\x00"
                                 "\x15\x0C\x00\x02\x10\x00\x06\x00\x17\x0C\x09\x04\x1B\x06\x00\x01\x00\x00"
                                 "\x17\x04\x09\x04\x17\x08\x09\x04\x04");
    case 17:
        return SEED(SG_LOG, SRV_LOG_GET_ENTRIES, "\x02\x04\x01\0\0\0\x04\x04\x10\0\0\0");
    case 18:
        return SEED(SG_MONITORING2, SRV_MON2_READ, APP "\x81\x01\x1B" "\x82\x01\x18\x02\x01\x04\x05\x13\x02\x10\x00\x06\x00"
                                 "\x09\x08\x02\x20\x00\x0E\x09\x08\x03\x04\x00\x00\x00\x0E");
    case 21:
        return SEED(SG_USERMGR, SRV_USER_SET_CREDENTIALS, "\x60\x34" "0123456789abcdef0123456789abcdef" "0123456789abcdef" "\x88\x13\0\0");
    case 22:
    case 23: {
        size_t size = SEED(SG_DEVICE, SRV_DEV_LOGIN, "\x22\x02\0\x01" "\x62\x30" "0123456789abcdef" "0123456789abcdef0123456789abcdef");
        data[1] |= HAS_PASSWORD;
        return index == 22 ? size : HEAD + 4;
    }
    case 20:
        return SEED(SG_PLCSHELL, SRV_SHELL_EXECUTE, "\x13\x04\x01\0\0\0\x10\x02" "?\0");
    case 19:
        return SEED(SG_MONITORING2, SRV_MON2_WRITE, APP "\x03\x14" "\0\0\x01\0\0\0\x55\x0B\x00\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E");
    case 24:
        return SEED(SG_DEVICE, SRV_DEV_SET_NODE_NAME, "\x58\x08" "M\0i\0x\0\0\0");
    case 25:
        return SEED(SG_APPLICATION, SRV_APP_SINGLE_CYCLE, "\x81\x01\x06\x11\x04" "SSSS");
    case 26:
        return SEED(SG_APPLICATION, SRV_APP_GET_AREA_ADDRESS, "\x11\x04" "SSSS" "\x13\x04\x01\0\0\0");
    case 27:
        return SEED(SG_MONITORING2, SRV_MON2_WRITE, APP "\x03\x23" "\0\0\x02\0\0\0\x55\xAA\x1B\x00"
                                 "\x15\x10\x00\x02\x10\x00\x06\x00\x17\x10\x09\x04\x1B\x06\x00\x01\x00\x00"
                                 "\x17\x08\x09\x08\x17\x0C\x09\x04\x04");
    case 28:
        return SEED(SG_SETTINGS, SRV_SETTG_SET_INT, "\x81\x01\x08\x10\x02" "A\0" "\x11\x02" "B\0");
    case 29:
        return SEED(SG_MONITORING2, SRV_MON2_FORCE, APP "\x03\x2E" "\xFF\xFF\x01\0\0\0\x55\x05\x00\x02\x10\x00\x06\x00"
                                 "\xFF\xFF\x01\0\0\0\x04\x07\x00\x02\x20\x00\x06\x00\x40\x04"
                                 "\0\0\x01\0\0\0\x55\x05\x00\x02\x10\x00\x06\x00");
    case 30:
        return SEED(SG_MONITORING2, SRV_MON2_FORCE, APP "\x03\x14" "\xFF\xFF\x01\0\0\0\x55\x0B\x00\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E");
    case 31:
        return SEED(SG_MONITORING2, SRV_MON2_FORCE_LIST, APP "\x46\x04\0\0\0\0");
    case 32:
        return SEED(SG_APPLICATION, SRV_APP_RELEASE_FORCE_LIST, "\x81\x01\x06\x11\x04" "SSSS");
    case 33:
        return SEED(SG_TRACE, SRV_TRACE_CREATE, "\x01\x68" "\x4F\x3E\x2D\x1C" "pump\0\0\0\0\0\0\0\0\0\0\0\0" "\x02\x04\0\x02" "\x01\0\0\0" "\x20\0\0\0" "\x04\0\0\0" "\5\0\0\0\0\0\0\0"
                         "\000\0\x04\xFF" "\x10\0\0\0" "\0\0\0\0\0\0\0\0\0\0\0\0"
                         "\001\0\x04\xFF" "\x10\0\0\0" "\0\0\0\0\0\0\0\0\0\0\0\0"
                         "\376\0\x04\xFF" "\4\0\0\0" "\0\0\0\0\0\0\0\0\0\0\0\0");
    case 34:
        return SEED(SG_TRACE, SRV_TRACE_DELETE, "\x02\x04\x01\0\0\0");
    case 35:
        return SEED(SG_TRACE, SRV_TRACE_LIST, "\x02\x04\0\0\0\0");
    case 36:
        return SEED(SG_TRACE, SRV_TRACE_READ, "\x02\x04\x01\0\0\0" "\x03\x04\0\0\0\0");
    case 37:
        return SEED(SG_APPLICATION_BP, SRV_BP_SET, "\x04\x2C" "\x10\0\0\0\x02\0\0\0\0\0\0\0\x03\x01\0\0\0\x01\x04\xFF"
                                "\x10\0\0\0\x04\0\0\0\0\0\0\0\0\0\0\0\x05\0\0\0\0\0\0\0");
    case 38:
        return SEED(SG_APPLICATION_BP, SRV_BP_TEMPORARY, "\x07\x08\x10\0\0\0\x20\0\0\0" "\x08\x04\x01\0\0\0");
    case 39:
        return SEED(SG_APPLICATION_BP, SRV_BP_GO, "\x09\x04\x01\0\0\0" "\x0A\x04\0\0\0\0");
    case 40:
        return SEED(SG_APPLICATION_BP, SRV_BP_READ_STACK, "\x0B\x04\x08\0\0\0" "\x0C\x04\x10\0\0\0");
    case 41:
        return SEED(SG_APPLICATION_BP, SRV_BP_WRITE_STACK, "\x0B\x04\x08\0\0\0" "\x0D\x04" "abcd");
    case 42:
        return SEED(SG_APPLICATION_BP, SRV_BP_LIST, "\x06\x04\0\0\0\0");
    default:
        return seed_of_service(index - CONTENTS, data);
    }
}
/* clang-format on */

/* Puts the sessions where the first inputs have "SSSS" or the header its zero. */
static void repair(uint8_t *message, size_t size, RTS_UI32 session, RTS_UI32 app_session)
{
    message[5] &= 0x3F;
    BytesPut32(message + 8, session);
    BytesPut32(message + 12, (RTS_UI32)(size - 20));
    for (size_t i = 20; i + 4 <= size; i++)
        if (memcmp(message + i, "SSSS", 4) == 0)
            BytesPut32(message + i, app_session);
}

static void set_password(void)
{
#if COMM_PASSWORD
    BytesPut32(fakes.password.iterations, PASSWORD_MIN_ITERATIONS);
    (void)UserChallenge(ChannelGetClient(0));
#endif
}

/* Pointers of which some lead into areas: 0x10 of the data area into memory, from there on into the retain area. */
static void put_pointers(void)
{
    static const struct {
        RTS_UI32 area, offset, to_area, to;
    } pointers[] = {
        {APP_AREA_DATA, 0x10, APP_AREA_MEMORY, 0x100},
        {APP_AREA_MEMORY, 0x120, APP_AREA_RETAIN, FAKE_AREA_SIZE - 8},
        {APP_AREA_DATA, 0x18, APP_AREA_CODE, 0},
    };

    for (RTS_UI32 i = 0; i < RTS_COUNT(pointers); i++) {
        uintptr_t address = (uintptr_t)fakes_area(pointers[i].to_area) + pointers[i].to;
        memcpy(fakes_area(pointers[i].area) + pointers[i].offset, &address, sizeof(address));
    }
}

/* The content can be walked to its end, containers included. */
static void check_content(const BTAG_READER *level)
{
    BTAG_READER reader = *level;
    BTAG_READER inner;
    BTAG tag;
    RTS_RESULT result;

    while ((result = BTagReadNext(&reader, &tag)) == ERR_OK) {
        FUZZ_CHECK(tag.size != 0);
        if (BTagReadContainer(&reader, &tag, &inner) == ERR_OK)
            check_content(&inner);
    }
    FUZZ_CHECK(result == ERR_END_OF_OBJECT);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t message[4096];
    static uint8_t reply[NETSERVER_MESSAGE_SIZE];
    BTAG_READER content;

    if (size < HEAD || size > sizeof(message) - 4)
        return 0;
    fakes_start();
    fakes.task_count = FAKE_TASKS;
    fakes.log_count = 5;
    put_pointers();
    RTS_UI32 session = SrvLogin(ChannelGetClient(0), 0);
    RTS_UI32 app_session = SrvCreateAppSession(ChannelGetClient(0));
    memcpy(message, "\x55\xCD\x10\x00", 4);
    memcpy(message + 4, data, size);
    if (message[5] & HAS_PASSWORD)
        set_password();
    if (message[5] & 0x80)
        repair(message, size + 4, session, app_session);
    uint8_t *copy = malloc(size + 4);
    FUZZ_CHECK(copy != NULL);
    memcpy(copy, message, size + 4);
    RTS_UI32 capacity = CHANNEL_MIN_MESSAGE + data[size - 1];
    RTS_UI32 got = SrvHandleMessage(ChannelGetClient(0), copy, (RTS_UI32)size + 4, reply, capacity);
    free(copy);
    FUZZ_CHECK(got >= 20 && got <= capacity);
    FUZZ_CHECK(BytesGet32(reply + 12) == got - 20);
    BTagReaderInit(&content, reply + 20, got - 20);
    check_content(&content);
    FUZZ_CHECK(fakes.download_offset <= FAKE_IMAGE_SIZE);
    return 0;
}
