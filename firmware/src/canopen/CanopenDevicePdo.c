/*
 * CanopenDevicePdo.c - the PDOs of a CANopen device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenDevicePdo.h"

#include <string.h>

#include "SysAtomic.h"
#include "SysLock.h"

enum {
    READ_TRIES = 4,
    PDO_BITS = 8 * CANOPEN_PDO_SIZE,
    COB = 1,
    KIND = 2,
    INHIBIT = 3,
    EVENT = 5,
    START = 6,
    INHIBIT_PER_MS = 10,
    DUMMIES = 8, /* data types that fill RPDOs are 1 to 7 */
};

#if CANOPEN_DEVICE_DATA > 0

static CANOPEN_PDO_SETTING *setting_of(CANOPEN_SLAVE *slave, RTS_UI32 index, CANOPEN_PDO_RUN **run)
{
    RTS_UI32 direction = index < OBJECT_TPDO ? CANOPEN_RPDOS : CANOPEN_TPDOS;
    RTS_UI32 number = index % (OBJECT_RPDO_MAPPING - OBJECT_RPDO);

    *run = &slave->runs[direction][number];
    return &slave->settings.pdos[direction][number];
}

/* ---- identifiers ---- */

bool CanopenIsRestricted(RTS_UI32 id)
{
    static const struct {
        RTS_UI16 first;
        RTS_UI16 last;
    } ranges[] = {{0, 0x7F}, {0x101, 0x180}, {0x581, 0x5FF}, {0x601, 0x67F}, {0x6E0, 0x6FF}, {0x701, 0x7FF}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(ranges); i++)
        if (id >= ranges[i].first && id <= ranges[i].last)
            return true;
    return id > CANOPEN_COB_ID;
}

static RTS_UI32 set_cob(CANOPEN_PDO_SETTING *pdo, RTS_UI32 value)
{
    RTS_UI32 id = value & CANOPEN_COB_ID;
    bool is_valid = (value & CANOPEN_COB_INVALID) == 0;
    bool was_valid = (pdo->cob & CANOPEN_COB_INVALID) == 0;

    if ((value & (CANOPEN_COB_EXTENDED | (CANOPEN_COB_EXTENDED - 1 - CANOPEN_COB_ID))) != 0)
        return SDO_ABORT_VALUE;
    if (is_valid && (CanopenIsRestricted(id) || (was_valid && id != (pdo->cob & CANOPEN_COB_ID))))
        return SDO_ABORT_VALUE;
    pdo->cob = value;
    return 0;
}

/* ---- mapping ---- */

/* Finds what an entry of a mapping names: its place in the values. */
static RTS_UI32 resolve(const CANOPEN_SLAVE *slave, RTS_UI32 map, RTS_UI32 direction, RTS_UI16 *place)
{
    static const RTS_UI8 dummies[DUMMIES] = {0, 1, 8, 16, 32, 8, 16, 32};
    RTS_UI32 access = direction == CANOPEN_RPDOS ? CANOPEN_ACCESS_RPDO : CANOPEN_ACCESS_TPDO;
    RTS_UI32 index = map >> 16;
    RTS_UI32 bits = map & 0xFF;
    CANOPEN_OBJECT object;

    *place = CANOPEN_NOWHERE;
    if (index > 0 && index < DUMMIES)
        return direction == CANOPEN_RPDOS && bits == dummies[index] && (map & 0xFF00) == 0 ? 0 : SDO_ABORT_NOT_MAPPABLE;
    RTS_UI32 abort = CanopenDictFind(slave, (RTS_UI16)index, (RTS_UI8)(map >> 8), &object);
    if (abort != 0)
        return abort;
    if (object.where != CANOPEN_IN_VALUES || (object.access & access) == 0 || CanopenDictGetBits(&object) != bits)
        return SDO_ABORT_NOT_MAPPABLE;
    *place = (RTS_UI16)(object.place | (CanopenIsSigned(&object) ? CANOPEN_SIGNED : 0));
    return 0;
}

/* Resolves a whole mapping. Nothing is sent or received by it now. */
static RTS_UI32 resolve_all(const CANOPEN_SLAVE *slave, const CANOPEN_PDO_SETTING *pdo, RTS_UI32 direction,
                            RTS_UI32 count, CANOPEN_PDO_RUN *run)
{
    RTS_UI32 bits = 0;
    RTS_UI32 abort = count > CANOPEN_MAPPINGS ? SDO_ABORT_PDO_LENGTH : 0;

    for (RTS_UI32 i = 0; i < count && abort == 0; i++) {
        abort = resolve(slave, pdo->map[i], direction, &run->place[i]);
        bits += pdo->map[i] & 0xFF;
        if (abort == 0 && bits > PDO_BITS)
            abort = SDO_ABORT_PDO_LENGTH;
    }
    run->size = (RTS_UI8)((bits + 7) / 8);
    return abort;
}

static RTS_UI32 set_mapping(const CANOPEN_SLAVE *slave, CANOPEN_PDO_SETTING *pdo, CANOPEN_PDO_RUN *run,
                            RTS_UI32 direction, RTS_UI32 sub, RTS_UI32 value)
{
    RTS_UI16 place;
    RTS_UI32 abort;

    if ((pdo->cob & CANOPEN_COB_INVALID) == 0 || (sub > 0 && pdo->count != 0))
        return SDO_ABORT_STATE;
    if (sub == 0) {
        abort = resolve_all(slave, pdo, direction, value, run);
        if (abort == 0)
            pdo->count = (RTS_UI8)value;
        return abort;
    }
    abort = value == 0 ? 0 : resolve(slave, value, direction, &place);
    if (abort == 0)
        pdo->map[sub - 1] = value;
    return abort;
}

/* ---- objects ---- */

RTS_UI32 CanopenPdoGet(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object)
{
    CANOPEN_PDO_RUN *run;
    const CANOPEN_PDO_SETTING *pdo = setting_of((CANOPEN_SLAVE *)slave, object->index, &run);

    if (object->place == LIVE_MAPPING)
        return object->sub == 0 ? pdo->count : pdo->map[object->sub - 1];
    switch (object->sub) {
    case COB:
        return pdo->cob;
    case KIND:
        return pdo->type;
    case INHIBIT:
        return pdo->inhibit;
    case START:
        return pdo->start;
    default:
        return pdo->event_ms;
    }
}

static RTS_UI32 set_communication(CANOPEN_PDO_SETTING *pdo, RTS_UI32 sub, RTS_UI32 value)
{
    bool is_valid = (pdo->cob & CANOPEN_COB_INVALID) == 0;

    switch (sub) {
    case COB:
        return set_cob(pdo, value);
    case KIND:
        if ((value > CANOPEN_LAST_SYNC_TYPE && value < CANOPEN_FIRST_EVENT_TYPE) || (is_valid && value != pdo->type))
            return SDO_ABORT_VALUE;
        pdo->type = (RTS_UI8)value;
        return 0;
    case INHIBIT:
        if (is_valid && value != pdo->inhibit)
            return SDO_ABORT_VALUE;
        pdo->inhibit = (RTS_UI16)value;
        return 0;
    case START:
        if (value > CANOPEN_LAST_SYNC_TYPE || (is_valid && value != pdo->start))
            return SDO_ABORT_VALUE;
        pdo->start = (RTS_UI8)value;
        return 0;
    default:
        pdo->event_ms = (RTS_UI16)value;
        return 0;
    }
}

/* Begins or ends the exchange of a PDO, by its settings and the state of the device. Within SysLock. */
static void update(const CANOPEN_SLAVE *slave, const CANOPEN_PDO_SETTING *pdo, CANOPEN_PDO_RUN *run, RTS_UI32 now_ms)
{
    bool is_on = slave->state == NODE_OPERATIONAL && (pdo->cob & CANOPEN_COB_INVALID) == 0 && pdo->count != 0;
    RTS_UI32 active = is_on ? pdo->cob & CANOPEN_COB_ID : 0;

    if (active == run->active)
        return;
    run->is_sent = run->has_staged = run->has_started = false;
    run->syncs = 0;
    run->used = SysAtomicLoad(&run->number);
    SysAtomicStore(&run->time_ms, now_ms);
    SysAtomicStore(&run->active, active);
}

RTS_UI32 CanopenPdoSet(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI32 value, RTS_UI32 now_ms)
{
    CANOPEN_PDO_RUN *run;
    CANOPEN_PDO_SETTING *pdo = setting_of(slave, object->index, &run);
    RTS_UI32 direction = object->index < OBJECT_TPDO ? CANOPEN_RPDOS : CANOPEN_TPDOS;
    RTS_UI32 abort;

    RTS_UI32 lock = SysLockEnter();
    if (object->place == LIVE_MAPPING)
        abort = set_mapping(slave, pdo, run, direction, object->sub, value);
    else
        abort = set_communication(pdo, object->sub, value);
    update(slave, pdo, run, now_ms);
    SysLockLeave(lock);
    return abort;
}

/* A mapping that does not fit the dictionary any more is not exchanged. */
static void update_all(CANOPEN_SLAVE *slave, RTS_UI32 direction, RTS_UI32 now_ms)
{
    for (RTS_UI32 i = 0; i < slave->pdo_count[direction]; i++) {
        CANOPEN_PDO_SETTING *pdo = &slave->settings.pdos[direction][i];
        CANOPEN_PDO_RUN *run = &slave->runs[direction][i];
        if (run->active == 0 && resolve_all(slave, pdo, direction, pdo->count, run) != 0)
            pdo->cob |= CANOPEN_COB_INVALID;
        update(slave, pdo, run, now_ms);
    }
}

void CanopenPdoUpdate(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    RTS_UI32 lock = SysLockEnter();

    update_all(slave, CANOPEN_RPDOS, now_ms);
    update_all(slave, CANOPEN_TPDOS, now_ms);
    SysAtomicStore(&slave->sync_id, slave->state == NODE_OPERATIONAL ? slave->settings.sync_cob & CANOPEN_COB_ID : 0);
    SysLockLeave(lock);
}

/* ---- bits ---- */

static void copy_bits(RTS_UI8 *to, RTS_UI32 to_bit, const RTS_UI8 *from, RTS_UI32 from_bit, RTS_UI32 bits)
{
    if (((to_bit | from_bit | bits) & 7) == 0) {
        memcpy(to + to_bit / 8, from + from_bit / 8, bits / 8);
        return;
    }
    for (; bits > 0; bits--, to_bit++, from_bit++) {
        RTS_UI8 mask = (RTS_UI8)(1u << (to_bit & 7));
        if ((from[from_bit / 8] >> (from_bit & 7) & 1) != 0)
            to[to_bit / 8] |= mask;
        else
            to[to_bit / 8] &= (RTS_UI8)~mask;
    }
}

static RTS_UI32 get_place(const CANOPEN_PDO_RUN *run, RTS_UI32 number)
{
    return run->place[number] & ~(RTS_UI32)CANOPEN_SIGNED;
}

/* ---- reception ---- */

static void publish(CANOPEN_PDO_RUN *run, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 next = run->number + 1;

    memcpy(run->data[next % 2], data, size);
    SysAtomicStore(&run->number, next);
}

/* All values that came before a SYNC are of its moment. */
static void publish_staged(CANOPEN_SLAVE *slave)
{
    for (RTS_UI32 i = 0; i < slave->pdo_count[CANOPEN_RPDOS]; i++) {
        CANOPEN_PDO_RUN *run = &slave->runs[CANOPEN_RPDOS][i];
        if (!run->has_staged)
            continue;
        run->has_staged = false;
        publish(run, run->staged, run->size);
    }
}

static CANOPEN_PDO_RUN *find_rpdo(CANOPEN_SLAVE *slave, RTS_UI32 id, RTS_UI32 *number)
{
    for (RTS_UI32 i = 0; i < slave->pdo_count[CANOPEN_RPDOS]; i++)
        if (id != 0 && SysAtomicLoad(&slave->runs[CANOPEN_RPDOS][i].active) == id) {
            *number = i;
            return &slave->runs[CANOPEN_RPDOS][i];
        }
    return NULL;
}

bool CanopenPdoTakeUrgent(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 number;

    if ((frame->flags & (CAN_FLAG_REMOTE | CAN_FLAG_EXTENDED)) != 0)
        return false;
    if (frame->id != 0 && frame->id == SysAtomicLoad(&slave->sync_id))
        publish_staged(slave);
    CANOPEN_PDO_RUN *run = find_rpdo(slave, frame->id, &number);
    if (run == NULL || frame->size < run->size)
        return false;
    SysAtomicStore(&run->time_ms, now_ms);
    slave->counters.received++;
    if (slave->settings.pdos[CANOPEN_RPDOS][number].type <= CANOPEN_LAST_SYNC_TYPE) {
        memcpy(run->staged, frame->data, run->size);
        run->has_staged = true;
    } else {
        publish(run, frame->data, run->size);
    }
    return true;
}

bool CanopenPdoIsMine(const CANOPEN_SLAVE *slave, RTS_UI32 id)
{
    RTS_UI32 number;

    return find_rpdo((CANOPEN_SLAVE *)slave, id, &number) != NULL;
}

static RTS_UI32 read_newest(const CANOPEN_PDO_RUN *run, RTS_UI8 *data)
{
    RTS_UI32 number;
    RTS_UI32 tries = 0;

    do {
        number = SysAtomicLoad(&run->number);
        memcpy(data, run->data[number % 2], CANOPEN_PDO_SIZE);
        SysAtomicFence();
    } while (SysAtomicLoad(&run->number) != number && ++tries < READ_TRIES);
    return number;
}

static void unpack(CANOPEN_SLAVE *slave, const CANOPEN_PDO_SETTING *pdo, CANOPEN_PDO_RUN *run)
{
    RTS_UI8 data[CANOPEN_PDO_SIZE];
    RTS_UI32 bit = 0;

    run->used = read_newest(run, data);
    slave->written++;
    for (RTS_UI32 i = 0; i < pdo->count; i++) {
        RTS_UI32 bits = pdo->map[i] & 0xFF;
        if (run->place[i] != CANOPEN_NOWHERE) {
            RTS_UI8 *value = slave->values + get_place(run, i);
            copy_bits(value, 0, data, bit, bits);
            if (bits > 8 && CanopenIsNarrow(bits / 8))
                CanopenWiden(value, bits / 8, (run->place[i] & CANOPEN_SIGNED) != 0);
        }
        bit += bits;
    }
}

void CanopenPdoUnpack(CANOPEN_SLAVE *slave)
{
    for (RTS_UI32 i = 0; i < slave->pdo_count[CANOPEN_RPDOS]; i++) {
        CANOPEN_PDO_RUN *run = &slave->runs[CANOPEN_RPDOS][i];
        if (run->active != 0 && run->used != SysAtomicLoad(&run->number))
            unpack(slave, &slave->settings.pdos[CANOPEN_RPDOS][i], run);
    }
}

bool CanopenPdoIsLate(const CANOPEN_SLAVE *slave, RTS_UI32 now_ms, RTS_UI32 *wait_ms)
{
    bool is_late = false;

    *wait_ms = UINT32_MAX;
    for (RTS_UI32 i = 0; i < slave->pdo_count[CANOPEN_RPDOS]; i++) {
        const CANOPEN_PDO_RUN *run = &slave->runs[CANOPEN_RPDOS][i];
        RTS_UI32 deadline_ms = slave->settings.pdos[CANOPEN_RPDOS][i].event_ms;
        RTS_UI32 since_ms = now_ms - SysAtomicLoad(&run->time_ms);
        if (run->active == 0 || deadline_ms == 0)
            continue;
        if (since_ms >= deadline_ms)
            is_late = true;
        else if (deadline_ms - since_ms < *wait_ms)
            *wait_ms = deadline_ms - since_ms;
    }
    return is_late;
}

/* ---- transmission ---- */

/* The frame of a TPDO; false: it is not exchanged. */
static bool pack(const CANOPEN_SLAVE *slave, RTS_UI32 number, CAN_FRAME *frame)
{
    const CANOPEN_PDO_SETTING *pdo = &slave->settings.pdos[CANOPEN_TPDOS][number];
    const CANOPEN_PDO_RUN *run = &slave->runs[CANOPEN_TPDOS][number];
    RTS_UI32 bit = 0;

    memset(frame, 0, sizeof(*frame));
    RTS_UI32 lock = SysLockEnter();
    frame->id = run->active;
    frame->size = run->size;
    for (RTS_UI32 i = 0; i < pdo->count && frame->id != 0; i++) {
        copy_bits(frame->data, bit, slave->values + get_place(run, i), 0, pdo->map[i] & 0xFF);
        bit += pdo->map[i] & 0xFF;
    }
    SysLockLeave(lock);
    return frame->id != 0;
}

static void send(CANOPEN_SLAVE *slave, CANOPEN_PDO_RUN *run, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    if (!slave->send(frame))
        return;
    memcpy(run->data[0], frame->data, CANOPEN_PDO_SIZE);
    run->is_sent = true;
    run->time_ms = now_ms;
    run->syncs = 0;
    slave->counters.sent++;
}

static bool has_changed(const CANOPEN_PDO_RUN *run, const CAN_FRAME *frame)
{
    return !run->is_sent || memcmp(run->data[0], frame->data, CANOPEN_PDO_SIZE) != 0;
}

static bool is_due(const CANOPEN_PDO_SETTING *pdo, const CANOPEN_PDO_RUN *run, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 since_ms = now_ms - run->time_ms;

    if (run->is_sent && since_ms < (pdo->inhibit + INHIBIT_PER_MS - 1u) / INHIBIT_PER_MS)
        return false;
    return has_changed(run, frame) || (pdo->event_ms != 0 && since_ms >= pdo->event_ms);
}

void CanopenPdoSendChanged(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    CAN_FRAME frame;

    for (RTS_UI32 i = 0; i < slave->pdo_count[CANOPEN_TPDOS]; i++) {
        const CANOPEN_PDO_SETTING *pdo = &slave->settings.pdos[CANOPEN_TPDOS][i];
        CANOPEN_PDO_RUN *run = &slave->runs[CANOPEN_TPDOS][i];
        if (pdo->type >= CANOPEN_FIRST_EVENT_TYPE && pack(slave, i, &frame) && is_due(pdo, run, &frame, now_ms))
            send(slave, run, &frame, now_ms);
    }
}

/* True after each `type`-th SYNC, the first of which is the one with the start value. */
static bool is_turn(const CANOPEN_PDO_SETTING *pdo, CANOPEN_PDO_RUN *run, RTS_UI32 counter)
{
    if (pdo->start != 0 && counter != 0 && !run->has_started) {
        run->has_started = counter == pdo->start;
        return run->has_started;
    }
    return ++run->syncs >= pdo->type;
}

void CanopenPdoSync(CANOPEN_SLAVE *slave, RTS_UI32 counter, RTS_UI32 now_ms)
{
    CAN_FRAME frame;

    for (RTS_UI32 i = 0; i < slave->pdo_count[CANOPEN_TPDOS]; i++) {
        const CANOPEN_PDO_SETTING *pdo = &slave->settings.pdos[CANOPEN_TPDOS][i];
        CANOPEN_PDO_RUN *run = &slave->runs[CANOPEN_TPDOS][i];
        if (pdo->type > CANOPEN_LAST_SYNC_TYPE || !pack(slave, i, &frame))
            continue;
        if (pdo->type == 0 ? has_changed(run, &frame) : is_turn(pdo, run, counter))
            send(slave, run, &frame, now_ms);
    }
}

#endif
