/*
 * files_client.h - files on a device of the simulator, as a tool puts and gets them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef FILES_CLIENT_H
#define FILES_CLIENT_H

#include "CmpBytes.h"
#include "CmpChecksum.h"
#include "CmpPackets.h"
#include "SimLink.h"
#include "app_image.h"
#include "comm_client.h"
#include "test.h"

static CLIENT client;
static REPLY reply;

static inline bool reconnect(void)
{
    SimLinkReset();
    client_init(&client, 0x0102);
    return client_open(&client) && client_login(&client);
}

static inline void start_device(RTS_UI32 size, RTS_UI32 sector, RTS_UI32 store)
{
    SimFileStoreSize = store;
    CHECK_EQUAL(SimFlashConfigure(size, sector, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(reconnect());
}

/* Number `tag` of the reply, at its top or in container `in`. */
static inline RTS_UI32 number_in(RTS_UI32 in, RTS_UI32 tag)
{
    BTAG_READER content = reply.tags;
    RTS_UI32 value = UINT32_MAX;

    if (in != 0 && BTagFindContainer(&reply.tags, in, &content) != ERR_OK)
        return UINT32_MAX;
    (void)BTagFindUnsigned(&content, tag, &value);
    return value;
}

/* Result of the request; its TAG_ERROR if it was refused as a whole. */
static inline RTS_UI32 ask(RTS_UI16 service, const BTAG_WRITER *content, RTS_UI32 in)
{
    CHECK(client_call(&client, SG_FILE_TRANSFER, service, content, &reply));
    return reply_error(&reply) != ERR_OK ? reply_error(&reply) : number_in(in, TAG_FILE_RESULT);
}

static inline RTS_UI32 ask_named(RTS_UI16 service, const void *name, RTS_UI32 length, RTS_UI32 in)
{
    RTS_UI8 content[600];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite(&writer, TAG_FILE_NAME, BTAG_ALIGN_0, name, length);
    return ask(service, &writer, in);
}

/* Begins to put a file; the result, and its handle in *handle. */
static inline RTS_UI32 put_begin(const char *name, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *handle)
{
    RTS_UI8 buffer[100];
    BTAG_WRITER writer;
    FILE_CONTENT content;

    BytesPut32(content.crc, data == NULL ? 0 : CRC32Update(0, data, size));
    BytesPut32(content.size, size);
    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWriteText(&writer, TAG_FILE_NAME, name, 60);
    BTagWrite(&writer, TAG_FILE_CONTENT, BTAG_ALIGN_0, &content, sizeof(content));
    RTS_UI32 result = ask(SRV_FILE_START_DOWNLOAD, &writer, TAG_FILE_STARTED);
    *handle = number_in(TAG_FILE_STARTED, TAG_FILE_HANDLE);
    return result;
}

static inline RTS_UI32 put_part(RTS_UI32 handle, RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    static RTS_UI8 buffer[2048];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagOpen(&writer, TAG_FILE_POSITION, BTAG_ALIGN_0);
    BTagAppend32(&writer, handle);
    BTagAppend32(&writer, offset);
    BTagAppend(&writer, data, size);
    BTagClose(&writer);
    return ask(SRV_FILE_DOWNLOAD, &writer, 0);
}

static inline RTS_UI32 end_file(RTS_UI16 service, RTS_UI32 handle)
{
    RTS_UI8 buffer[32];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWrite32(&writer, TAG_FILE_END, handle);
    return ask(service, &writer, 0);
}

static inline RTS_UI32 put(const char *name, const RTS_UI8 *data, RTS_UI32 size)
{
    enum { PART = 1500 };
    RTS_UI32 handle;
    RTS_UI32 result = put_begin(name, data, size, &handle);

    for (RTS_UI32 at = 0; result == ERR_OK && at < size; at += PART)
        result = put_part(handle, at, data + at, size - at < PART ? size - at : PART);
    return result == ERR_OK ? end_file(SRV_FILE_END, handle) : result;
}

static inline RTS_UI32 get_begin(const char *name, RTS_UI32 *handle)
{
    RTS_UI32 result = ask_named(SRV_FILE_START_UPLOAD, name, (RTS_UI32)strlen(name), TAG_FILE_STARTED);

    *handle = number_in(TAG_FILE_STARTED, TAG_FILE_HANDLE);
    return result;
}

/* The next part, of which *count are new; or the one at `offset`. */
static inline RTS_UI32 get_part(RTS_UI32 handle, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 *count)
{
    RTS_UI8 buffer[32];
    BTAG_WRITER writer;
    FILE_POSITION position;
    BTAG tag;

    BytesPut32(position.handle, handle);
    BytesPut32(position.offset, offset);
    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWrite(&writer, TAG_FILE_POSITION, BTAG_ALIGN_0, &position, sizeof(position));
    RTS_UI32 result = ask(SRV_FILE_UPLOAD, &writer, 0);
    *count = number_in(0, TAG_FILE_COUNT);
    if (*count == UINT32_MAX)
        return result;
    if (*count == 0)
        return ERR_OK;
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_FILE_POSITION, *count, *count + 3, &tag), ERR_OK);
    memcpy(data, tag.data, *count);
    return ERR_OK;
}

/* All of a file, `room` bytes at most. */
static inline RTS_UI32 get(const char *name, RTS_UI8 *data, RTS_UI32 room, RTS_UI32 *size)
{
    RTS_UI32 handle;
    RTS_UI32 count = 1;
    RTS_UI32 result = get_begin(name, &handle);

    for (*size = 0; result == ERR_OK && count != 0; *size += count) {
        result = get_part(handle, 0, data + *size, &count);
        if (result == ERR_OK && *size + count > room)
            return ERR_OUT_OF_LIMITS;
    }
    return result;
}

#endif
