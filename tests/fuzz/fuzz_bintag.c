/*
 * fuzz_bintag.c - any bytes as tagged content: what is read can be written and read again.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBinTagUtil.h"
#include "fuzz.h"

#define SEED(bytes) {(const uint8_t *)(bytes), sizeof(bytes) - 1}

static const struct {
    const uint8_t *data;
    size_t size;
} contents[] = {
    SEED("\x01\x8C\x80\x00"
         "abcdefghijkl"
         "\x0A\x92\x80\x80\x80\x00"
         "abcdefghijklmnopqr"
         "\x82\xFF\x03\x04\x01\x02"
         "xy"),
    SEED("\x81\x01\x90\x00\x10\x0E"
         "Application\0\0\0"),
    SEED("\x22\x02\x01\x00\x81\x01\x04\x10\x02\x00\x00"),
    SEED("\x90\x80\x80\x00"),
    SEED("\x81\x01\x12\x81\x01\x0F\x81\x01\x0C\x81\x01\x09\x81\x01\x06\x81\x01\x03\x01\x01\x02"),
    SEED("\xFF\xFE\x03\x82\x80\x00\x01\x03"),
};

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    if (index >= sizeof(contents) / sizeof(contents[0]) || contents[index].size > capacity)
        return 0;
    memcpy(data, contents[index].data, contents[index].size);
    return contents[index].size;
}

/* Copies the elements of `level` that can be read. */
static void copy_level(BTAG_READER reader, BTAG_WRITER *writer)
{
    BTAG_READER inner;
    BTAG tag;

    while (BTagReadNext(&reader, &tag) == ERR_OK) {
        FUZZ_CHECK(tag.data >= reader.data && tag.size <= (size_t)(reader.data + reader.size - tag.data));
        BTagOpen(writer, tag.id, tag.id & 1 ? BTAG_ALIGN_2 : BTAG_ALIGN_0);
        if (BTagReadContainer(&reader, &tag, &inner) == ERR_OK)
            copy_level(inner, writer);
        else
            BTagAppend(writer, tag.data, tag.size);
        BTagClose(writer);
    }
}

/* Every element of `a` that is not empty is in `b`, in the same order. */
static void compare_level(BTAG_READER a, BTAG_READER b);

static void compare_content(const BTAG_READER *a, const BTAG *x, const BTAG_READER *b, const BTAG *y)
{
    BTAG_READER inner_a;
    BTAG_READER inner_b;

    FUZZ_CHECK(x->id == y->id);
    if (BTagReadContainer(a, x, &inner_a) == ERR_OK) {
        FUZZ_CHECK(BTagReadContainer(b, y, &inner_b) == ERR_OK);
        compare_level(inner_a, inner_b);
    } else {
        FUZZ_CHECK(x->size == y->size && memcmp(x->data, y->data, x->size) == 0);
    }
}

static void compare_level(BTAG_READER a, BTAG_READER b)
{
    BTAG x;
    BTAG y;

    while (BTagReadNext(&b, &y) == ERR_OK) {
        BTAG_READER inner;
        uint8_t scratch[8192];
        BTAG_WRITER writer;
        do { /* skip what vanished because nothing in it could be read */
            FUZZ_CHECK(BTagReadNext(&a, &x) == ERR_OK);
            BTagWriterInit(&writer, scratch, sizeof(scratch));
            if (BTagReadContainer(&a, &x, &inner) == ERR_OK)
                copy_level(inner, &writer);
            else
                BTagAppend(&writer, x.data, x.size);
        } while (writer.size == 0);
        compare_content(&a, &x, &b, &y);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t buffer[16384];
    uint8_t *small;
    BTAG_READER reader;
    BTAG_READER again;
    BTAG_WRITER writer;
    uint32_t capacity;

    if (size == 0 || size > 2048)
        return 0;
    BTagReaderInit(&reader, data, (RTS_UI32)size);
    BTagWriterInit(&writer, buffer, sizeof(buffer));
    copy_level(reader, &writer);
    if (BTagIsComplete(&writer)) {
        BTagReaderInit(&again, buffer, writer.size);
        compare_level(reader, again);
    }
    /* The same into too little room. */
    capacity = data[0];
    small = malloc(capacity + 1);
    FUZZ_CHECK(small != NULL);
    BTagWriterInit(&writer, small, capacity);
    copy_level(reader, &writer);
    FUZZ_CHECK(writer.size <= capacity);
    free(small);
    return 0;
}
