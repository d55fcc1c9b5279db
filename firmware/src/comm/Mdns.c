/*
 * Mdns.c - messages of multicast DNS.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Names are compared in the form in which they are sent, without compression. Numbers are big-endian. A message is read
 * with an offset that never passes its size; a pointer in a name leads to lower offsets only, so reading a name ends.
 */
#include "Mdns.h"

#include <string.h>

#include "CMUtils.h"

enum {
    HEADER_SIZE = 12,
    NAME_SIZE = 256, /* RFC 1035: 255 bytes */
    MAX_LABEL = 63,
    POINTER = 0xC0,
    IS_RESPONSE = 0x80, /* in the byte of the header after the id */
    OPCODE = 0x78,
    RESPONSE_FLAGS = 0x8400, /* authoritative */
    QUERY_TAIL = 4,          /* type, class */
    RECORD_TAIL = 10,        /* type, class, ttl, size */
    SRV_HEAD = 6,            /* priority, weight, port */
    TYPE_A = 1,
    TYPE_PTR = 12,
    TYPE_TXT = 16,
    TYPE_SRV = 33,
    TYPE_ANY = 255,
    CLASS_IN = 1,
    CLASS_ANY = 255,
    CLASS_MASK = 0x7FFF,
    TOP_BIT = 0x8000, /* of a question: reply to the sender alone; of a record: there is no other one of this name */
    TTL_NAME_S = 120, /* of records with a host name or address; RFC 6762 section 10 */
    TTL_OTHER_S = 4500,
    TTL_LEGACY_S = 10,
};

typedef struct {
    RTS_UI8 bytes[NAME_SIZE];
    RTS_UI32 size;
} NAME;

typedef struct {
    const RTS_UI8 *data;
    RTS_UI32 size;
    RTS_UI32 at;
} READER;

typedef struct {
    RTS_UI8 *data;
    RTS_UI32 at; /* at most MDNS_REPLY_SIZE: what is written is bounded by the sizes of MDNS_DEVICE */
} WRITER;

/* Six names begin with a label of the device; what else records and the question have is less than 288 bytes. */
RTS_STATIC_ASSERT(HEADER_SIZE + 6 * MDNS_LABEL_SIZE + 288 + MDNS_TEXTS * MDNS_TEXT_SIZE <= MDNS_REPLY_SIZE,
                  a_reply_has_room);

/* ---- names ---- */

typedef enum { NAME_SERVICES, NAME_SERVICE, NAME_INSTANCE, NAME_HOST, NAMES } WHICH;

static void add_label(NAME *name, const char *label)
{
    RTS_UI32 length = CMUtlStrNLen(label, MAX_LABEL);

    name->bytes[name->size++] = (RTS_UI8)length;
    memcpy(name->bytes + name->size, label, length);
    name->size += length;
}

static void make_name(const MDNS_DEVICE *device, WHICH which, NAME *name)
{
    name->size = 0;
    if (which == NAME_SERVICES) {
        add_label(name, "_services");
        add_label(name, "_dns-sd");
        add_label(name, "_udp");
    } else if (which == NAME_HOST) {
        add_label(name, device->host);
    } else {
        if (which == NAME_INSTANCE)
            add_label(name, device->instance);
        add_label(name, MDNS_SERVICE);
        add_label(name, "_tcp");
    }
    add_label(name, "local");
    name->bytes[name->size++] = 0;
}

static RTS_UI8 lower(RTS_UI8 byte)
{
    return byte >= 'A' && byte <= 'Z' ? (RTS_UI8)(byte + 'a' - 'A') : byte;
}

/* Lengths of labels are below 'A'. */
static bool is_same(const NAME *one, const NAME *other)
{
    if (one->size != other->size)
        return false;
    for (RTS_UI32 i = 0; i < one->size; i++)
        if (lower(one->bytes[i]) != lower(other->bytes[i]))
            return false;
    return true;
}

static bool is_named(const MDNS_DEVICE *device, WHICH which, const NAME *name)
{
    NAME own;

    make_name(device, which, &own);
    return is_same(&own, name);
}

/* ---- reading ---- */

static RTS_UI32 get16(const RTS_UI8 *data)
{
    return (RTS_UI32)data[0] << 8 | data[1];
}

static RTS_UI32 get32(const RTS_UI8 *data)
{
    return get16(data) << 16 | get16(data + 2);
}

/* Follows a pointer at `*at`; false if it does not lead below `*lowest`, which becomes where it leads. */
static bool follow(const READER *reader, RTS_UI32 *at, RTS_UI32 *lowest)
{
    RTS_UI32 to;

    if (reader->size - *at < 2)
        return false;
    to = get16(reader->data + *at) & 0x3FFF;
    if (to >= *lowest)
        return false;
    *at = *lowest = to;
    return true;
}

/* Reads a name, and moves the reader past it. False if it is not a valid name. */
static bool read_name(READER *reader, NAME *name)
{
    RTS_UI32 at = reader->at;
    RTS_UI32 lowest = at;
    bool moved = false;

    name->size = 0;
    while (at < reader->size) {
        RTS_UI32 length = reader->data[at];
        if ((length & POINTER) == POINTER) {
            reader->at = moved ? reader->at : at + 2;
            moved = true;
            if (!follow(reader, &at, &lowest))
                return false;
            continue;
        }
        if (length > MAX_LABEL || length + 1 > reader->size - at || length + 1 > NAME_SIZE - name->size)
            return false;
        memcpy(name->bytes + name->size, reader->data + at, length + 1);
        name->size += length + 1;
        at += length + 1;
        if (length == 0) {
            reader->at = moved ? reader->at : at;
            return true;
        }
    }
    return false;
}

typedef struct {
    NAME name;
    RTS_UI32 type;
    RTS_UI32 class_and_bit;
} QUESTION;

static bool read_question(READER *reader, QUESTION *question)
{
    if (!read_name(reader, &question->name) || reader->size - reader->at < QUERY_TAIL)
        return false;
    question->type = get16(reader->data + reader->at);
    question->class_and_bit = get16(reader->data + reader->at + 2);
    reader->at += QUERY_TAIL;
    return true;
}

typedef struct {
    NAME name;
    RTS_UI32 type;
    RTS_UI32 class_and_bit;
    RTS_UI32 ttl_s;
    RTS_UI32 data_at;
    RTS_UI32 data_size;
} RECORD;

static bool read_record(READER *reader, RECORD *record)
{
    const RTS_UI8 *tail;

    if (!read_name(reader, &record->name) || reader->size - reader->at < RECORD_TAIL)
        return false;
    tail = reader->data + reader->at;
    record->type = get16(tail);
    record->class_and_bit = get16(tail + 2);
    record->ttl_s = get32(tail + 4);
    record->data_size = get16(tail + 8);
    record->data_at = reader->at + RECORD_TAIL;
    if (record->data_size > reader->size - record->data_at)
        return false;
    reader->at = record->data_at + record->data_size;
    return true;
}

/* The name in the data of a record, from an offset on; false if the data end before it does. */
static bool read_inner_name(const READER *reader, const RECORD *record, RTS_UI32 offset, NAME *name)
{
    READER inner = {reader->data, reader->size, record->data_at + offset};

    return offset <= record->data_size && read_name(&inner, name) && inner.at <= record->data_at + record->data_size;
}

typedef struct {
    bool is_response;
    RTS_UI32 questions;
    RTS_UI32 answers;
    RTS_UI32 authorities;
    RTS_UI32 others;
} HEADER;

/* False for messages that are not of multicast DNS: too short, or another operation. */
static bool read_header(READER *reader, HEADER *header)
{
    const RTS_UI8 *data = reader->data;

    if (reader->size < HEADER_SIZE || reader->size > MDNS_QUERY_SIZE || (data[2] & OPCODE) != 0)
        return false;
    header->is_response = (data[2] & IS_RESPONSE) != 0;
    header->questions = get16(data + 4);
    header->answers = get16(data + 6);
    header->authorities = get16(data + 8);
    header->others = get16(data + 10);
    reader->at = HEADER_SIZE;
    return true;
}

/* ---- writing ---- */

static void put8(WRITER *writer, RTS_UI32 value)
{
    writer->data[writer->at++] = (RTS_UI8)value;
}

static void put16(WRITER *writer, RTS_UI32 value)
{
    put8(writer, value >> 8);
    put8(writer, value & 0xFF);
}

static void put32(WRITER *writer, RTS_UI32 value)
{
    put16(writer, value >> 16);
    put16(writer, value & 0xFFFF);
}

static void put_name(WRITER *writer, const MDNS_DEVICE *device, WHICH which)
{
    NAME name;

    make_name(device, which, &name);
    memcpy(writer->data + writer->at, name.bytes, name.size);
    writer->at += name.size;
}

static void put_header(WRITER *writer, RTS_UI32 id, RTS_UI32 flags)
{
    memset(writer->data, 0, HEADER_SIZE);
    writer->at = 0;
    put16(writer, id);
    put16(writer, flags);
    writer->at = HEADER_SIZE;
}

/* One more of what the header counts at `place`. */
enum { COUNT_QUESTIONS = 4, COUNT_ANSWERS = 6, COUNT_AUTHORITIES = 8, COUNT_OTHERS = 10 };

static void count(WRITER *writer, RTS_UI32 place)
{
    writer->data[place + 1]++;
}

static void put_srv_data(WRITER *writer, const MDNS_DEVICE *device)
{
    put32(writer, 0);
    put16(writer, device->port);
    put_name(writer, device, NAME_HOST);
}

static void put_texts(WRITER *writer, const MDNS_DEVICE *device)
{
    RTS_UI32 begin = writer->at;

    for (RTS_UI32 i = 0; i < MDNS_TEXTS; i++) {
        RTS_UI32 length = CMUtlStrNLen(device->text[i], MDNS_TEXT_SIZE - 1);
        if (length == 0)
            continue;
        put8(writer, length);
        memcpy(writer->data + writer->at, device->text[i], length);
        writer->at += length;
    }
    if (writer->at == begin)
        put8(writer, 0); /* RFC 6763: an empty string at least */
}

/* The records of a device, in the order in which they are sent. */
typedef enum { RECORD_LIST, RECORD_POINTER, RECORD_SRV, RECORD_TXT, RECORD_A, RECORDS } WHICH_RECORD;

static const struct {
    RTS_UI8 name;
    RTS_UI8 type;
    bool unique;
    RTS_UI16 ttl_s;
} record_kinds[RECORDS] = {
    [RECORD_LIST] = {NAME_SERVICES, TYPE_PTR, false, TTL_OTHER_S},
    [RECORD_POINTER] = {NAME_SERVICE, TYPE_PTR, false, TTL_OTHER_S},
    [RECORD_SRV] = {NAME_INSTANCE, TYPE_SRV, true, TTL_NAME_S},
    [RECORD_TXT] = {NAME_INSTANCE, TYPE_TXT, true, TTL_OTHER_S},
    [RECORD_A] = {NAME_HOST, TYPE_A, true, TTL_NAME_S},
};

static void put_data(WRITER *writer, const MDNS_DEVICE *device, WHICH_RECORD which)
{
    if (which == RECORD_LIST)
        put_name(writer, device, NAME_SERVICE);
    else if (which == RECORD_POINTER)
        put_name(writer, device, NAME_INSTANCE);
    else if (which == RECORD_SRV)
        put_srv_data(writer, device);
    else if (which == RECORD_TXT)
        put_texts(writer, device);
    else
        put32(writer, device->ip);
}

static void put_record(WRITER *writer, const MDNS_DEVICE *device, WHICH_RECORD which, RTS_UI32 ttl_s, bool flush)
{
    RTS_UI32 size_at;

    put_name(writer, device, (WHICH)record_kinds[which].name);
    put16(writer, record_kinds[which].type);
    put16(writer, CLASS_IN | (flush && record_kinds[which].unique ? TOP_BIT : 0));
    put32(writer, ttl_s);
    size_at = writer->at;
    put16(writer, 0);
    put_data(writer, device, which);
    RTS_UI32 size = writer->at - size_at - 2;
    writer->data[size_at] = (RTS_UI8)(size >> 8);
    writer->data[size_at + 1] = (RTS_UI8)size;
}

/* ---- a query ---- */

static RTS_UI32 bit_of(WHICH_RECORD which)
{
    return 1u << which;
}

/* The records that a question asks for, a bit for each. */
static RTS_UI32 find_asked(const MDNS_DEVICE *device, const QUESTION *question)
{
    RTS_UI32 class_asked = question->class_and_bit & CLASS_MASK;
    RTS_UI32 asked = 0;

    if (class_asked != CLASS_IN && class_asked != CLASS_ANY)
        return 0;
    for (RTS_UI32 i = 0; i < RECORDS; i++) {
        bool type_matches = question->type == record_kinds[i].type || question->type == TYPE_ANY;
        if (type_matches && is_named(device, (WHICH)record_kinds[i].name, &question->name))
            asked |= bit_of((WHICH_RECORD)i);
    }
    return asked;
}

/* What goes with the answers, so that the sender need not ask again. */
static RTS_UI32 find_related(RTS_UI32 asked)
{
    RTS_UI32 related = 0;

    if ((asked & bit_of(RECORD_POINTER)) != 0)
        related = bit_of(RECORD_SRV) | bit_of(RECORD_TXT) | bit_of(RECORD_A);
    else if ((asked & bit_of(RECORD_SRV)) != 0)
        related = bit_of(RECORD_A);
    return related & ~asked;
}

/* The records that the sender has, with half of their time left at least. */
static RTS_UI32 find_known(const MDNS_DEVICE *device, READER *reader, RTS_UI32 answers)
{
    RECORD record;
    NAME inner;
    RTS_UI32 known = 0;

    while (answers-- > 0 && read_record(reader, &record)) {
        if (record.type != TYPE_PTR || record.ttl_s < TTL_OTHER_S / 2 || !read_inner_name(reader, &record, 0, &inner))
            continue;
        for (RTS_UI32 i = RECORD_LIST; i <= RECORD_POINTER; i++) {
            WHICH leads_to = i == RECORD_LIST ? NAME_SERVICE : NAME_INSTANCE;
            if (is_named(device, (WHICH)record_kinds[i].name, &record.name) && is_named(device, leads_to, &inner))
                known |= bit_of((WHICH_RECORD)i);
        }
    }
    return known;
}

static void put_question(WRITER *writer, const QUESTION *question)
{
    memcpy(writer->data + writer->at, question->name.bytes, question->name.size);
    writer->at += question->name.size;
    put16(writer, question->type);
    put16(writer, question->class_and_bit);
    count(writer, COUNT_QUESTIONS);
}

static void put_records(WRITER *writer, const MDNS_DEVICE *device, RTS_UI32 records, RTS_UI32 place, bool legacy)
{
    for (RTS_UI32 i = 0; i < RECORDS; i++) {
        RTS_UI32 ttl_s = legacy ? TTL_LEGACY_S : record_kinds[i].ttl_s;
        if ((records & bit_of((WHICH_RECORD)i)) == 0)
            continue;
        put_record(writer, device, (WHICH_RECORD)i, ttl_s, !legacy);
        count(writer, place);
    }
}

MDNS_RECEIVER MdnsReply(const MDNS_DEVICE *device, const RTS_UI8 *query, RTS_UI32 size, RTS_UI16 port, RTS_UI8 *reply,
                        RTS_UI32 *reply_size)
{
    READER reader = {query, size, 0};
    WRITER writer = {reply, 0};
    bool legacy = port != MDNS_PORT;
    bool all_want_unicast = true;
    RTS_UI32 asked = 0;
    HEADER header;
    QUESTION question;
    QUESTION first;

    if (!read_header(&reader, &header) || header.is_response)
        return MDNS_SILENCE;
    for (; header.questions > 0; header.questions--) {
        if (!read_question(&reader, &question))
            return MDNS_SILENCE;
        RTS_UI32 records = find_asked(device, &question);
        if (records != 0 && asked == 0)
            first = question;
        if (records != 0 && (question.class_and_bit & TOP_BIT) == 0)
            all_want_unicast = false;
        asked |= records;
    }
    asked &= ~find_known(device, &reader, header.answers);
    if (asked == 0)
        return MDNS_SILENCE;
    put_header(&writer, legacy ? get16(query) : 0, RESPONSE_FLAGS);
    if (legacy)
        put_question(&writer, &first);
    put_records(&writer, device, asked, COUNT_ANSWERS, legacy);
    put_records(&writer, device, find_related(asked), COUNT_OTHERS, legacy);
    *reply_size = writer.at;
    return legacy || all_want_unicast ? MDNS_TO_SENDER : MDNS_TO_ALL;
}

/* ---- its own messages ---- */

static void put_any(WRITER *writer, const MDNS_DEVICE *device, WHICH which)
{
    put_name(writer, device, which);
    put16(writer, TYPE_ANY);
    put16(writer, CLASS_IN | TOP_BIT);
    count(writer, COUNT_QUESTIONS);
}

RTS_UI32 MdnsProbe(const MDNS_DEVICE *device, RTS_UI8 *message)
{
    WRITER writer = {message, 0};

    put_header(&writer, 0, 0);
    put_any(&writer, device, NAME_INSTANCE);
    put_any(&writer, device, NAME_HOST);
    put_record(&writer, device, RECORD_SRV, TTL_NAME_S, false);
    put_record(&writer, device, RECORD_A, TTL_NAME_S, false);
    count(&writer, COUNT_AUTHORITIES);
    count(&writer, COUNT_AUTHORITIES);
    return writer.at;
}

RTS_UI32 MdnsAnnounce(const MDNS_DEVICE *device, bool leaves, RTS_UI8 *message)
{
    WRITER writer = {message, 0};

    put_header(&writer, 0, RESPONSE_FLAGS);
    for (RTS_UI32 i = RECORD_POINTER; i < RECORDS; i++) {
        put_record(&writer, device, (WHICH_RECORD)i, leaves ? 0 : record_kinds[i].ttl_s, true);
        count(&writer, COUNT_ANSWERS);
    }
    return writer.at;
}

/* ---- names of others ---- */

/* The data of a record as they are without compression; false if they are not valid. */
static bool expand(const READER *reader, const RECORD *record, RTS_UI8 *data, RTS_UI32 *size)
{
    NAME host;

    if (record->type != TYPE_SRV) {
        *size = record->data_size;
        memcpy(data, reader->data + record->data_at, *size);
        return true;
    }
    if (!read_inner_name(reader, record, SRV_HEAD, &host))
        return false;
    memcpy(data, reader->data + record->data_at, SRV_HEAD);
    memcpy(data + SRV_HEAD, host.bytes, host.size);
    *size = SRV_HEAD + host.size;
    return true;
}

/* Compares a record with this device's: 0: the same, or not about one of its names; 1: the other's comes later in the
 * order of RFC 6762 section 8.2, -1: before. */
static int compare(const MDNS_DEVICE *device, const READER *reader, const RECORD *record, bool own_host)
{
    RTS_UI8 theirs[MDNS_QUERY_SIZE];
    RTS_UI8 ours[SRV_HEAD + NAME_SIZE];
    WRITER writer = {ours, 0};
    WHICH_RECORD which = record->type == TYPE_SRV ? RECORD_SRV : RECORD_A;
    RTS_UI32 size;

    if ((record->type != TYPE_SRV && (record->type != TYPE_A || own_host)) ||
        (record->class_and_bit & CLASS_MASK) != CLASS_IN ||
        !is_named(device, (WHICH)record_kinds[which].name, &record->name) || !expand(reader, record, theirs, &size))
        return 0;
    put_data(&writer, device, which);
    int order = memcmp(theirs, ours, size < writer.at ? size : writer.at);
    if (order == 0)
        order = (int)size - (int)writer.at;
    return order > 0 ? 1 : order < 0 ? -1 : 0;
}

MDNS_CLASH MdnsFindClash(const MDNS_DEVICE *device, const RTS_UI8 *message, RTS_UI32 size, bool own_host)
{
    READER reader = {message, size, 0};
    HEADER header;
    QUESTION question;
    RECORD record;
    MDNS_CLASH clash = MDNS_NO_CLASH;

    if (!read_header(&reader, &header))
        return MDNS_NO_CLASH;
    for (; header.questions > 0; header.questions--)
        if (!read_question(&reader, &question))
            return MDNS_NO_CLASH;
    RTS_UI32 records = header.answers + header.authorities + (header.is_response ? header.others : 0);
    for (RTS_UI32 i = 0; i < records && clash == MDNS_NO_CLASH && read_record(&reader, &record); i++) {
        int order = compare(device, &reader, &record, own_host);
        if (header.is_response && order != 0 && record.ttl_s != 0)
            clash = MDNS_TAKEN;
        else if (!header.is_response && i >= header.answers && order > 0)
            clash = MDNS_RACE;
    }
    return clash;
}

/* ---- labels ---- */

static char label_char(char character, bool host)
{
    bool letter = (character >= 'a' && character <= 'z') || (character >= 'A' && character <= 'Z') ||
                  (character >= '0' && character <= '9');
    bool printable = (RTS_UI8)character >= ' ' && character != 0x7F;

    return letter || (!host && printable) ? character : '-';
}

/* The bytes of the character of UTF-8 that `text` of `size` bytes begins with; 0 if they are not a whole one. */
static RTS_UI32 char_size(const char *text, RTS_UI32 size)
{
    RTS_UI8 first = (RTS_UI8)text[0];
    RTS_UI32 length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;

    if (length > size)
        return 0;
    for (RTS_UI32 i = 1; i < length; i++)
        if (((RTS_UI8)text[i] & 0xC0) != 0x80)
            return 0;
    return length;
}

void MdnsMakeLabel(char label[MDNS_LABEL_SIZE], const char *name, RTS_UI32 number, bool host)
{
    char suffix[16] = "";
    RTS_UI32 size = CMUtlStrNLen(name, MDNS_LABEL_SIZE);
    RTS_UI32 length = 0;

    if (number > 1)
        (void)CMUtlsnprintf(suffix, sizeof(suffix), host ? "-%u" : " (%u)", (unsigned)number);
    RTS_UI32 room = MDNS_LABEL_SIZE - 1 - (RTS_UI32)strlen(suffix);
    for (RTS_UI32 at = 0; at < size;) {
        RTS_UI32 bytes = char_size(name + at, size - at);
        RTS_UI32 end = at + (bytes != 0 ? bytes : 1);
        if (end > room)
            break;
        for (; at < end; at++)
            label[length++] = bytes != 0 ? label_char(name[at], host) : '-';
    }
    if (length == 0)
        label[length++] = '-';
    memcpy(label + length, suffix, strlen(suffix) + 1);
}
