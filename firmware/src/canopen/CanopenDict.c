/*
 * CanopenDict.c - the object dictionary of a CANopen device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenDict.h"

#include <stddef.h>
#include <string.h>

enum {
    RO = CANOPEN_ACCESS_READ,
    RW = CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE,
    PDO_SUBS = 5,
    START = 6, /* of a TPDO */
    COB = 1,
    KIND = 2,
    INHIBIT = 3,
    PDO_SPACE = 0x200, /* objects from 1400h to 1600h and so on */
    MOST_VALUES = CANOPEN_SIGNED - 1,
};

#if CANOPEN_DEVICE_DATA > 0

#define U8_CONSTANT(index, sub, value) {index, sub, CANOPEN_UNSIGNED8, RO, CANOPEN_CONSTANT, 1, value}
#define LIVE(index, sub, type, access, size, what) {index, sub, type, access, CANOPEN_LIVE, size, what}
#define SETTING_U16(index, sub, field) \
    {index, sub, CANOPEN_UNSIGNED16, RW, CANOPEN_SETTING, 2, offsetof(CANOPEN_SETTINGS, field)}
#define SETTING_U32(index, sub, field) \
    {index, sub, CANOPEN_UNSIGNED32, RW, CANOPEN_SETTING, 4, offsetof(CANOPEN_SETTINGS, field)}
#define HISTORY(sub) LIVE(OBJECT_HISTORY, sub, CANOPEN_UNSIGNED32, RO, 4, LIVE_HISTORY)
#define STORE(index, sub, what) LIVE(index, sub, CANOPEN_UNSIGNED32, RW, 4, what)

static const CANOPEN_OBJECT fixed[] = {
    LIVE(OBJECT_REGISTER, 0, CANOPEN_UNSIGNED8, RO, 1, LIVE_REGISTER),
    LIVE(OBJECT_HISTORY, 0, CANOPEN_UNSIGNED8, RW, 1, LIVE_HISTORY),
    HISTORY(1),
    HISTORY(2),
    HISTORY(3),
    HISTORY(4),
    HISTORY(5),
    HISTORY(6),
    HISTORY(7),
    HISTORY(8),
    SETTING_U32(OBJECT_SYNC, 0, sync_cob),
    U8_CONSTANT(OBJECT_STORE, 0, 3),
    STORE(OBJECT_STORE, 1, LIVE_STORE),
    STORE(OBJECT_STORE, 2, LIVE_STORE),
    STORE(OBJECT_STORE, 3, LIVE_STORE),
    U8_CONSTANT(OBJECT_RESTORE, 0, 3),
    STORE(OBJECT_RESTORE, 1, LIVE_RESTORE),
    STORE(OBJECT_RESTORE, 2, LIVE_RESTORE),
    STORE(OBJECT_RESTORE, 3, LIVE_RESTORE),
    SETTING_U32(OBJECT_EMCY, 0, emcy_cob),
    SETTING_U16(OBJECT_EMCY_INHIBIT, 0, emcy_inhibit),
    U8_CONSTANT(OBJECT_CONSUMER, 0, 1),
    SETTING_U32(OBJECT_CONSUMER, 1, consumer),
    SETTING_U16(OBJECT_HEARTBEAT, 0, heartbeat_ms),
    LIVE(OBJECT_IDENTITY, 4, CANOPEN_UNSIGNED32, RO, 4, LIVE_SERIAL),
    {OBJECT_SYNC_COUNTER, 0, CANOPEN_UNSIGNED8, RW, CANOPEN_SETTING, 1, offsetof(CANOPEN_SETTINGS, sync_counter)},
    U8_CONSTANT(OBJECT_VERIFY, 0, 2),
    SETTING_U32(OBJECT_VERIFY, 1, date),
    SETTING_U32(OBJECT_VERIFY, 2, time),
    U8_CONSTANT(OBJECT_ON_ERROR, 0, 1),
    {OBJECT_ON_ERROR, 1, CANOPEN_UNSIGNED8, RW, CANOPEN_SETTING, 1, offsetof(CANOPEN_SETTINGS, on_error)},
};

bool CanopenDictGetFixed(RTS_UI32 number, CANOPEN_OBJECT *object)
{
    if (number >= RTS_COUNT(fixed))
        return false;
    *object = fixed[number];
    return true;
}

/* ---- the table of the image ---- */

static RTS_UI32 key_of(RTS_UI32 index, RTS_UI32 sub)
{
    return index << 8 | sub;
}

/* The first entry that is not before a key. */
static RTS_UI32 search(const CANOPEN_SLAVE *slave, RTS_UI32 key)
{
    RTS_UI32 low = 0;
    RTS_UI32 high = slave->object_count;

    while (low < high) {
        RTS_UI32 middle = (low + high) / 2;
        if (key_of(slave->objects[middle].index, slave->objects[middle].sub) < key)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static RTS_UI32 get_wide(RTS_UI32 size)
{
    return size < 4 ? 4 : 8;
}

bool CanopenIsNarrow(RTS_UI32 size)
{
    return size < 8 && (size & (size - 1)) != 0;
}

bool CanopenIsSigned(const CANOPEN_OBJECT *object)
{
    return object->type < CANOPEN_UNSIGNED24;
}

void CanopenWiden(RTS_UI8 *value, RTS_UI32 size, bool is_signed)
{
    memset(value + size, is_signed && value[size - 1] >> 7 != 0 ? 0xFF : 0, get_wide(size) - size);
}

static bool is_program_good(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object)
{
#if CANOPEN_PROGRAM_DOWNLOAD
    return slave->program != NULL && object->place < PROGRAM_OBJECTS &&
           (object->place != PROGRAM_DATA || (object->access & CANOPEN_ACCESS_READ) == 0);
#else
    RTS_UNUSED(slave);
    RTS_UNUSED(object);
    return false;
#endif
}

static bool is_object_good(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object)
{
    bool is_text = object->type == CANOPEN_VISIBLE_STRING;
    RTS_UI32 room = slave->values_size;
    RTS_UI32 size = object->size;

    if (object->size == 0 || object->size > CANOPEN_DEVICE_SDO)
        return false;
    if (object->where == CANOPEN_PROGRAM_OBJECT)
        return is_program_good(slave, object);
    if (object->where == CANOPEN_TEXT)
        room = slave->texts_size;
    else if (object->where != CANOPEN_IN_VALUES)
        return (object->where == CANOPEN_CONSTANT || object->where == CANOPEN_OF_NODE) &&
               object->size <= sizeof(object->place) && (object->access & CANOPEN_ACCESS_WRITE) == 0;
    else if (is_text)
        room = room > 0 ? room - 1 : 0;
    else if (CanopenIsNarrow(object->size))
        size = get_wide(size);
    return object->place <= room && size <= room - object->place &&
           (object->where == CANOPEN_IN_VALUES || (object->access & CANOPEN_ACCESS_WRITE) == 0);
}

bool CanopenDictIsGood(const CANOPEN_SLAVE *slave)
{
    RTS_UI32 last = 0;

    if (slave->values_size > MOST_VALUES)
        return false;
    for (RTS_UI32 i = 0; i < slave->object_count; i++) {
        RTS_UI32 key = key_of(slave->objects[i].index, slave->objects[i].sub);
        if (key <= last || !is_object_good(slave, &slave->objects[i]))
            return false;
        last = key;
    }
    return true;
}

/* ---- finding ---- */

static RTS_UI32 find_pdo(RTS_UI16 index, RTS_UI8 sub, CANOPEN_OBJECT *found)
{
    bool is_tpdo = index >= OBJECT_TPDO;
    bool is_mapping = ((index - OBJECT_RPDO) / PDO_SPACE & 1) != 0;

    *found = (CANOPEN_OBJECT){index, sub, CANOPEN_UNSIGNED8, RW, CANOPEN_LIVE, 1, is_mapping ? LIVE_MAPPING : LIVE_PDO};
    if (is_mapping) {
        if (sub > CANOPEN_MAPPINGS)
            return SDO_ABORT_NO_SUB;
        if (sub > 0) {
            found->type = CANOPEN_UNSIGNED32;
            found->size = 4;
        }
    } else if (sub == 0) {
        found->access = RO;
        found->where = CANOPEN_CONSTANT;
        found->place = is_tpdo ? START : PDO_SUBS;
    } else if (sub == COB) {
        found->type = CANOPEN_UNSIGNED32;
        found->size = 4;
    } else if (sub == PDO_SUBS || sub == INHIBIT) {
        found->type = CANOPEN_UNSIGNED16;
        found->size = 2;
    } else if (sub != KIND && (sub != START || !is_tpdo)) {
        return SDO_ABORT_NO_SUB;
    }
    return 0;
}

/* True if there is a PDO of which this is an object. */
static bool is_of_pdo(const CANOPEN_SLAVE *slave, RTS_UI32 index)
{
    RTS_UI32 direction = index < OBJECT_TPDO ? CANOPEN_RPDOS : CANOPEN_TPDOS;

    return index >= OBJECT_RPDO && index < OBJECT_TPDO_MAPPING + PDO_SPACE &&
           index % PDO_SPACE < slave->pdo_count[direction];
}

static RTS_UI32 find_fixed(RTS_UI32 index, RTS_UI32 sub, CANOPEN_OBJECT *found)
{
    RTS_UI32 abort = SDO_ABORT_NO_OBJECT;

    for (RTS_UI32 i = 0; i < RTS_COUNT(fixed); i++) {
        if (fixed[i].index != index)
            continue;
        abort = SDO_ABORT_NO_SUB;
        if (fixed[i].sub == sub) {
            *found = fixed[i];
            return 0;
        }
    }
    return abort;
}

RTS_UI32 CanopenDictFind(const CANOPEN_SLAVE *slave, RTS_UI16 index, RTS_UI8 sub, CANOPEN_OBJECT *found)
{
    RTS_UI32 at = search(slave, key_of(index, sub));
    bool has_index = at < slave->object_count && slave->objects[at].index == index;

    if (has_index && slave->objects[at].sub == sub) {
        *found = slave->objects[at];
        return 0;
    }
    if (is_of_pdo(slave, index))
        return find_pdo(index, sub, found);
    RTS_UI32 abort = find_fixed(index, sub, found);
    has_index = has_index || (at > 0 && slave->objects[at - 1].index == index);
    return abort == SDO_ABORT_NO_OBJECT && has_index ? SDO_ABORT_NO_SUB : abort;
}

RTS_UI32 CanopenDictGetConstant(const CANOPEN_SLAVE *slave, RTS_UI16 index, RTS_UI8 sub)
{
    CANOPEN_OBJECT object;
    RTS_UI32 abort = CanopenDictFind(slave, index, sub, &object);

    return abort == 0 && object.where == CANOPEN_CONSTANT ? object.place : 0;
}

RTS_UI32 CanopenDictGetBits(const CANOPEN_OBJECT *object)
{
    return object->type == CANOPEN_BOOLEAN ? 1 : 8u * object->size;
}

#endif
