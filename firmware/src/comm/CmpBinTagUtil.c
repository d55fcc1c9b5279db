/*
 * CmpBinTagUtil.c - tagged content of layer-7 messages: reader and writer.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpBinTagUtil.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpBytes.h"

/* ---- reader ---- */

void BTagReaderInit(BTAG_READER *reader, const RTS_UI8 *data, RTS_UI32 size)
{
    reader->data = data;
    reader->size = size;
    reader->position = 0;
    reader->depth = 1;
}

/* 7 bits per byte, lowest first; bytes that add nothing are legal (they align the content). */
static RTS_RESULT read_number(BTAG_READER *reader, RTS_UI32 *value)
{
    RTS_UI32 result = 0;

    for (RTS_UI32 i = 0; i < BTAG_MAX_VARINT; i++) {
        if (reader->position >= reader->size)
            return ERR_BTAG_BUFFEROVERRUN;
        RTS_UI8 byte = reader->data[reader->position++];
        RTS_UI32 bits = byte & 0x7Fu;
        if ((i > 4 && bits != 0) || (i == 4 && bits > 0x0F))
            return ERR_BTAG_BUFFEROVERRUN;
        if (i <= 4)
            result |= bits << (7 * i);
        if ((byte & 0x80) == 0) {
            *value = result;
            return ERR_OK;
        }
    }
    return ERR_BTAG_BUFFEROVERRUN;
}

RTS_RESULT BTagReadNext(BTAG_READER *reader, BTAG *tag)
{
    if (reader->position >= reader->size)
        return ERR_END_OF_OBJECT;
    RTS_RESULT result = read_number(reader, &tag->id);
    if (result == ERR_OK)
        result = read_number(reader, &tag->size);
    if (result != ERR_OK)
        return result;
    if (tag->size > reader->size - reader->position)
        return ERR_BTAG_BUFFEROVERRUN;
    tag->data = reader->data + reader->position;
    reader->position += tag->size;
    return ERR_OK;
}

RTS_RESULT BTagReadContainer(const BTAG_READER *reader, const BTAG *tag, BTAG_READER *content)
{
    RTS_UI32 depth = reader->depth + 1; /* content may be the reader itself */

    if ((tag->id & BTAG_CONTAINER) == 0)
        return ERR_BTAG_NOCONTAINERTAG;
    if (depth > BTAG_MAX_NESTING)
        return ERR_BTAG_MAXNESTINGDEPTH;
    BTagReaderInit(content, tag->data, tag->size);
    content->depth = depth;
    return ERR_OK;
}

RTS_RESULT BTagFind(const BTAG_READER *reader, RTS_UI32 id, RTS_UI32 min, RTS_UI32 max, BTAG *tag)
{
    BTAG_READER search = *reader;
    RTS_RESULT result;

    search.position = 0;
    do {
        result = BTagReadNext(&search, tag);
    } while (result == ERR_OK && tag->id != id);
    if (result == ERR_END_OF_OBJECT)
        return ERR_L7_TAG_MISSING;
    if (result == ERR_OK && (tag->size < min || tag->size > max))
        return ERR_SIZE_MISMATCH;
    return result;
}

RTS_RESULT BTagGetUnsigned(const BTAG *tag, RTS_UI32 *value)
{
    switch (tag->size) {
    case 1:
        *value = tag->data[0];
        return ERR_OK;
    case 2:
        *value = BytesGet16(tag->data);
        return ERR_OK;
    case 4:
        *value = BytesGet32(tag->data);
        return ERR_OK;
    default:
        return ERR_SIZE_MISMATCH;
    }
}

RTS_RESULT BTagFindUnsigned(const BTAG_READER *reader, RTS_UI32 id, RTS_UI32 *value)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(reader, id, 0, reader->size, &tag);

    return result == ERR_OK ? BTagGetUnsigned(&tag, value) : result;
}

RTS_RESULT BTagFindOptional(const BTAG_READER *reader, RTS_UI32 id, RTS_UI32 *value)
{
    RTS_RESULT result = BTagFindUnsigned(reader, id, value);

    return result == ERR_L7_TAG_MISSING ? ERR_OK : result;
}

RTS_RESULT BTagFindContainer(const BTAG_READER *reader, RTS_UI32 id, BTAG_READER *content)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(reader, id, 0, reader->size, &tag);

    return result == ERR_OK ? BTagReadContainer(reader, &tag, content) : result;
}

/* ---- writer ---- */

void BTagWriterInit(BTAG_WRITER *writer, RTS_UI8 *data, RTS_UI32 capacity)
{
    writer->data = data;
    writer->capacity = capacity;
    writer->size = 0;
    writer->depth = 0;
    writer->overflow = false;
}

RTS_UI32 BTagGetRoom(const BTAG_WRITER *writer)
{
    return writer->overflow ? 0 : writer->capacity - writer->size;
}

bool BTagIsComplete(const BTAG_WRITER *writer)
{
    return !writer->overflow && writer->depth == 0;
}

RTS_UI8 *BTagReserve(BTAG_WRITER *writer, RTS_UI32 size)
{
    if (BTagGetRoom(writer) < size) {
        writer->overflow = true;
        return NULL;
    }
    RTS_UI8 *data = writer->data + writer->size;
    writer->size += size;
    return data;
}

static RTS_UI32 number_width(RTS_UI32 value)
{
    RTS_UI32 width = 1;

    while (value >>= 7)
        width++;
    return width;
}

/* Exactly `width` bytes, filled up with redundant groups. */
static void put_number(RTS_UI8 *data, RTS_UI32 value, RTS_UI32 width)
{
    for (RTS_UI32 i = 0; i < width; i++) {
        data[i] = (RTS_UI8)((value & 0x7F) | (i + 1 < width ? 0x80 : 0));
        value >>= 7;
    }
}

/* Begins an element whose content will have no more bytes than `length_width` bytes of length can say. */
static void open_element(BTAG_WRITER *writer, RTS_UI32 id, BTAG_ALIGN align, RTS_UI32 length_width)
{
    RTS_UI32 id_width = number_width(id);
    RTS_UI32 header = id_width + length_width;

    header += ((RTS_UI32)align - (writer->size + header)) & 3;
    if (writer->depth >= BTAG_MAX_NESTING)
        writer->overflow = true;
    RTS_UI8 *data = BTagReserve(writer, header);
    if (data == NULL)
        return;
    put_number(data, id, id_width);
    writer->open[writer->depth] = writer->size - header;
    writer->start[writer->depth] = writer->size;
    writer->depth++;
}

void BTagOpen(BTAG_WRITER *writer, RTS_UI32 id, BTAG_ALIGN align)
{
    RTS_UI32 width = number_width(writer->capacity);

    open_element(writer, id, align, width < 2 ? 2 : width);
}

void BTagClose(BTAG_WRITER *writer)
{
    if (writer->overflow || writer->depth == 0)
        return;
    writer->depth--;
    RTS_UI32 open = writer->open[writer->depth];
    RTS_UI32 start = writer->start[writer->depth];
    if (writer->size == start) {
        writer->size = open;
        return;
    }
    RTS_UI32 length = open;
    while (writer->data[length] & 0x80)
        length++;
    length++; /* after the id */
    put_number(writer->data + length, writer->size - start, start - length);
}

void BTagAppend(BTAG_WRITER *writer, const void *data, RTS_UI32 size)
{
    RTS_UI8 *place = BTagReserve(writer, size);

    if (place != NULL && size != 0)
        memcpy(place, data, size);
}

void BTagAppend16(BTAG_WRITER *writer, RTS_UI32 value)
{
    RTS_UI8 *place = BTagReserve(writer, 2);

    if (place != NULL)
        BytesPut16(place, value);
}

void BTagAppend32(BTAG_WRITER *writer, RTS_UI32 value)
{
    RTS_UI8 *place = BTagReserve(writer, 4);

    if (place != NULL)
        BytesPut32(place, value);
}

void BTagAppendZeros(BTAG_WRITER *writer, RTS_UI32 size)
{
    RTS_UI8 *place = BTagReserve(writer, size);

    if (place != NULL)
        memset(place, 0, size);
}

void BTagPad(BTAG_WRITER *writer)
{
    BTagAppendZeros(writer, -writer->size & 3);
}

void BTagAppendText(BTAG_WRITER *writer, const char *text, RTS_UI32 max)
{
    BTagAppend(writer, text, CMUtlStrNLen(text, max));
    BTagAppendZeros(writer, 1);
    BTagPad(writer);
}

void BTagWrite(BTAG_WRITER *writer, RTS_UI32 id, BTAG_ALIGN align, const void *data, RTS_UI32 size)
{
    BTagOpen(writer, id, align);
    BTagAppend(writer, data, size);
    BTagClose(writer);
}

void BTagWrite16(BTAG_WRITER *writer, RTS_UI32 id, RTS_UI32 value)
{
    open_element(writer, id, BTAG_ALIGN_2, 1);
    BTagAppend16(writer, value);
    BTagClose(writer);
}

void BTagWrite32(BTAG_WRITER *writer, RTS_UI32 id, RTS_UI32 value)
{
    open_element(writer, id, BTAG_ALIGN_0, 1);
    BTagAppend32(writer, value);
    BTagClose(writer);
}

void BTagWriteText(BTAG_WRITER *writer, RTS_UI32 id, const char *text, RTS_UI32 max)
{
    BTagOpen(writer, id, BTAG_ALIGN_0);
    BTagAppendText(writer, text, max);
    BTagClose(writer);
}
