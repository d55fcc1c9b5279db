/*
 * CanopenAccess.c - reads and writes objects of a CANopen device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenAccess.h"

#include <string.h>

#include "CanopenDevicePdo.h"
#include "CanopenStore.h"
#include "CmpBytes.h"
#include "SysLock.h"

#if CANOPEN_DEVICE_DATA > 0

enum { MOST_ON_ERROR = 2, NODE_SHIFT = 16, ALL_PARTS = 1 };

static const RTS_UI32 save_word = 0x65766173; /* "save" */
static const RTS_UI32 load_word = 0x64616F6C; /* "load" */

/* ---- reading ---- */

static RTS_UI32 get_live(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object)
{
    switch (object->place) {
    case LIVE_REGISTER:
        return slave->error_register;
    case LIVE_HISTORY:
        return object->sub == 0 ? slave->history_count : slave->history[object->sub - 1];
    case LIVE_STORE:
    case LIVE_RESTORE:
        return (slave->flags & CANOPEN_DEVICE_STORE) != 0; /* on command */
    case LIVE_SERIAL:
        return slave->serial;
    default:
        return CanopenPdoGet(slave, object);
    }
}

static RTS_UI32 read_values(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI8 *data)
{
    RTS_UI32 size = object->size;

    RTS_UI32 lock = SysLockEnter();
    CanopenPdoUnpack(slave);
    memcpy(data, slave->values + object->place, size);
    SysLockLeave(lock);
    if (object->type == CANOPEN_VISIBLE_STRING) {
        const RTS_UI8 *end = memchr(data, 0, size);
        size = end != NULL ? (RTS_UI32)(end - data) : size;
    }
    return size;
}

RTS_UI32 CanopenAccessRead(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI8 *data, RTS_UI32 *size)
{
    if ((object->access & CANOPEN_ACCESS_READ) == 0)
        return SDO_ABORT_WRITE_ONLY;
    *size = object->size;
    switch (object->where) {
    case CANOPEN_IN_VALUES:
        *size = read_values(slave, object, data);
        break;
    case CANOPEN_TEXT:
        memcpy(data, slave->texts + object->place, *size);
        break;
    case CANOPEN_SETTING:
        memcpy(data, (const RTS_UI8 *)&slave->settings + object->place, *size);
        break;
    case CANOPEN_LIVE:
        BytesPut32(data, get_live(slave, object));
        break;
#if CANOPEN_PROGRAM_DOWNLOAD
    case CANOPEN_PROGRAM_OBJECT:
        slave->program->read(object->place, data, size);
        break;
#endif
    default:
        BytesPut32(data, object->place + (object->where == CANOPEN_OF_NODE ? slave->node : 0));
        break;
    }
    return 0;
}

/* ---- writing ---- */

RTS_UI32 CanopenAccessCheck(const CANOPEN_OBJECT *object, RTS_UI32 size)
{
    if ((object->access & CANOPEN_ACCESS_WRITE) == 0)
        return SDO_ABORT_READ_ONLY;
    if (size > object->size)
        return SDO_ABORT_TOO_LONG;
    return size < object->size && object->type != CANOPEN_VISIBLE_STRING ? SDO_ABORT_TOO_SHORT : 0;
}

static RTS_UI32 check_limit(const CANOPEN_LIMIT *limit, RTS_UI32 size, RTS_UI32 value)
{
    const RTS_UI32 sign = 0x80000000; /* turned round: signed numbers are in the order of unsigned ones */
    RTS_UI32 turned = limit->is_signed ? sign : 0;

    if (limit->is_signed && size < sizeof(value) && (value >> (8 * size - 1) & 1) != 0)
        value |= ~(RTS_UI32)0 << 8 * size;
    if ((value ^ turned) > (limit->high ^ turned))
        return SDO_ABORT_TOO_HIGH;
    return (value ^ turned) < (limit->low ^ turned) ? SDO_ABORT_TOO_LOW : 0;
}

static RTS_UI32 check_limits(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, const RTS_UI8 *data)
{
    RTS_UI8 number[sizeof(RTS_UI32)] = {0};

    if ((object->access & CANOPEN_ACCESS_LIMITED) == 0 || object->size > sizeof(number))
        return 0;
    memcpy(number, data, object->size);
    for (RTS_UI32 i = 0; i < slave->limit_count; i++)
        if (slave->limits[i].index == object->index && slave->limits[i].sub == object->sub)
            return check_limit(&slave->limits[i], object->size, BytesGet32(number));
    return 0;
}

static RTS_UI32 write_values(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI8 *to = slave->values + object->place;

    if (object->type == CANOPEN_BOOLEAN && data[0] > 1)
        return SDO_ABORT_TOO_HIGH;
    RTS_UI32 abort = check_limits(slave, object, data);
    if (abort != 0)
        return abort;
    RTS_UI32 lock = SysLockEnter();
    CanopenPdoUnpack(slave); /* what came before is older */
    memcpy(to, data, size);
    if (object->type == CANOPEN_VISIBLE_STRING)
        memset(to + size, 0, object->size + 1u - size);
    else if (CanopenIsNarrow(size))
        CanopenWiden(to, size, CanopenIsSigned(object));
    slave->written++;
    SysLockLeave(lock);
    return 0;
}

static RTS_UI32 check_emcy(const CANOPEN_SLAVE *slave, RTS_UI32 value)
{
    RTS_UI32 before = slave->settings.emcy_cob;
    bool is_changed = ((before ^ value) & CANOPEN_COB_ID) != 0;

    if ((value & ~(CANOPEN_COB_INVALID | CANOPEN_COB_ID)) != 0 || CanopenIsRestricted(value & CANOPEN_COB_ID))
        return SDO_ABORT_VALUE;
    return is_changed && ((before | value) & CANOPEN_COB_INVALID) == 0 ? SDO_ABORT_VALUE : 0;
}

static RTS_UI32 check_setting(const CANOPEN_SLAVE *slave, RTS_UI16 index, RTS_UI32 value)
{
    switch (index) {
    case OBJECT_SYNC:
        return (value & ~CANOPEN_COB_ID) != 0 || CanopenIsRestricted(value) ? SDO_ABORT_VALUE : 0;
    case OBJECT_EMCY:
        return check_emcy(slave, value);
    case OBJECT_CONSUMER:
        return value >> NODE_SHIFT > CANOPEN_MAX_NODE ? SDO_ABORT_VALUE : 0;
    case OBJECT_SYNC_COUNTER:
        return value == 1 || value > CANOPEN_LAST_SYNC_TYPE ? SDO_ABORT_VALUE : 0;
    case OBJECT_ON_ERROR:
        return value > MOST_ON_ERROR ? SDO_ABORT_TOO_HIGH : 0;
    default:
        return 0;
    }
}

/* The configuration is not what a manager has noted in 1020h any more. */
static void note_change(CANOPEN_SLAVE *slave, RTS_UI16 index)
{
    if (index != OBJECT_VERIFY)
        slave->settings.date = slave->settings.time = 0;
}

static RTS_UI32 write_setting(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, const RTS_UI8 *data, RTS_UI32 value,
                              RTS_UI32 now_ms)
{
    RTS_UI32 abort = check_setting(slave, object->index, value);

    if (abort != 0)
        return abort;
    memcpy((RTS_UI8 *)&slave->settings + object->place, data, object->size);
    slave->is_watching = slave->is_watching && object->index != OBJECT_CONSUMER;
    note_change(slave, object->index);
    CanopenPdoUpdate(slave, now_ms);
    return 0;
}

/* `sub` of 1010h and 1011h: 1 all, 2 communication, 3 application. */
static RTS_UI32 store(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI32 value)
{
    bool saves = object->place == LIVE_STORE;
    RTS_UI32 parts = object->sub == ALL_PARTS ? CANOPEN_PARTS : object->sub - 1u;

    if ((slave->flags & CANOPEN_DEVICE_STORE) == 0 || value != (saves ? save_word : load_word))
        return SDO_ABORT_STORE;
    RTS_RESULT result = saves ? CanopenStoreSave(slave, parts) : CanopenStoreForget(slave, parts);
    if (result == ERR_INVALID_STATE)
        return SDO_ABORT_STATE;
    if (result == ERR_NOT_SUPPORTED)
        return SDO_ABORT_STORE;
    return result == ERR_OK ? 0 : SDO_ABORT_HARDWARE;
}

static RTS_UI32 write_live(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI32 value, RTS_UI32 now_ms)
{
    RTS_UI32 abort;

    switch (object->place) {
    case LIVE_HISTORY:
        if (value != 0)
            return SDO_ABORT_VALUE;
        slave->history_count = 0;
        memset(slave->history, 0, sizeof(slave->history));
        return 0;
    case LIVE_STORE:
    case LIVE_RESTORE:
        return store(slave, object, value);
    default:
        abort = CanopenPdoSet(slave, object, value, now_ms);
        if (abort == 0)
            note_change(slave, object->index);
        return abort;
    }
}

RTS_UI32 CanopenAccessWrite(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, const RTS_UI8 *data, RTS_UI32 size,
                            RTS_UI32 now_ms)
{
    RTS_UI8 number[sizeof(RTS_UI32)] = {0};
    RTS_UI32 abort = CanopenAccessCheck(object, size);

    if (abort != 0)
        return abort;
    if (object->where == CANOPEN_IN_VALUES) {
        abort = write_values(slave, object, data, size);
        if (abort == 0 && (object->access & CANOPEN_ACCESS_STORED) != 0)
            note_change(slave, object->index);
        return abort;
    }
#if CANOPEN_PROGRAM_DOWNLOAD
    if (object->where == CANOPEN_PROGRAM_OBJECT)
        return object->place == PROGRAM_CONTROL ? slave->program->control(data[0]) : SDO_ABORT_READ_ONLY;
#endif
    memcpy(number, data, size);
    if (object->where == CANOPEN_SETTING)
        return write_setting(slave, object, data, BytesGet32(number), now_ms);
    return write_live(slave, object, BytesGet32(number), now_ms);
}

#endif
