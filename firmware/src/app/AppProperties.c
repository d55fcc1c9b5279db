/*
 * AppProperties.c - finds properties of the project in the application info segment.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * After IMAGE_INFO_COUNT strings and a date each property is a string, whose first character is its type and whose others
 * are the key, and the value: a string, or the bytes of a number. All begin at multiples of 4. Other tools make images
 * too, so nothing here relies on what plctool writes.
 */
#include "AppProperties.h"

#include "../load/AppLoaded.h"
#include "AppLife.h"
#include "CmpAppEmbedded.h"
#include "CompactDownload.h"
#include "SysFileFlash.h"

enum { DATE_SIZE = 4, TYPE_TEXT = 'T', TYPE_NUMBER = 'N', TYPE_BOOL = 'B', TYPE_VERSION = 'V' };

typedef struct {
    RTS_UI32 file;
    RTS_UI32 offset;
    RTS_UI32 end;
} READER;

/* Reads a character; NUL past the end, where *error then is ERR_PARAMETER. */
static char next(READER *reader, RTS_RESULT *error)
{
    char c = '\0';

    if (reader->offset >= reader->end)
        *error = ERR_PARAMETER;
    else if (SysFileRead(reader->file, reader->offset++, &c, 1) != ERR_OK)
        *error = ERR_DEVICE;
    return c;
}

static void align(READER *reader)
{
    reader->offset = (reader->offset + 3) & ~3u;
}

/* Copies a string, cut to `size` bytes; size 0: reads over it. True if it is `wanted`, from its `skip`-th character on. */
static bool read_string(READER *reader, RTS_RESULT *error, const char *wanted, RTS_SIZE skip, char *text, RTS_SIZE size)
{
    bool same = true;
    RTS_SIZE length = 0;
    char c;

    while ((c = next(reader, error)) != '\0') {
        if (length + 1 < size)
            text[length] = c;
        if (length >= skip && same) {
            same = *wanted == c;
            wanted += same;
        }
        length++;
    }
    if (size > 0)
        text[length + 1 < size ? length : size - 1] = '\0';
    align(reader);
    return same && length >= skip && *wanted == '\0';
}

static void pass_value(READER *reader, RTS_RESULT *error, char type)
{
    if (type == TYPE_NUMBER)
        reader->offset += (RTS_UI32)sizeof(RTS_REAL64);
    else if (type == TYPE_BOOL)
        reader->offset += 4;
    else
        (void)read_string(reader, error, "", 0, NULL, 0);
}

/* Leads the reader to the value of a property of the type. */
static RTS_RESULT find(READER *reader, const char *key, char wanted)
{
    const APP_IMAGE *image = AppGetImage();
    RTS_RESULT error = ERR_OK;
    RTS_UI32 i;

    if (image->size == 0)
        return ERR_APP_NOT_LOADED;
    if (image->info.size == 0)
        return ERR_NO_OBJECT;
    *reader = (READER){image->file, image->info.offset, image->info.offset + image->info.size};
    for (i = 0; i < IMAGE_INFO_COUNT && error == ERR_OK; i++)
        (void)read_string(reader, &error, "", 0, NULL, 0);
    reader->offset += DATE_SIZE;
    while (error == ERR_OK && reader->offset < reader->end) {
        char type[2];

        if (read_string(reader, &error, key, 1, type, sizeof type) && error == ERR_OK)
            return type[0] == wanted ? ERR_OK : ERR_TYPE_MISMATCH;
        pass_value(reader, &error, type[0]);
    }
    return error != ERR_OK ? error : (RTS_RESULT)ERR_NO_OBJECT;
}

static RTS_RESULT get_text(const char *key, char type, char *text, RTS_SIZE size)
{
    READER reader;
    RTS_RESULT result = find(&reader, key, type);

    text[0] = '\0';
    if (result == ERR_OK)
        (void)read_string(&reader, &result, "", 0, text, size);
    if (result != ERR_OK)
        text[0] = '\0';
    return result;
}

RTS_RESULT AppGetTextProperty(const char *key, char *text, RTS_SIZE size)
{
    return get_text(key, TYPE_TEXT, text, size);
}

RTS_RESULT AppGetVersionProperty(const char *key, char *text, RTS_SIZE size)
{
    return get_text(key, TYPE_VERSION, text, size);
}

static RTS_RESULT get_bytes(const char *key, char type, void *value, RTS_UI32 size)
{
    READER reader;
    RTS_RESULT result = find(&reader, key, type);

    if (result != ERR_OK)
        return result;
    if (reader.end < size || reader.offset > reader.end - size)
        return ERR_PARAMETER;
    return SysFileRead(reader.file, reader.offset, value, size);
}

RTS_RESULT AppGetNumberProperty(const char *key, RTS_REAL64 *number)
{
    return get_bytes(key, TYPE_NUMBER, number, sizeof *number);
}

RTS_RESULT AppGetBooleanProperty(const char *key, bool *value)
{
    RTS_UI8 byte;
    RTS_RESULT result = get_bytes(key, TYPE_BOOL, &byte, sizeof byte);

    if (result == ERR_OK)
        *value = byte != 0;
    return result;
}
