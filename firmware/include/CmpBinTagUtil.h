/*
 * CmpBinTagUtil.h - tagged content of layer-7 messages: reader and writer. codesys-v3-protocol 4.2.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The reader is the only code that turns a length from outside into a pointer and a size. A caller states which sizes
 * of a tag it accepts.
 */
#ifndef CMPBINTAGUTIL_H
#define CMPBINTAGUTIL_H

#include "CmpErrors.h"
#include "CmpStd.h"

enum {
    BTAG_MAX_NESTING = 5,
    BTAG_MAX_VARINT = 10, /* bytes of an over-long number */
    BTAG_CONTAINER = 0x80,
};

typedef struct {
    const RTS_UI8 *data;
    RTS_UI32 size;
    RTS_UI32 position;
    RTS_UI32 depth;
} BTAG_READER;

typedef struct {
    RTS_UI32 id;
    const RTS_UI8 *data;
    RTS_UI32 size;
} BTAG;

void BTagReaderInit(BTAG_READER *reader, const RTS_UI8 *data, RTS_UI32 size);

/* The next element. ERR_END_OF_OBJECT after the last, ERR_BTAG_* when it is malformed. */
RTS_RESULT BTagReadNext(BTAG_READER *reader, BTAG *tag);

/* Reader of the elements in container `tag`. ERR_BTAG_NOCONTAINERTAG, ERR_BTAG_MAXNESTINGDEPTH. */
RTS_RESULT BTagReadContainer(const BTAG_READER *reader, const BTAG *tag, BTAG_READER *content);

/* The first element `id` at this level, wherever the reader stands, if it has min..max bytes. ERR_L7_TAG_MISSING,
 * ERR_SIZE_MISMATCH, ERR_BTAG_*. */
RTS_RESULT BTagFind(const BTAG_READER *reader, RTS_UI32 id, RTS_UI32 min, RTS_UI32 max, BTAG *tag);

/* The unsigned integer in an element of 1, 2 or 4 bytes; else ERR_SIZE_MISMATCH. */
RTS_RESULT BTagGetUnsigned(const BTAG *tag, RTS_UI32 *value);

/* The same of element `id`. */
RTS_RESULT BTagFindUnsigned(const BTAG_READER *reader, RTS_UI32 id, RTS_UI32 *value);

/* The same for an element that may be absent: *value is left alone then. */
RTS_RESULT BTagFindOptional(const BTAG_READER *reader, RTS_UI32 id, RTS_UI32 *value);

/* Reader of container `id`. */
RTS_RESULT BTagFindContainer(const BTAG_READER *reader, RTS_UI32 id, BTAG_READER *content);

/* Where the content of an element begins, modulo 4, counted from the start of the layer-7 content. */
typedef enum { BTAG_ALIGN_0 = 0, BTAG_ALIGN_2 = 2 } BTAG_ALIGN;

typedef struct {
    RTS_UI8 *data;
    RTS_UI32 capacity;
    RTS_UI32 size;
    RTS_UI32 depth;
    bool overflow;                    /* something did not fit; sticks, to be checked once at the end */
    RTS_UI32 open[BTAG_MAX_NESTING];  /* position of each open element */
    RTS_UI32 start[BTAG_MAX_NESTING]; /* position of its content */
} BTAG_WRITER;

void BTagWriterInit(BTAG_WRITER *writer, RTS_UI8 *data, RTS_UI32 capacity);

/* Begins an element (container or data) whose length is not known yet; Close fills it in. One that stayed empty
 * vanishes, because clients cannot read elements of length zero. */
void BTagOpen(BTAG_WRITER *writer, RTS_UI32 id, BTAG_ALIGN align);
void BTagClose(BTAG_WRITER *writer);

/* Appends to the open data element. */
void BTagAppend(BTAG_WRITER *writer, const void *data, RTS_UI32 size);
void BTagAppend16(BTAG_WRITER *writer, RTS_UI32 value);
void BTagAppend32(BTAG_WRITER *writer, RTS_UI32 value);
/* Appends `size` bytes for the caller to fill; NULL (and overflow) when they do not fit. */
RTS_UI8 *BTagReserve(BTAG_WRITER *writer, RTS_UI32 size);
void BTagAppendZeros(BTAG_WRITER *writer, RTS_UI32 size);
/* Zeros up to the next multiple of 4, so that the next element begins there. */
void BTagPad(BTAG_WRITER *writer);
/* At most `max` characters of text, NUL, padding. */
void BTagAppendText(BTAG_WRITER *writer, const char *text, RTS_UI32 max);

/* Whole elements. */
void BTagWrite(BTAG_WRITER *writer, RTS_UI32 id, BTAG_ALIGN align, const void *data, RTS_UI32 size);
void BTagWrite16(BTAG_WRITER *writer, RTS_UI32 id, RTS_UI32 value);
void BTagWrite32(BTAG_WRITER *writer, RTS_UI32 id, RTS_UI32 value);
void BTagWriteText(BTAG_WRITER *writer, RTS_UI32 id, const char *text, RTS_UI32 max);

/* Everything fits and every element has been closed. */
bool BTagIsComplete(const BTAG_WRITER *writer);

/* Bytes left for content. */
RTS_UI32 BTagGetRoom(const BTAG_WRITER *writer);

#endif
