/*
 * fuzz_files.c - any requests to the file services, one after another: replies are well-formed, and what the store keeps
 * is whole, also after a restart.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: for each request its service, the size of its content, the content. "SSSS" in it stands for the newest handle. With
 * bit 7 of the service set it is preceded by the loss of the session.
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpChecksum.h"
#include "CmpSrv.h"
#include "FileStore.h"
#include "Sim.h"
#include "SysFileFlash.h"
#include "fuzz.h"

enum { SECTOR = 1024, NEW_SESSION = 0x80 };

static RTS_UI32 newest_handle;
static RTS_UI32 session;

/* clang-format off */
#define SEED(requests) (memcpy(data, requests, sizeof(requests) - 1), sizeof(requests) - 1)
#define PUT(name, crc) "\x02\x0D" "\x01\x01" name "\x02\x08" crc "\x03\0\0\0"
#define PART(data) "\x04\x0D" "\x05\x0B" "SSSS" "\0\0\0\0" data
#define END "\x08\x06" "\x07\x04" "SSSS"
#define ABC "\xC2\x41\x24\x35"

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    (void)capacity;
    switch (index) {
    case 0:
        return SEED(PUT("a", ABC) PART("abc") END);
    case 1:
        return SEED(PUT("a", ABC) PART("abc") END "\x05\x03\x01\x01" "a" "\x07\x0A\x05\x08" "SSSS" "\0\0\0\0" END);
    case 2:
        return SEED(PUT("a", ABC) PART("abc") END PUT("a", "\0\0\0\0") PART("abd") END "\x0E\x03\x01\x01" "a");
    case 3:
        return SEED("\x0C\x06\x61\x04\0\0\0\0" "\x0C\x03\x0B\x01/" "\x01\x0C\x01\x0APlcLog.txt");
    case 4:
        return SEED("\x05\x0C\x01\x0APlcLog.txt" "\x07\x0A\x05\x08" "SSSS" "\x04\0\0\0" "\x09\x06\x07\x04" "SSSS");
    case 5:
        return SEED(PUT("a", ABC) "\x84\x0D" "\x05\x0B" "SSSS" "\0\0\0\0" "abc" PUT("b", ABC) PART("abc") END);
    case 6:
        return SEED("\x05\x06\x01\x04../a" "\x0E\x02\x01\x00" "\x01\x05\x01\x03" "a\0b");
    default:
        return 0;
    }
}
/* clang-format on */

static void check_content(const BTAG_READER *level)
{
    BTAG_READER reader = *level;
    BTAG_READER inner;
    BTAG tag;
    RTS_RESULT result;

    while ((result = BTagReadNext(&reader, &tag)) == ERR_OK) {
        FUZZ_CHECK(tag.size != 0);
        if (BTagReadContainer(&reader, &tag, &inner) == ERR_OK) {
            (void)BTagFindOptional(&inner, TAG_FILE_HANDLE, &newest_handle);
            check_content(&inner);
        }
    }
    FUZZ_CHECK(result == ERR_END_OF_OBJECT);
}

static void request(uint8_t service, const uint8_t *content, size_t size)
{
    static uint8_t reply[NETSERVER_MESSAGE_SIZE];
    COMM_CLIENT *client = ChannelGetClient(0);
    BTAG_READER tags;

    if (service & NEW_SESSION) {
        SrvEndSession(client);
        session = SrvLogin(client, 0);
    }
    uint8_t *message = calloc(1, 20 + size);
    FUZZ_CHECK(message != NULL);
    memcpy(message, "\x55\xCD\x10\x00\x08\x00", 6);
    message[6] = service & 0x0F;
    BytesPut32(message + 8, session);
    BytesPut32(message + 12, (RTS_UI32)size);
    if (size != 0)
        memcpy(message + 20, content, size);
    for (size_t i = 20; i + 4 <= 20 + size; i++)
        if (memcmp(message + i, "SSSS", 4) == 0)
            BytesPut32(message + i, newest_handle);
    RTS_UI32 capacity = CHANNEL_MIN_MESSAGE + (size * 37 & 0xFF);
    RTS_UI32 got = SrvHandleMessage(client, message, (RTS_UI32)size + 20, reply, capacity);
    free(message);
    FUZZ_CHECK(got >= 20 && got <= capacity);
    BTagReaderInit(&tags, reply + 20, got - 20);
    check_content(&tags);
}

/* Each file is in the store, apart from all others, and has its CRC. */
static RTS_UI32 check_store(void)
{
    RTS_UI32 count = 0;

    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        const FILE_ENTRY *file = FileStoreGet(i);
        RTS_UI32 crc = 0;
        if (file == NULL)
            continue;
        count++;
        FUZZ_CHECK(FileStoreIsName(file->name) && FileStoreFind(file->name) == file);
        FUZZ_CHECK(SysFileCRC32(FILE_STORE, file->start, file->size, &crc) == ERR_OK && crc == file->crc);
        for (RTS_UI32 k = 0; k < i; k++) {
            const FILE_ENTRY *other = FileStoreGet(k);
            FUZZ_CHECK(other == NULL || file->size == 0 || other->size == 0 ||
                       other->start >= file->start + file->size || file->start >= other->start + other->size);
        }
    }
    return count;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    SimFileStoreSize = 6 * SECTOR;
    FUZZ_CHECK(SimFlashConfigure(32 * SECTOR, SECTOR, 8, 0xFF) == ERR_OK && SimStart() == ERR_OK);
    newest_handle = 0;
    session = SrvLogin(ChannelGetClient(0), 0);
    while (size >= 2) {
        size_t content = data[1] < size - 2 ? data[1] : size - 2;
        request(data[0], data + 2, content);
        data += 2 + content;
        size -= 2 + content;
    }
    RTS_UI32 count = check_store();
    FUZZ_CHECK(SimStart() == ERR_OK);
    FUZZ_CHECK(check_store() == count && SimFlashViolations() == 0);
    return 0;
}
