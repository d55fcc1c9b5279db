/*
 * CanopenDevice.c - a CANopen device: its NMT state, boot-up, heartbeat, emergencies.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenDevice.h"

#include <string.h>

#include "CanopenDevicePdo.h"
#include "CanopenLss.h"
#include "CanopenSdoServer.h"
#include "CanopenStore.h"
#include "CmpBytes.h"

#if CANOPEN_DEVICE_DATA > 0

enum {
    AGAIN_MS = 1,
    FRAME = 8,
    INHIBIT_PER_MS = 10,
    EMCY_SHORT = 0x8210,
    EMCY_LATE = 0x8250,
    EMCY_HEARTBEAT = 0x8130,
    EMCY_BUS = 0x8140,
    EMCY_COLLISION = 0x8150,
    IS_STOPPING = 2, /* of 1029h */
    IS_NOTHING = 1,
    NODE_SHIFT = 16,
};

/* ---- emergencies ---- */

/* The error register (1001h) by the class of a code. */
static RTS_UI8 get_register(RTS_UI16 code)
{
    static const RTS_UI8 classes[16] = {0x01, 0x01, 0x03, 0x05, 0x09, 0x01, 0x01, 0x01,
                                        0x11, 0x01, 0x01, 0x01, 0x01, 0x01, 0x01, 0x81};

    return code == 0 ? 0 : classes[code >> 12];
}

static void add_to_history(CANOPEN_SLAVE *slave, RTS_UI16 code)
{
    memmove(slave->history + 1, slave->history, sizeof(slave->history) - sizeof(slave->history[0]));
    slave->history[0] = code;
    if (slave->history_count < CANOPEN_HISTORY)
        slave->history_count++;
}

/* Queues an emergency; with too many that wait the newest takes the place of the last one. */
static void emit(CANOPEN_SLAVE *slave, RTS_UI16 code)
{
    CAN_FRAME *frame;

    if (slave->emergency_count < CANOPEN_EMERGENCIES)
        slave->emergency_count++;
    frame = &slave->emergencies[slave->emergency_count - 1];
    memset(frame, 0, sizeof(*frame));
    frame->size = FRAME;
    BytesPut16(frame->data, code);
    frame->data[2] = slave->error_register;
    slave->counters.emcy++;
}

void CanopenDeviceReport(CANOPEN_SLAVE *slave, CANOPEN_ERROR error, RTS_UI16 code)
{
    RTS_UI32 before = slave->errors;

    if (code != 0) {
        slave->errors |= error;
        slave->error_register |= get_register(code);
        add_to_history(slave, code);
        emit(slave, code);
        return;
    }
    slave->errors &= ~(RTS_UI32)error;
    if (before == 0 || slave->errors != 0)
        return;
    slave->error_register = 0;
    emit(slave, 0);
}

static void set_error(CANOPEN_SLAVE *slave, CANOPEN_ERROR error, bool is_there, RTS_UI16 code)
{
    if (is_there != ((slave->errors & error) != 0))
        CanopenDeviceReport(slave, error, is_there ? code : 0);
}

static void send_emergency(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    RTS_UI32 inhibit_ms = (slave->settings.emcy_inhibit + INHIBIT_PER_MS - 1u) / INHIBIT_PER_MS;
    bool is_on = (slave->settings.emcy_cob & CANOPEN_COB_INVALID) == 0;

    if (slave->emergency_count == 0 || slave->state == NODE_STOPPED || slave->state == NODE_BOOTS ||
        (inhibit_ms != 0 && now_ms - slave->emergency_ms < inhibit_ms))
        return;
    slave->emergencies[0].id = slave->settings.emcy_cob & CANOPEN_COB_ID;
    if (is_on && !slave->send(&slave->emergencies[0]))
        return;
    slave->emergency_ms = now_ms;
    slave->emergency_count--;
    memmove(slave->emergencies, slave->emergencies + 1, slave->emergency_count * sizeof(slave->emergencies[0]));
}

/* ---- states ---- */

static void enter(CANOPEN_SLAVE *slave, RTS_UI8 state, RTS_UI32 now_ms)
{
    if (state == slave->state)
        return;
    slave->state = state;
    if (state == NODE_STOPPED)
        SdoServerReset(slave);
    CanopenPdoUpdate(slave, now_ms);
}

static void set_defaults(CANOPEN_SLAVE *slave)
{
    CANOPEN_SETTINGS *settings = &slave->settings;

    memset(settings, 0, sizeof(*settings));
    settings->sync_cob = CANOPEN_SYNC;
    settings->emcy_cob = CANOPEN_EMCY + (RTS_UI32)slave->node;
    settings->heartbeat_ms = slave->heartbeat_ms;
    for (RTS_UI32 d = 0; d < CANOPEN_DIRECTIONS; d++)
        for (RTS_UI32 i = 0; i < slave->pdo_count[d]; i++) {
            CANOPEN_PDO_SETTING *pdo = &settings->pdos[d][i];
            *pdo = slave->defaults[d][i];
            pdo->cob += pdo->of_node ? slave->node : 0;
        }
}

/* The number is the one of LSS, the stored one or that of the configuration, in this order. */
static void take_node(CANOPEN_SLAVE *slave)
{
    RTS_UI8 node = slave->lss.next_node;

    if (node == 0 && (slave->flags & CANOPEN_DEVICE_LSS) != 0)
        node = CanopenStoredNode();
    if (node == 0)
        node = slave->first_node;
    slave->node = node == CANOPEN_NO_NODE ? 0 : node;
}

static void reset(CANOPEN_SLAVE *slave, RTS_UI8 command, RTS_UI32 now_ms)
{
    enter(slave, NODE_BOOTS, now_ms);
    SdoServerReset(slave);
    slave->wanted_reset = 0;
    slave->lss.is_configuring = false;
    slave->emergency_count = 0;
    slave->errors &= CANOPEN_ERROR_PROGRAM; /* which lasts */
    if (slave->errors == 0)
        slave->error_register = 0;
    slave->is_watching = false;
    take_node(slave);
    set_defaults(slave);
    CanopenStoreLoad(slave, CANOPEN_PART_SETTINGS);
    if (command == NMT_RESET_NODE)
        CanopenStoreLoad(slave, CANOPEN_PART_VALUES);
}

bool CanopenDeviceBegin(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    if (!CanopenDictIsGood(slave))
        return false;
    reset(slave, NMT_RESET_NODE, now_ms);
    return true;
}

static void send_boot_up(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    const CAN_FRAME frame = {.id = CANOPEN_HEARTBEAT + (RTS_UI32)slave->node, .size = 1, .data = {NODE_BOOTS}};

    if (slave->node == 0 || !slave->send(&frame))
        return;
    slave->heartbeat_sent_ms = now_ms;
    enter(slave, NODE_PREOPERATIONAL, now_ms);
}

static void send_heartbeat(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    const CAN_FRAME frame = {.id = CANOPEN_HEARTBEAT + (RTS_UI32)slave->node, .size = 1, .data = {slave->state}};

    if (slave->settings.heartbeat_ms == 0 || now_ms - slave->heartbeat_sent_ms < slave->settings.heartbeat_ms)
        return;
    slave->heartbeat_sent_ms = now_ms;
    (void)slave->send(&frame);
}

static void take_nmt(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    if (frame->size != 2 || slave->node == 0 || (frame->data[1] != 0 && frame->data[1] != slave->node))
        return;
    switch (frame->data[0]) {
    case NMT_RESET_NODE:
    case NMT_RESET_COMMUNICATION:
        reset(slave, frame->data[0], now_ms);
        return;
    default:
        break;
    }
    if (slave->state == NODE_BOOTS)
        return;
    if (frame->data[0] == NMT_START)
        enter(slave, NODE_OPERATIONAL, now_ms);
    else if (frame->data[0] == NMT_STOP)
        enter(slave, NODE_STOPPED, now_ms);
    else if (frame->data[0] == NMT_PREOPERATIONAL)
        enter(slave, NODE_PREOPERATIONAL, now_ms);
}

/* Communication has failed: 1029h says what becomes of a device in operation. */
static void leave_operation(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    RTS_UI8 what = slave->settings.on_error;

    if (what == IS_STOPPING && slave->state != NODE_BOOTS)
        enter(slave, NODE_STOPPED, now_ms);
    else if (what != IS_NOTHING && slave->state == NODE_OPERATIONAL)
        enter(slave, NODE_PREOPERATIONAL, now_ms);
}

/* ---- the heartbeat of another ---- */

static RTS_UI32 get_watched_ms(const CANOPEN_SLAVE *slave)
{
    return slave->settings.consumer >> NODE_SHIFT != 0 ? slave->settings.consumer & 0xFFFF : 0;
}

static void take_heartbeat(CANOPEN_SLAVE *slave, RTS_UI32 node, RTS_UI32 now_ms)
{
    if (node != 0 && node == slave->node)
        set_error(slave, CANOPEN_ERROR_COLLISION, true, EMCY_COLLISION);
    if (node == 0 || node != slave->settings.consumer >> NODE_SHIFT || get_watched_ms(slave) == 0)
        return;
    slave->is_watching = true;
    slave->heard_ms = now_ms;
    set_error(slave, CANOPEN_ERROR_HEARTBEAT, false, 0);
}

static void watch(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    RTS_UI32 ms = get_watched_ms(slave);

    if (!slave->is_watching || ms == 0 || now_ms - slave->heard_ms < ms)
        return;
    slave->is_watching = false; /* until the next one */
    set_error(slave, CANOPEN_ERROR_HEARTBEAT, true, EMCY_HEARTBEAT);
    leave_operation(slave, now_ms);
}

void CanopenDeviceNoteBus(CANOPEN_SLAVE *slave, bool off, RTS_UI32 now_ms)
{
    if (off) {
        leave_operation(slave, now_ms);
        return;
    }
    CanopenDeviceReport(slave, CANOPEN_ERROR_BUS, EMCY_BUS);
    CanopenDeviceReport(slave, CANOPEN_ERROR_BUS, 0);
}

/* ---- frames ---- */

static bool serves(const CANOPEN_SLAVE *slave)
{
    return slave->node != 0 && (slave->state == NODE_PREOPERATIONAL || slave->state == NODE_OPERATIONAL);
}

/* Until an RPDO of full length comes. */
static void note_short(CANOPEN_SLAVE *slave)
{
    slave->received_before_short = slave->counters.received;
    set_error(slave, CANOPEN_ERROR_SHORT, true, EMCY_SHORT);
}

static void take_other(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 function = frame->id & CANOPEN_FUNCTION_MASK;

    if (frame->id == slave->sync_id && frame->id != 0)
        CanopenPdoSync(slave, slave->settings.sync_counter != 0 && frame->size == 1 ? frame->data[0] : 0, now_ms);
    else if (CanopenPdoIsMine(slave, frame->id))
        note_short(slave);
    else if (frame->id == CANOPEN_SDO_REQUEST + (RTS_UI32)slave->node && serves(slave))
        SdoServerTake(slave, frame, now_ms);
    else if (function == CANOPEN_HEARTBEAT && frame->size == 1)
        take_heartbeat(slave, frame->id & CANOPEN_NODE_MASK, now_ms);
}

void CanopenDeviceTake(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 bit_rate, RTS_UI32 now_ms)
{
    if ((frame->flags & (CAN_FLAG_EXTENDED | CAN_FLAG_REMOTE)) != 0)
        return;
    if (frame->id == CANOPEN_NMT)
        take_nmt(slave, frame, now_ms);
    else if (frame->id == CANOPEN_LSS_REQUEST)
        LssSlaveTake(slave, frame, bit_rate);
    else
        take_other(slave, frame, now_ms);
}

/* ---- time ---- */

static void poll_errors(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    RTS_UI32 wait_ms;

    watch(slave, now_ms);
    set_error(slave, CANOPEN_ERROR_LATE, CanopenPdoIsLate(slave, now_ms, &wait_ms), EMCY_LATE);
    if (slave->counters.received != slave->received_before_short)
        set_error(slave, CANOPEN_ERROR_SHORT, false, 0);
}

void CanopenDevicePoll(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    if (slave->wanted_reset != 0)
        reset(slave, slave->wanted_reset, now_ms);
    LssSlavePoll(slave);
    if (slave->state == NODE_BOOTS)
        send_boot_up(slave, now_ms);
    if (slave->state == NODE_BOOTS)
        return;
    SdoServerPoll(slave, now_ms);
    poll_errors(slave, now_ms);
    send_emergency(slave, now_ms);
    send_heartbeat(slave, now_ms);
}

static RTS_UI32 get_left(RTS_UI32 since_ms, RTS_UI32 of_ms)
{
    return since_ms < of_ms ? of_ms - since_ms : 0;
}

static RTS_UI32 get_less(RTS_UI32 a, RTS_UI32 b)
{
    return a < b ? a : b;
}

RTS_UI32 CanopenDeviceGetWaitMs(const CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    RTS_UI32 wait_ms;

    if (slave->lss.has_reply || slave->wanted_reset != 0 || (slave->state == NODE_BOOTS && slave->node != 0))
        return AGAIN_MS;
    if (slave->state == NODE_BOOTS)
        return UINT32_MAX;
    if ((slave->errors & CANOPEN_ERROR_SHORT) != 0 && slave->counters.received != slave->received_before_short)
        return 0;
    bool is_late = CanopenPdoIsLate(slave, now_ms, &wait_ms);
    if (is_late != ((slave->errors & CANOPEN_ERROR_LATE) != 0) ||
        (slave->emergency_count != 0 && slave->state != NODE_STOPPED))
        return AGAIN_MS;
    if (slave->settings.heartbeat_ms != 0)
        wait_ms = get_less(wait_ms, get_left(now_ms - slave->heartbeat_sent_ms, slave->settings.heartbeat_ms));
    if (slave->is_watching && get_watched_ms(slave) != 0)
        wait_ms = get_less(wait_ms, get_left(now_ms - slave->heard_ms, get_watched_ms(slave)));
    return get_less(wait_ms, SdoServerGetWaitMs(slave, now_ms));
}

#endif
