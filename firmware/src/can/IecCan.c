/*
 * IecCan.c - CAN frames of the program.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecCan.h"

#if CAN_MAX_RECEIVERS > 0

#include <string.h>

#include "AppEventIds.h"
#include "AppState.h"
#include "CmpCan.h"
#include "CmpEventMgr.h"
#include "CmpSrvNumbers.h"
#include "SysAtomic.h"
#include "SysTime.h"

enum {
    VERSION = 0x00010000,
    SLOTS = 256, /* in a number: its slot, and how often one was taken */
    HEAD_FLAGS_SHIFT = 32,
    HEAD_SIZE_SHIFT = 40,
    ABANDONED_MS = 60000,
};

/* States of a slot. */
enum {
    SLOT_FREE,
    SLOT_TAKEN, /* a task fills it, or takes its result */
    SLOT_FULL,  /* a frame to be sent; a receiver that is in use */
    SLOT_ENDED, /* a frame was sent or refused */
};

typedef struct {
    RTS_UI32 id;
    RTS_UI32 time_us;
    RTS_UI8 flags;
    RTS_UI8 size;
    RTS_UI8 data[CAN_CLASSIC_SIZE];
} RAW_FRAME;

typedef struct {
    RTS_UI32 state;
    RTS_I32 number;
    RTS_UI32 sequence; /* in which order frames were given */
    RTS_UI32 since_ms;
    RTS_I32 result;
    RTS_UI8 network;
    RAW_FRAME frame;
} SENDING;

/* Who receives writes `written`, the task `read`: both count on over all uses of the slot. */
typedef struct {
    RTS_UI32 state;
    RTS_I32 number;
    RTS_UI8 network;
    CAN_FILTER filter;
    RTS_UI32 written;
    RTS_UI32 read;
    RTS_UI32 lost;
    RAW_FRAME current;
    RAW_FRAME ring[CAN_RECEIVE_FRAMES];
} RECEIVER;

RTS_STATIC_ASSERT((CAN_RECEIVE_FRAMES & (CAN_RECEIVE_FRAMES - 1)) == 0, a_ring_is_a_power_of_two);
RTS_STATIC_ASSERT(CAN_SEND_FRAMES < SLOTS && CAN_MAX_RECEIVERS < SLOTS, slots_fit_into_numbers);

static struct {
    RTS_UI32 taken; /* slots ever */
    RTS_UI32 sequence;
    RTS_UI32 changed; /* the receivers are others: main sets the filters */
    bool attached[CAN_CONTROLLERS];
    CAN_ADDRESS address[CAN_CONTROLLERS];
    CAN_FILTER filters[CAN_CONTROLLERS][CAN_MAX_RECEIVERS];
    CAN_USER users[CAN_CONTROLLERS];
    SENDING sending[CAN_SEND_FRAMES];
    RECEIVER receivers[CAN_MAX_RECEIVERS];
} raw;

#define FOR_EACH_RECEIVER(receiver) \
    for (RECEIVER *receiver = raw.receivers; receiver < raw.receivers + CAN_MAX_RECEIVERS; receiver++)
#define FOR_EACH_SENDING(sending) \
    for (SENDING *sending = raw.sending; sending < raw.sending + CAN_SEND_FRAMES; sending++)

static RTS_I32 new_number(RTS_UI32 slot)
{
    RTS_UI32 generation = SysAtomicAdd(&raw.taken, 1) & (INT32_MAX / SLOTS);

    return (RTS_I32)(generation * SLOTS + slot + 1);
}

/* The slot of a number; one that there is not, for a number of another table. */
static RTS_UI32 slot_of(RTS_I32 number)
{
    return (RTS_UI32)number % SLOTS - 1;
}

static bool is_of_tools(RTS_UI32 network, RTS_UI32 id)
{
    return ((id ^ raw.address[network].base) & CAN_BASE_MASK) == 0;
}

/* ---- sending: what the library calls, from tasks ---- */

static RTS_I32 check_frame(RTS_UI8 network, const CAN_FRAME *frame)
{
    bool extended = (frame->flags & CAN_FLAG_EXTENDED) != 0;

    if (network >= CAN_CONTROLLERS || !raw.attached[network])
        return CAN_ERROR_NO_NETWORK;
    if (!CanIsFrame(frame))
        return CAN_ERROR_INVALID;
    if (extended ? is_of_tools(network, frame->id) : CanIsReserved(network, frame->id))
        return CAN_ERROR_RESERVED;
    return 0;
}

static SENDING *find_free(void)
{
    FOR_EACH_SENDING (sending)
        if (SysAtomicReplace(&sending->state, SLOT_FREE, SLOT_TAKEN))
            return sending;
    return NULL;
}

/* The number of a frame that is on its way to the bus, or the negative of an ErrorID. The first byte of `data` is its
 * lowest. */
static RTS_I32 can_send(RTS_UI8 network, RTS_UI32 id, RTS_UI8 flags, RTS_UI8 size, RTS_UI64 data)
{
    CAN_FRAME frame = {.id = id, .flags = flags & (CAN_FLAG_EXTENDED | CAN_FLAG_REMOTE), .size = size};
    RTS_I32 error = check_frame(network, &frame);
    SENDING *sending = error == 0 ? find_free() : NULL;

    if (sending == NULL)
        return error != 0 ? -error : -CAN_ERROR_NO_ROOM;
    sending->network = network;
    sending->frame = (RAW_FRAME){id, 0, frame.flags, size, {0}};
    for (RTS_UI32 i = 0; i < size; i++)
        sending->frame.data[i] = (RTS_UI8)(data >> 8 * i);
    sending->number = new_number((RTS_UI32)(sending - raw.sending));
    sending->sequence = SysAtomicAdd(&raw.sequence, 1);
    sending->since_ms = SysTimeGetMs();
    SysAtomicStore(&sending->state, SLOT_FULL);
    return sending->number;
}

static SENDING *find_sending(RTS_I32 number)
{
    RTS_UI32 slot = slot_of(number);

    return slot < CAN_SEND_FRAMES && raw.sending[slot].number == number ? &raw.sending[slot] : NULL;
}

/* 0: it waits; 1: the controller has it; else the negative of an ErrorID. The number ends with the reply. */
static RTS_I32 can_sent(RTS_I32 number)
{
    SENDING *sending = find_sending(number);
    RTS_I32 result = -CAN_ERROR_CANCELLED;

    if (sending != NULL && SysAtomicLoad(&sending->state) == SLOT_FULL)
        return 0;
    if (sending != NULL && SysAtomicReplace(&sending->state, SLOT_ENDED, SLOT_TAKEN)) {
        result = sending->result;
        sending->number = 0;
        SysAtomicStore(&sending->state, SLOT_FREE);
    }
    return result;
}

/* ---- receiving: what the library calls, from tasks ---- */

static RECEIVER *find_receiver(RTS_I32 number)
{
    RTS_UI32 slot = slot_of(number);
    RECEIVER *receiver = slot < CAN_MAX_RECEIVERS ? &raw.receivers[slot] : NULL;

    return receiver != NULL && receiver->number == number && SysAtomicLoad(&receiver->state) == SLOT_FULL ? receiver
                                                                                                          : NULL;
}

/* The number of a receiver, or the negative of an ErrorID. */
static RTS_I32 can_take(RTS_UI8 network, RTS_UI32 id, RTS_UI32 mask, RTS_UI8 extended)
{
    if (network >= CAN_CONTROLLERS || !raw.attached[network])
        return -CAN_ERROR_NO_NETWORK;
    if (id > (extended != 0 ? 0x1FFFFFFFu : 0x7FFu))
        return -CAN_ERROR_INVALID;
    FOR_EACH_RECEIVER (receiver) {
        if (!SysAtomicReplace(&receiver->state, SLOT_FREE, SLOT_TAKEN))
            continue;
        receiver->network = network;
        receiver->filter = (CAN_FILTER){id, mask & (extended != 0 ? 0x1FFFFFFFu : 0x7FFu), extended != 0};
        receiver->read = SysAtomicLoad(&receiver->written);
        receiver->lost = 0;
        receiver->number = new_number((RTS_UI32)(receiver - raw.receivers));
        SysAtomicStore(&receiver->state, SLOT_FULL);
        SysAtomicStore(&raw.changed, 1);
        return receiver->number;
    }
    return -CAN_ERROR_NO_ROOM;
}

static bool passes(const CAN_FILTER *filter, const RAW_FRAME *frame)
{
    bool extended = (frame->flags & CAN_FLAG_EXTENDED) != 0;

    return filter->extended == extended && ((filter->id ^ frame->id) & filter->mask) == 0;
}

/* 1: the oldest frame that waits is the current one now; 0: none waits; else the negative of an ErrorID. */
static RTS_I32 can_next(RTS_I32 number)
{
    RECEIVER *receiver = find_receiver(number);

    if (receiver == NULL)
        return -CAN_ERROR_CANCELLED;
    while (SysAtomicLoad(&receiver->written) != receiver->read) {
        receiver->current = receiver->ring[receiver->read % CAN_RECEIVE_FRAMES];
        SysAtomicStore(&receiver->read, receiver->read + 1);
        if (passes(&receiver->filter, &receiver->current)) /* it may be from before this use of the slot */
            return 1;
    }
    return 0;
}

/* Identifier, flags and length of the current frame. */
static RTS_UI64 can_head(RTS_I32 number)
{
    const RECEIVER *receiver = find_receiver(number);

    if (receiver == NULL)
        return 0;
    return receiver->current.id | (RTS_UI64)receiver->current.flags << HEAD_FLAGS_SHIFT |
           (RTS_UI64)receiver->current.size << HEAD_SIZE_SHIFT;
}

static RTS_UI64 can_data(RTS_I32 number)
{
    const RECEIVER *receiver = find_receiver(number);
    RTS_UI64 data = 0;

    for (RTS_UI32 i = 0; receiver != NULL && i < receiver->current.size; i++)
        data |= (RTS_UI64)receiver->current.data[i] << 8 * i;
    return data;
}

static RTS_UI32 can_time(RTS_I32 number)
{
    const RECEIVER *receiver = find_receiver(number);

    return receiver != NULL ? receiver->current.time_us : 0;
}

static RTS_UI32 can_lost(RTS_I32 number)
{
    const RECEIVER *receiver = find_receiver(number);

    return receiver != NULL ? SysAtomicLoad(&receiver->lost) : 0;
}

static RTS_UI8 can_free(RTS_I32 number)
{
    RECEIVER *receiver = find_receiver(number);

    if (receiver == NULL || !SysAtomicReplace(&receiver->state, SLOT_FULL, SLOT_FREE))
        return 0;
    SysAtomicStore(&raw.changed, 1);
    return 1;
}

APP_GATE(can_send);
APP_GATE(can_sent);
APP_GATE(can_take);
APP_GATE(can_next);
APP_GATE(can_head);
APP_GATE(can_data);
APP_GATE(can_time);
APP_GATE(can_lost);
APP_GATE(can_free);

/* The signatures are those of stdlib/can.st. */
static const CMP_EXT_FUNCTION functions[] = {
    {"can_send", 0x42D21C11, VERSION, (RTS_PFN)APP_GATED(can_send)},
    {"can_sent", 0x327E8D8C, VERSION, (RTS_PFN)APP_GATED(can_sent)},
    {"can_take", 0x76D7AB3C, VERSION, (RTS_PFN)APP_GATED(can_take)},
    {"can_next", 0x9EF019C8, VERSION, (RTS_PFN)APP_GATED(can_next)},
    {"can_head", 0xCECE7A51, VERSION, (RTS_PFN)APP_GATED(can_head)},
    {"can_data", 0x1CAE2DE8, VERSION, (RTS_PFN)APP_GATED(can_data)},
    {"can_time", 0xED4C4A42, VERSION, (RTS_PFN)APP_GATED(can_time)},
    {"can_lost", 0x9E3A29D2, VERSION, (RTS_PFN)APP_GATED(can_lost)},
    {"can_free", 0x1D01AEAD, VERSION, (RTS_PFN)APP_GATED(can_free)},
};

/* ---- the bus ---- */

/* FD frames are cut to the classic size: a program has no more room. */
static void keep(RTS_UI32 index, const CAN_FRAME *frame)
{
    FOR_EACH_RECEIVER (receiver) {
        if (SysAtomicLoad(&receiver->state) != SLOT_FULL || receiver->network != index ||
            !CanPasses(&receiver->filter, 1, frame))
            continue;
        if (receiver->written - SysAtomicLoad(&receiver->read) >= CAN_RECEIVE_FRAMES) {
            SysAtomicStore(&receiver->lost, receiver->lost + 1);
            continue;
        }
        RAW_FRAME *place = &receiver->ring[receiver->written % CAN_RECEIVE_FRAMES];
        *place = (RAW_FRAME){frame->id, frame->time_us, frame->flags, frame->size, {0}};
        if (place->size > CAN_CLASSIC_SIZE)
            place->size = CAN_CLASSIC_SIZE;
        memcpy(place->data, frame->data, place->size);
        SysAtomicStore(&receiver->written, receiver->written + 1);
    }
}

static bool take_urgent(RTS_UI32 index, const CAN_FRAME *frame)
{
    keep(index, frame);
    return true;
}

static void take(RTS_UI32 index, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UNUSED(now_ms);
    if ((frame->flags & CAN_FLAG_EXTENDED) != 0 && !is_of_tools(index, frame->id))
        keep(index, frame);
}

/* Without the filters for a moment: the port may call take_urgent at any time. */
static void update_filters(RTS_UI32 network)
{
    CAN_USER *user = &raw.users[network];
    RTS_UI32 count = 0;

    FOR_EACH_RECEIVER (receiver)
        if (SysAtomicLoad(&receiver->state) == SLOT_FULL && receiver->network == network)
            raw.filters[network][count++] = receiver->filter;
    *(volatile RTS_UI32 *)&user->filter_count = count;
    (void)CanUpdateFilters(network);
}

/* The oldest frame that waits. */
static SENDING *find_oldest(void)
{
    SENDING *oldest = NULL;

    FOR_EACH_SENDING (sending)
        if (SysAtomicLoad(&sending->state) == SLOT_FULL &&
            (oldest == NULL || (RTS_I32)(sending->sequence - oldest->sequence) < 0))
            oldest = sending;
    return oldest;
}

bool IecCanWaits(void)
{
    return SysAtomicLoad(&raw.changed) != 0 || find_oldest() != NULL;
}

static RTS_I32 result_of(RTS_UI32 network, RTS_RESULT result)
{
    if (result == ERR_OK)
        return 1;
    return CanIsOff(network) ? -CAN_ERROR_BUS_OFF : -CAN_ERROR_NO_NETWORK;
}

/* False: there is no room now. */
static bool send_oldest(SENDING *sending)
{
    CAN_FRAME frame = {.id = sending->frame.id, .flags = sending->frame.flags, .size = sending->frame.size};

    memcpy(frame.data, sending->frame.data, CAN_CLASSIC_SIZE);
    RTS_RESULT result = CanSend(sending->network, &frame);
    if (result == ERR_NOBUFFER)
        return false;
    sending->result = result_of(sending->network, result);
    SysAtomicStore(&sending->state, SLOT_ENDED);
    return true;
}

/* What no task asks for any more is given back. */
static void free_abandoned(bool is_running, RTS_UI32 now_ms)
{
    FOR_EACH_SENDING (sending)
        if (!is_running || (SysAtomicLoad(&sending->state) == SLOT_ENDED && now_ms - sending->since_ms > ABANDONED_MS))
            SysAtomicStore(&sending->state, SLOT_FREE);
    FOR_EACH_RECEIVER (receiver)
        if (!is_running && SysAtomicLoad(&receiver->state) != SLOT_FREE) {
            SysAtomicStore(&receiver->state, SLOT_FREE);
            SysAtomicStore(&raw.changed, 1);
        }
}

static void poll(bool is_running)
{
    SENDING *sending;

    free_abandoned(is_running, SysTimeGetMs());
    if (SysAtomicReplace(&raw.changed, 1, 0))
        for (RTS_UI32 i = 0; i < CAN_CONTROLLERS; i++)
            if (raw.attached[i])
                update_filters(i);
    while ((sending = find_oldest()) != NULL)
        if (!send_oldest(sending)) {
            SysTimeWantPass(1);
            break;
        }
}

/* A program that is loaded next shall not find what is of this one, even if main makes no pass before. */
static void cancel(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    poll(false);
}

/* ---- life ---- */

static void attach(void)
{
    for (RTS_UI32 i = 0; i < CAN_CONTROLLERS && i < SysCanGetCount(); i++) {
        SysCanGetAddress(i, &raw.address[i]);
        raw.users[i] = (CAN_USER){.filters = raw.filters[i], .take_urgent = take_urgent, .take = take};
        raw.attached[i] = CanAttach(i, &raw.users[i]) == ERR_OK;
    }
}

static void detach(void)
{
    for (RTS_UI32 i = 0; i < CAN_CONTROLLERS; i++) {
        if (raw.attached[i])
            CanDetach(i, &raw.users[i]);
        raw.attached[i] = false;
    }
}

RTS_RESULT IecCan_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(raw);
    if (hook == CH_INIT2)
        return EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_StopDone, cancel, NULL);
    if (hook == CH_INIT3) {
        attach();
        return CMRegisterExternal(functions, RTS_COUNT(functions));
    }
    if (hook == CH_COMM_CYCLE)
        poll(AppGetState() == AS_RUN);
    else if (hook == CH_EXIT3)
        detach();
    return ERR_OK;
}

#endif
