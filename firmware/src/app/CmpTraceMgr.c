/*
 * CmpTraceMgr.c - the trace manager: packets, what is done with them in each cycle, and their samples.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A packet and all that belongs to it is one piece of the buffer: its state, a plan of what to copy, its configuration as
 * it came, its ring of samples. On one core main changes the list under the lock; elsewhere a task holds the lock while it
 * records.
 */
#include "CmpTraceMgr.h"

#if TRACE_BUFFER > 0

#include <string.h>

#include "../cycle/AppImage.h"
#include "AppLife.h"
#include "AppState.h"
#include "CmpBytes.h"
#include "CmpEventMgr.h"
#include "CyclePhases.h"
#include "FileStore.h"
#include "IecCycle.h"
#include "SysLock.h"
#include "SysTime.h"

/* How a value is copied: in one access of 2 or 4 bytes, or one of these. */
enum { COPY_END = 0, COPY_BYTES = 1, COPY_SEARCHED = 3 };

/* What is copied. */
typedef struct {
    RTS_UI8 *at; /* of those that are not searched */
    RTS_UI8 copy;
    RTS_UI8 size;
} STEP;

typedef struct PACKET {
    struct PACKET *next; /* after it in the buffer */
    RTS_UI32 bytes;      /* of the buffer */
    RTS_UI32 id;
    RTS_UI32 asked_ms; /* when a tool asked for it the last time */
    const TRACE_CONFIG *config;
    RTS_UI32 task;
    RTS_UI32 every;
    RTS_UI32 wait; /* cycles until the next sample */
    RTS_UI32 state;
    RTS_UI32 left; /* samples until it is complete; 0: no end, or not known yet */
    RTS_UI32 written;
    RTS_UI32 triggered; /* the number of the first sample from the trigger on */
    bool was_true;      /* the trigger, in the previous cycle */
    bool has_times;
    bool is_full;        /* of samples: the oldest one is written over */
    RTS_UI32 sample;     /* bytes of a sample */
    RTS_UI8 *position;   /* of the next sample */
    RTS_UI8 *ring, *end; /* first sample; after the last one */
    RTS_I64 constant;    /* of the trigger, as key_of */
    RTS_UI32 times[2];   /* TRACE_CYCLE_NS, TRACE_LATE_NS */
    STEP trigger;
    STEP steps[3]; /* both halves of the time, records, COPY_END */
} PACKET;

enum { POOL_UNITS = TRACE_BUFFER / sizeof(RTS_UI64) };

static struct {
    PACKET *first;
    RTS_UI32 last_id;
    bool is_recording; /* the phase is registered */
    bool has_kept;     /* persistent packets have begun */
} trace;

static RTS_UI64 pool[POOL_UNITS]; /* the buffer; not cleared, so that a large one takes memory only when it is used */

static void record_all(RTS_UI32 task, const IEC_CONTEXT *context);

static CYCLE_ENTRY record_phase = {record_all, NULL};

static RTS_UI32 round_up(RTS_UI32 size)
{
    return (size + 7u) & ~7u;
}

/* ---- places ---- */

RTS_STATIC_ASSERT(sizeof(STEP) % sizeof(RTS_UI32) == 0, places_after_the_plan_are_aligned);

/* The place of record `index`; that of the trigger after the last one. */
static const APP_PLACE *place_at(const PACKET *packet, RTS_UI32 index)
{
    const TRACE_CONFIG *config = packet->config;
    const MON2_PLACE *records = (const MON2_PLACE *)(config + 1);

    return (const APP_PLACE *)(const void *)(index < config->records ? &records[index] : &config->trigger);
}

/* Where a place is now, for the task of the packet. */
static MON_RESULT find(const PACKET *packet, const APP_PLACE *place, RTS_UI8 **at)
{
    AREA_ADDRESS address;
    RTS_UI8 *copy = NULL;
    MON_RESULT result = AppPlaceFind(place, &address, at);

    if (result == MONITORING_ERR_OK && (address.area == APP_AREA_INPUT || address.area == APP_AREA_OUTPUT))
        copy = AppImageGetCopy(packet->task, address.area, address.offset, place->size);
    if (copy != NULL)
        *at = copy; /* what the program saw */
    return result;
}

static const RTS_UI64 nothing = 0;

/* What a pointer leads to in this cycle; else `nothing`. */
static RTS_NOINLINE const RTS_UI8 *search(const PACKET *packet, RTS_UI32 index)
{
    RTS_UI8 *at;

    return find(packet, place_at(packet, index), &at) == MONITORING_ERR_OK ? at : (const RTS_UI8 *)&nothing;
}

static MON_RESULT plan_system(PACKET *packet, const APP_PLACE *place, STEP *step)
{
    if (place->pointers != 0 || place->size != 4 || (place->offset[0] & ~(RTS_UI32)TRACE_LATE_NS) != 0)
        return MONITORING_ERR_INVALID_INDEX;
    packet->has_times = true;
    step->at = (RTS_UI8 *)&packet->times[place->offset[0] / 4];
    step->copy = step->size = 4;
    return MONITORING_ERR_OK;
}

static MON_RESULT plan(PACKET *packet, RTS_UI32 index, STEP *step)
{
    const APP_PLACE *place = place_at(packet, index);
    MON_RESULT result;

    if (place->area == TRACE_SYSTEM)
        return plan_system(packet, place, step);
    result = AppPlaceCheck(place);
    step->size = place->size;
    step->copy = COPY_SEARCHED;
    if (result != MONITORING_ERR_OK || place->pointers > 0)
        return result; /* pointers may lead nowhere now */
    result = find(packet, place, &step->at);
    if (ONLINE_CHANGE && (place->area == APP_AREA_INPUT || place->area == APP_AREA_OUTPUT))
        return result; /* the task may have a copy, or another one, after an online change */
    step->copy = place->size == 1 || ((uintptr_t)step->at & (place->size - 1u)) != 0 ? COPY_BYTES : place->size;
    return result;
}

/* ---- trigger ---- */

static RTS_I32 extend(RTS_UI32 value, RTS_UI32 size)
{
    return size == 1 ? (RTS_I8)value : size == 2 ? (RTS_I16)value : (RTS_I32)value;
}

/* A key of a value that the trigger compares; false for NAN. */
static bool key_of(const TRACE_CONFIG *config, RTS_UI64 value, RTS_UI32 size, RTS_I64 *key)
{
    RTS_UI32 kind = config->flags & TRACE_REAL     ? NUMBER_REAL
                    : config->flags & TRACE_SIGNED ? NUMBER_SIGNED
                                                   : NUMBER_UNSIGNED;

    return AppNumberKey(value, size, kind, key);
}

/* Whether the trigger is true in this cycle. */
static bool is_true(const PACKET *packet)
{
    const TRACE_CONFIG *config = packet->config;
    const STEP *step = &packet->trigger;
    const RTS_UI8 *at = step->copy == COPY_SEARCHED ? search(packet, config->records) : step->at;
    RTS_UI64 value = 0;
    RTS_I64 key;

    if (at == (const RTS_UI8 *)&nothing)
        return false;
    memcpy(&value, at, step->size);
    if (step->size == 1)
        value &= config->trigger.mask;
    return key_of(config, value, step->size, &key) && (config->comparison & NUMBER_ORDER(key, packet->constant)) != 0;
}

static void look_for_trigger(PACKET *packet)
{
    const TRACE_CONFIG *config = packet->config;
    bool now = is_true(packet);

    if (now && !packet->was_true) {
        packet->state = TRACE_TRIGGERED;
        packet->triggered = packet->written;
        packet->wait = 0;
        packet->left = BytesGet32(config->samples) != 0 ? BytesGet32(config->samples) - BytesGet32(config->before) : 0;
    }
    packet->was_true = now;
}

/* ---- the cycle ---- */

/* Copies time and values into a sample, where the largest values come first, so that all are aligned. A run of words costs
 * a few instructions for each. */
static RTS_INLINE void copy_sample(const PACKET *packet, RTS_UI8 *to)
{
    const STEP *step = packet->steps;
    RTS_UI32 i;

    while (step->copy != COPY_END) {
        const volatile RTS_UI8 *at = step->at;
        if (step->copy == 4) {
            do {
                *(RTS_UI32 *)(void *)to = *(const volatile RTS_UI32 *)(const volatile void *)step->at;
                to += 4;
            } while ((++step)->copy == 4);
            continue;
        }
        if (step->copy == COPY_SEARCHED)
            at = search(packet, (RTS_UI32)(step - packet->steps) - TRACE_TIME_SIZE / 4);
        if (step->copy == 2)
            *(RTS_UI16 *)(void *)to = *(const volatile RTS_UI16 *)(const volatile void *)at;
        else
            for (i = 0; i < step->size; i++)
                to[i] = at[i];
        to += step->size;
        step++;
    }
}

static void record(PACKET *packet)
{
    if (packet->has_times)
        IecTaskGetTimes(packet->task, &packet->times[0], &packet->times[1]);
    if (packet->state == TRACE_WAITING)
        look_for_trigger(packet);
    if (packet->wait != 0) {
        packet->wait--;
        return;
    }
    packet->wait = packet->every - 1;
    copy_sample(packet, packet->position);
    packet->position += packet->sample;
    if (packet->position == packet->end) {
        packet->position = packet->ring;
        packet->is_full = true;
    }
    packet->written++;
    if (packet->left != 0 && --packet->left == 0)
        packet->state = TRACE_COMPLETE;
}

/* Takes at most some us for 16 values, unless pointers lead to them. */
static void record_all(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UI32 lock = RTS_ONE_CORE ? 0 : SysLockEnter();
    PACKET *packet;

    RTS_UNUSED(context);
    for (packet = trace.first; packet != NULL; packet = packet->next) {
        if (packet->task == task && packet->state != TRACE_COMPLETE)
            record(packet);
    }
    if (!RTS_ONE_CORE)
        SysLockLeave(lock);
}

/* Registers the phase while a packet records, and only then. */
static void set_phase(void)
{
    const PACKET *packet = trace.first;

    while (packet != NULL && packet->state == TRACE_COMPLETE)
        packet = packet->next;
    if (trace.is_recording == (packet != NULL))
        return;
    trace.is_recording = packet != NULL;
    if (trace.is_recording)
        CyclePhaseAdd(CYCLE_RECORD, &record_phase);
    else
        CyclePhaseRemove(CYCLE_RECORD, &record_phase);
    IecCycleFindPhases();
}

/* ---- the buffer ---- */

/* Room between two packets. */
typedef struct {
    PACKET **link; /* to the packet after it */
    RTS_UI8 *begin;
    RTS_UI32 size;
} GAP;

static GAP find_largest_gap(void)
{
    PACKET **link = &trace.first;
    RTS_UI8 *begin = (RTS_UI8 *)pool;
    GAP largest = {link, begin, 0};

    for (;;) {
        RTS_UI8 *end = *link == NULL ? (RTS_UI8 *)(pool + POOL_UNITS) : (RTS_UI8 *)*link;
        if ((RTS_UI32)(end - begin) > largest.size)
            largest = (GAP){link, begin, (RTS_UI32)(end - begin)};
        if (*link == NULL)
            return largest;
        begin = end + (*link)->bytes;
        link = &(*link)->next;
    }
}

static void insert(PACKET *packet, PACKET **link)
{
    RTS_UI32 lock;

    packet->next = *link;
    lock = SysLockEnter();
    *link = packet;
    SysLockLeave(lock);
}

static void remove_packet(PACKET **link)
{
    RTS_UI32 lock = SysLockEnter();

    *link = (*link)->next;
    SysLockLeave(lock);
}

static PACKET **link_of(RTS_UI32 id)
{
    PACKET **link = &trace.first;

    while (*link != NULL && (*link)->id != id)
        link = &(*link)->next;
    return link;
}

/* ---- creation ---- */

static RTS_RESULT check_config(const TRACE_CONFIG *config, RTS_UI32 size)
{
    RTS_UI32 samples, before;

    if (size < sizeof *config || size != sizeof *config + config->records * sizeof(MON2_PLACE))
        return ERR_SIZE_MISMATCH;
    samples = BytesGet32(config->samples);
    before = BytesGet32(config->before);
    if (config->records == 0 || config->records > TRACE_MAX_RECORDS || config->name[sizeof config->name - 1] != '\0' ||
        BytesGet32(config->every) == 0 || (samples != 0 && before >= samples))
        return ERR_PARAMETER;
    if (AppGetState() == AS_NONE || AppGetImage()->crc != BytesGet32(config->image_crc))
        return ERR_APP_INVALID_DATAID;
    return config->task < IecTaskGetCount() ? ERR_OK : ERR_INVALIDID;
}

/* Plans the copies of all records, and sums up the size of a sample. */
static RTS_RESULT plan_records(PACKET *packet, RTS_UI32 *bad, MON_RESULT *error)
{
    RTS_UI32 count = packet->config->records;
    STEP *step = packet->steps;
    IEC_CONTEXT *context;
    IEC_ENTRY entry;

    (void)IecTaskGetEntry(packet->task, &entry, &context);
    step->at = (RTS_UI8 *)&context->time_ns;
    step[1].at = step->at + 4;
    step[0].copy = step[0].size = step[1].copy = step[1].size = 4;
    step++;
    packet->sample = TRACE_TIME_SIZE;
    for (*bad = 0; *bad < count; ++*bad) {
        *error = plan(packet, *bad, ++step);
        if (*error != MONITORING_ERR_OK)
            return ERR_INVALID_REFERENCE;
        if (step->size > step[-1].size)
            return ERR_PARAMETER; /* values of 8 bytes are two records */
        packet->sample += step->size;
    }
    packet->sample = (packet->sample + 3u) & ~3u;
    return ERR_OK;
}

static RTS_RESULT plan_trigger(PACKET *packet, RTS_UI32 *bad, MON_RESULT *error)
{
    const TRACE_CONFIG *config = packet->config;
    RTS_UI64 constant = 0;

    if ((config->flags & TRACE_TRIGGER) == 0) {
        packet->state = TRACE_TRIGGERED;
        packet->left = BytesGet32(config->samples);
        return BytesGet32(config->before) == 0 ? ERR_OK : ERR_PARAMETER;
    }
    packet->state = TRACE_WAITING;
    packet->was_true = (config->flags & TRACE_LEVEL) == 0;
    *bad = config->records;
    *error = plan(packet, *bad, &packet->trigger);
    if (*error != MONITORING_ERR_OK)
        return ERR_INVALID_REFERENCE;
    if ((config->flags & TRACE_REAL) != 0 && packet->trigger.size < 4)
        return ERR_PARAMETER;
    memcpy(&constant, config->constant, packet->trigger.size);
    return key_of(config, constant, packet->trigger.size, &packet->constant) ? ERR_OK : ERR_PARAMETER;
}

/* Gives it so many samples as it wants, or as there is room for. */
static RTS_RESULT lay_out(PACKET *packet, RTS_UI32 head, RTS_UI32 room)
{
    RTS_UI32 wanted = BytesGet32(packet->config->samples);
    RTS_UI32 fit = (room - head) / packet->sample;

    if (wanted == 0)
        fit /= 2;
    else if (wanted < fit)
        fit = wanted;
    if (fit == 0 || BytesGet32(packet->config->before) > fit)
        return ERR_NOMEMORY;
    packet->ring = packet->position = (RTS_UI8 *)packet + head;
    packet->end = packet->ring + fit * packet->sample;
    packet->bytes = round_up(head + fit * packet->sample);
    return ERR_OK;
}

RTS_RESULT TraceCreate(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *id, RTS_UI32 *bad, MON_RESULT *error)
{
    const TRACE_CONFIG *config = (const TRACE_CONFIG *)data;
    RTS_RESULT result = check_config(config, size);
    GAP gap = find_largest_gap();
    PACKET *packet = (PACKET *)(void *)gap.begin;
    RTS_UI32 head;

    if (result != ERR_OK)
        return result;
    head = (RTS_UI32)(sizeof *packet + config->records * sizeof(STEP));
    if (gap.size < round_up(head + size))
        return ERR_NOMEMORY;
    memset(packet, 0, head);
    packet->config = memcpy((RTS_UI8 *)packet + head, config, size);
    packet->task = config->task;
    packet->every = BytesGet32(config->every);
    packet->asked_ms = SysTimeGetMs();
    result = plan_records(packet, bad, error);
    if (result == ERR_OK)
        result = plan_trigger(packet, bad, error);
    if (result == ERR_OK)
        result = lay_out(packet, round_up(head + size), gap.size);
    if (result != ERR_OK)
        return result;
    *id = packet->id = ++trace.last_id;
    insert(packet, gap.link);
    set_phase();
    return ERR_OK;
}

/* ---- for tools ---- */

RTS_RESULT TraceDelete(RTS_UI32 id)
{
    PACKET **link = link_of(id);

    if (*link == NULL)
        return ERR_INVALIDID;
    remove_packet(link);
    set_phase();
    return ERR_OK;
}

void TraceDeleteAll(void)
{
    while (trace.first != NULL)
        remove_packet(&trace.first);
    set_phase();
}

const RTS_UI8 *TraceGetNext(RTS_UI32 *id, RTS_UI32 *size)
{
    const PACKET *next = NULL;
    const PACKET *packet;

    for (packet = trace.first; packet != NULL; packet = packet->next) {
        if (packet->id > *id && (next == NULL || packet->id < next->id))
            next = packet;
    }
    if (next == NULL)
        return NULL;
    *id = next->id;
    *size = (RTS_UI32)sizeof(TRACE_CONFIG) + next->config->records * (RTS_UI32)sizeof(MON2_PLACE);
    return (const RTS_UI8 *)next->config;
}

/* ---- samples ---- */

/* What the ring has at one moment. */
typedef struct {
    RTS_UI32 written;
    RTS_UI32 filled;
    RTS_UI32 state;
    RTS_UI32 triggered;
    const RTS_UI8 *position;
} RING;

static RTS_UI32 capacity_of(const PACKET *packet)
{
    return (RTS_UI32)(packet->end - packet->ring) / packet->sample;
}

static RTS_NOINLINE void look(const PACKET *packet, RING *ring)
{
    RTS_UI32 lock = SysLockEnter();

    ring->written = packet->written;
    ring->position = packet->position;
    ring->state = packet->state;
    ring->triggered = packet->triggered;
    ring->filled = packet->is_full ? capacity_of(packet) : packet->written;
    SysLockLeave(lock);
}

/* Bytes of the bits before each packed sample. */
static RTS_UI32 bits_of(const PACKET *packet)
{
    return (packet->config->records + TRACE_TIME_SIZE / 4 + 7u) / 8;
}

/* Sample `age` before the next one; 1: the newest. */
static const RTS_UI8 *sample_at(const PACKET *packet, const RING *ring, RTS_UI32 age)
{
    const RTS_UI8 *at = ring->position - age * packet->sample;

    return at < packet->ring ? at + (packet->end - packet->ring) : at;
}

/* A value of a sample; 0 without a sample. */
static RTS_NOINLINE RTS_UI32 load(const RTS_UI8 *sample, RTS_UI32 at, RTS_UI32 size)
{
    if (sample == NULL)
        return 0;
    return size == 4 ? BytesGet32(sample + at) : size == 2 ? BytesGet16(sample + at) : sample[at];
}

/*
 * Packs a sample: a bit for each value that is not what its two predecessors make expect, then by how much, as a number of
 * 7 bits a byte whose lowest bit is the sign. Predecessors that are not in the same message are NULL.
 */
static RTS_UI8 *pack(const PACKET *packet, const RTS_UI8 *sample, const RTS_UI8 *last, const RTS_UI8 *last_but_one,
                     RTS_UI8 *to)
{
    RTS_UI8 *bits = to;
    const STEP *step;
    RTS_UI32 at = 0;
    RTS_UI32 i;

    to += bits_of(packet);
    memset(bits, 0, bits_of(packet));
    for (i = 0; (step = &packet->steps[i])->copy != COPY_END; i++) {
        RTS_UI32 before = load(last, at, step->size);
        RTS_UI32 by = load(sample, at, step->size) - before;
        if (last_but_one != NULL)
            by -= before - load(last_but_one, at, step->size);
        by = (RTS_UI32)extend(by, step->size);
        at += step->size;
        if (by == 0)
            continue;
        bits[i / 8] |= (RTS_UI8)(1u << i % 8);
        for (by = by << 1 ^ (0u - (by >> 31)); by >= 0x80; by >>= 7)
            *to++ = (RTS_UI8)(by | 0x80);
        *to++ = (RTS_UI8)by;
    }
    return to;
}

enum { MOST_PACKED = 5 }; /* bytes of a value */

/* As many as fit. Returns its end. */
static RTS_UI8 *pack_all(const PACKET *packet, const RING *ring, RTS_UI32 from, RTS_UI8 *to, RTS_UI32 room,
                         RTS_UI32 *count)
{
    const RTS_UI32 most = bits_of(packet) + (packet->config->records + TRACE_TIME_SIZE / 4) * MOST_PACKED;
    const RTS_UI8 *end = to + room;
    const RTS_UI8 *last = NULL, *last_but_one = NULL;

    for (*count = 0; from + *count != ring->written && (RTS_UI32)(end - to) >= most; ++*count) {
        const RTS_UI8 *sample = sample_at(packet, ring, ring->written - from - *count);
        to = pack(packet, sample, last, last_but_one, to);
        last_but_one = last;
        last = sample;
    }
    return to;
}

/* The first one from `from` on that is in the ring, and at least `margin` samples from being written over. */
static RTS_UI32 first_of(const RING *ring, RTS_UI32 from, RTS_UI32 margin)
{
    RTS_UI32 oldest = ring->written - (ring->filled > margin ? ring->filled - margin : 0);

    if (ring->written - from > ring->written - oldest)
        return ring->written - from > 0x80000000u ? ring->written : oldest;
    return from;
}

static void put_state(const PACKET *packet, const RING *ring, RTS_UI32 first, RTS_UI32 count, TRACE_STATE *state)
{
    BytesPut32(state->id, packet->id);
    BytesPut32(state->state, ring->state);
    BytesPut32(state->written, ring->written);
    BytesPut32(state->trigger, ring->triggered);
    BytesPut32(state->first, first);
    BytesPut32(state->count, count);
    BytesPut32(state->capacity, capacity_of(packet));
}

RTS_RESULT TraceRead(RTS_UI32 id, RTS_UI32 from, RTS_UI8 *data, RTS_UI32 *size, TRACE_STATE *state)
{
    PACKET *packet = *link_of(id);
    RTS_UI32 room = *size;
    RTS_UI32 margin = 0;
    RTS_UI32 first, count;
    RING ring, after;

    if (packet == NULL)
        return ERR_INVALIDID;
    packet->asked_ms = SysTimeGetMs();
    do { /* again from a later one, if what it packed was written over meanwhile */
        look(packet, &ring);
        first = first_of(&ring, from, margin);
        *size = (RTS_UI32)(pack_all(packet, &ring, first, data, room, &count) - data);
        look(packet, &after);
        margin += capacity_of(packet) / 4 + 1;
    } while (after.written - first > after.filled);
    put_state(packet, &ring, first, count, state);
    return ERR_OK;
}

/* ---- persistent packets ---- */

#if FILE_STORE_FILES > 0
static void begin_file(const FILE_ENTRY *file)
{
    RTS_UI8 config[sizeof(TRACE_CONFIG) + TRACE_KEPT_RECORDS * sizeof(MON2_PLACE)];
    MON_RESULT error;
    RTS_UI32 id, bad;

    if (file != NULL && strncmp(file->name, TRACE_FILE, sizeof TRACE_FILE - 1) == 0 && file->size <= sizeof config &&
        FileStoreRead(file, 0, config, file->size) == ERR_OK)
        (void)TraceCreate(config, file->size, &id, &bad, &error);
}

static void begin_kept(EVENT_PARAM *event)
{
    RTS_UI32 i;

    RTS_UNUSED(event);
    if (!trace.has_kept && trace.first == NULL) {
        for (i = 0; i < FILE_STORE_FILES; i++)
            begin_file(FileStoreGet(i));
    }
    trace.has_kept = true;
}
#endif

/* ---- the component ---- */

static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    TraceDeleteAll();
    trace.has_kept = false;
}

/* Ends what no tool wants any more. */
static void check_tools(void)
{
    PACKET **link = &trace.first;

    while (*link != NULL) {
        if (((*link)->config->flags & TRACE_KEEP) == 0 && SysTimeGetMs() - (*link)->asked_ms > TRACE_IDLE_MS)
            remove_packet(link);
        else
            link = &(*link)->next;
    }
    set_phase();
}

RTS_RESULT CmpTraceMgr_Hook(CMP_HOOK hook)
{
    RTS_RESULT result = ERR_OK;

    if (hook == CH_INIT)
        CMP_CLEAR(trace);
    if (hook == CH_INIT3) {
        result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
#if FILE_STORE_FILES > 0
        if (result == ERR_OK)
            result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareStart, begin_kept, NULL);
#endif
    }
    if (hook == CH_COMM_CYCLE && trace.first != NULL)
        check_tools();
    return result;
}

#endif
