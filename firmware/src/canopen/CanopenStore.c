/*
 * CanopenStore.c - what a CANopen device keeps over power-off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenStore.h"

#include <string.h>

#include "CmpChecksum.h"
#include "FileStore.h"
#include "SysLock.h"

#if CANOPEN_DEVICE_DATA > 0

#if FILE_STORE_FILES > 0

enum { MAGIC = 0x44504F43, CHUNK = 32 };

typedef struct {
    RTS_UI32 magic;
    RTS_UI32 dictionary; /* CRC-32 */
    RTS_UI32 parts;
    RTS_UI32 settings_size;
    RTS_UI32 values_size;
} HEAD;

typedef struct {
    RTS_UI32 magic;
    RTS_UI32 node;
} STORED_NODE;

void CanopenStoreOpen(void)
{
    FileStoreOpen();
}

static RTS_UI32 get_dictionary_crc(const CANOPEN_SLAVE *slave)
{
    RTS_UI32 crc = CRC32Update(0, slave->objects, slave->object_count * sizeof(*slave->objects));

    for (RTS_UI32 i = 0; i < CANOPEN_DIRECTIONS; i++)
        crc = CRC32Update(crc, slave->defaults[i], slave->pdo_count[i] * sizeof(*slave->defaults[i]));
    return crc;
}

static bool is_stored(const CANOPEN_OBJECT *object)
{
    return object->where == CANOPEN_IN_VALUES && (object->access & CANOPEN_ACCESS_STORED) != 0;
}

static RTS_UI32 get_values_size(const CANOPEN_SLAVE *slave)
{
    RTS_UI32 size = 0;

    for (RTS_UI32 i = 0; i < slave->object_count; i++)
        size += is_stored(&slave->objects[i]) ? slave->objects[i].size : 0;
    return size;
}

static HEAD make_head(const CANOPEN_SLAVE *slave, RTS_UI32 parts)
{
    return (HEAD){MAGIC, get_dictionary_crc(slave), parts, sizeof(slave->settings), get_values_size(slave)};
}

/* The parts that are stored for this dictionary; `entry`: the file. */
static RTS_UI32 get_parts(const CANOPEN_SLAVE *slave, FILE_ENTRY *entry)
{
    const FILE_ENTRY *found = FileStoreFind(CANOPEN_STORE_FILE);
    HEAD head;

    if (found == NULL)
        return 0;
    *entry = *found;
    if (FileStoreRead(entry, 0, &head, sizeof(head)) != ERR_OK)
        return 0;
    const HEAD expected = make_head(slave, head.parts);
    RTS_UI32 size = sizeof(head) + ((head.parts & CANOPEN_PART_SETTINGS) != 0 ? expected.settings_size : 0) +
                    ((head.parts & CANOPEN_PART_VALUES) != 0 ? expected.values_size : 0);
    return memcmp(&head, &expected, sizeof(head)) == 0 && entry->size == size ? head.parts : 0;
}

/* Where a part is in a file with these parts. */
static RTS_UI32 get_place(const CANOPEN_SLAVE *slave, RTS_UI32 parts, RTS_UI32 part)
{
    bool is_second = part == CANOPEN_PART_VALUES && (parts & CANOPEN_PART_SETTINGS) != 0;

    return sizeof(HEAD) + (is_second ? sizeof(slave->settings) : 0);
}

/* ---- writing ---- */

typedef struct {
    RTS_RESULT result;
    RTS_UI32 crc;
} OUTPUT;

static void put(OUTPUT *output, const void *data, RTS_UI32 size)
{
    if (output->result == ERR_OK)
        output->result = FileStoreWrite(data, size);
    output->crc = CRC32Update(output->crc, data, size);
}

static void put_values(OUTPUT *output, const CANOPEN_SLAVE *slave)
{
    RTS_UI8 data[CHUNK];

    for (RTS_UI32 i = 0; i < slave->object_count; i++) {
        const CANOPEN_OBJECT *object = &slave->objects[i];
        for (RTS_UI32 at = 0; is_stored(object) && at < object->size; at += CHUNK) {
            RTS_UI32 size = object->size - at < CHUNK ? object->size - at : CHUNK;
            RTS_UI32 lock = SysLockEnter();
            memcpy(data, slave->values + object->place + at, size);
            SysLockLeave(lock);
            put(output, data, size);
        }
    }
}

/* A part of the previous file. */
static void put_previous(OUTPUT *output, const FILE_ENTRY *entry, RTS_UI32 place, RTS_UI32 size)
{
    RTS_UI8 data[CHUNK];

    for (RTS_UI32 at = 0; at < size && output->result == ERR_OK; at += CHUNK) {
        RTS_UI32 part = size - at < CHUNK ? size - at : CHUNK;
        output->result = FileStoreRead(entry, place + at, data, part);
        if (output->result == ERR_OK)
            put(output, data, part);
    }
}

static void put_part(OUTPUT *output, const CANOPEN_SLAVE *slave, RTS_UI32 part, bool is_new, const FILE_ENTRY *entry,
                     RTS_UI32 previous)
{
    bool is_settings = part == CANOPEN_PART_SETTINGS;

    if (!is_new)
        put_previous(output, entry, get_place(slave, previous, part),
                     is_settings ? sizeof(slave->settings) : get_values_size(slave));
    else if (is_settings)
        put(output, &slave->settings, sizeof(slave->settings));
    else
        put_values(output, slave);
}

/* Makes a file of new parts and of some that are in the previous one. */
static RTS_RESULT write_parts(const CANOPEN_SLAVE *slave, RTS_UI32 news, RTS_UI32 parts, const FILE_ENTRY *entry,
                              RTS_UI32 previous)
{
    const HEAD head = make_head(slave, parts);
    OUTPUT output = {FileStoreCreate(CANOPEN_STORE_FILE), 0};

    if (output.result != ERR_OK)
        return output.result;
    put(&output, &head, sizeof(head));
    for (RTS_UI32 part = CANOPEN_PART_SETTINGS; part <= CANOPEN_PART_VALUES; part++)
        if ((parts & part) != 0)
            put_part(&output, slave, part, (news & part) != 0, entry, previous);
    if (output.result == ERR_OK)
        output.result = FileStoreFinish(output.crc);
    else
        FileStoreAbort();
    return output.result;
}

RTS_RESULT CanopenStoreSave(const CANOPEN_SLAVE *slave, RTS_UI32 parts)
{
    FILE_ENTRY entry;
    RTS_UI32 previous = get_parts(slave, &entry);

    return FileStoreIsWriting() ? (RTS_RESULT)ERR_INVALID_STATE
                                : write_parts(slave, parts, parts | previous, &entry, previous);
}

RTS_RESULT CanopenStoreForget(const CANOPEN_SLAVE *slave, RTS_UI32 parts)
{
    FILE_ENTRY entry;
    RTS_UI32 previous = get_parts(slave, &entry);

    if (FileStoreIsWriting())
        return ERR_INVALID_STATE;
    if ((previous & ~parts) != 0)
        return write_parts(slave, 0, previous & ~parts, &entry, previous);
    return FileStoreFind(CANOPEN_STORE_FILE) == NULL ? (RTS_RESULT)ERR_OK : FileStoreDelete(CANOPEN_STORE_FILE);
}

/* ---- reading ---- */

static void load_values(const CANOPEN_SLAVE *slave, const FILE_ENTRY *entry, RTS_UI32 place)
{
    RTS_UI8 data[CHUNK];

    for (RTS_UI32 i = 0; i < slave->object_count; i++) {
        const CANOPEN_OBJECT *object = &slave->objects[i];
        for (RTS_UI32 at = 0; is_stored(object) && at < object->size; at += CHUNK) {
            RTS_UI32 size = object->size - at < CHUNK ? object->size - at : CHUNK;
            if (FileStoreRead(entry, place, data, size) != ERR_OK)
                return;
            place += size;
            RTS_UI32 lock = SysLockEnter();
            memcpy(slave->values + object->place + at, data, size);
            if (at == 0 && object->type != CANOPEN_VISIBLE_STRING && CanopenIsNarrow(size))
                CanopenWiden(slave->values + object->place, size, CanopenIsSigned(object));
            SysLockLeave(lock);
        }
    }
}

void CanopenStoreLoad(CANOPEN_SLAVE *slave, RTS_UI32 part)
{
    CANOPEN_SETTINGS settings;
    FILE_ENTRY entry;
    RTS_UI32 parts = (slave->flags & CANOPEN_DEVICE_STORE) != 0 ? get_parts(slave, &entry) : 0;
    RTS_UI32 place = get_place(slave, parts, part);

    if ((parts & part) == 0)
        return;
    if (part == CANOPEN_PART_VALUES) {
        load_values(slave, &entry, place);
        slave->written += get_values_size(slave) != 0;
    } else if (FileStoreRead(&entry, place, &settings, sizeof(settings)) == ERR_OK) {
        slave->settings = settings;
    }
}

/* ---- the node number ---- */

RTS_RESULT CanopenStoreNode(RTS_UI8 node)
{
    const STORED_NODE stored = {MAGIC, node};

    if (FileStoreIsWriting())
        return ERR_INVALID_STATE;
    RTS_RESULT result = FileStoreBegin(CANOPEN_NODE_FILE, sizeof(stored), CRC32Update(0, &stored, sizeof(stored)));
    if (result == ERR_OK)
        result = FileStoreWrite((const RTS_UI8 *)&stored, sizeof(stored));
    return result == ERR_OK ? FileStoreEnd() : result;
}

RTS_UI8 CanopenStoredNode(void)
{
    const FILE_ENTRY *found = FileStoreFind(CANOPEN_NODE_FILE);
    STORED_NODE stored;

    if (found == NULL || found->size != sizeof(stored) || FileStoreRead(found, 0, &stored, sizeof(stored)) != ERR_OK ||
        stored.magic != MAGIC || (stored.node > CANOPEN_MAX_NODE && stored.node != CANOPEN_NO_NODE))
        return 0;
    return (RTS_UI8)stored.node;
}

#else

void CanopenStoreOpen(void)
{
}

RTS_RESULT CanopenStoreSave(const CANOPEN_SLAVE *slave, RTS_UI32 parts)
{
    RTS_UNUSED(slave);
    RTS_UNUSED(parts);
    return ERR_NOT_SUPPORTED;
}

RTS_RESULT CanopenStoreForget(const CANOPEN_SLAVE *slave, RTS_UI32 parts)
{
    RTS_UNUSED(slave);
    RTS_UNUSED(parts);
    return ERR_NOT_SUPPORTED;
}

void CanopenStoreLoad(CANOPEN_SLAVE *slave, RTS_UI32 part)
{
    RTS_UNUSED(slave);
    RTS_UNUSED(part);
}

RTS_RESULT CanopenStoreNode(RTS_UI8 node)
{
    RTS_UNUSED(node);
    return ERR_NOT_SUPPORTED;
}

RTS_UI8 CanopenStoredNode(void)
{
    return 0;
}

#endif

#endif
