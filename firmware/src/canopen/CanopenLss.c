/*
 * CanopenLss.c - a CANopen device gets its node number by LSS.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenLss.h"

#include <string.h>

#include "CanopenStore.h"
#include "CmpBytes.h"

#if CANOPEN_DEVICE_DATA > 0

enum {
    FRAME = 8,
    PARTS = 4, /* of an identity */
    SWITCH_ALL = 0x04,
    SET_NODE = 0x11,
    SET_BIT_RATE = 0x13,
    STORE = 0x17,
    SELECT_FIRST = 0x40,
    SELECT_LAST = 0x43,
    SELECTED = 0x44,
    IDENTIFY_FIRST = 0x46,
    IDENTIFY_LAST = 0x4B,
    WHO_HAS_NO_NODE = 0x4C,
    IDENTIFIED = 0x4F,
    HAS_NO_NODE = 0x50,
    FASTSCAN = 0x51,
    ASK_FIRST = 0x5A,
    ASK_NODE = 0x5E,
    BEGIN_SCAN = 0x80,
    BITS = 32,
    OK = 0,
    OUT_OF_RANGE = 1,
    STORE_NOT_SUPPORTED = 1,
    STORE_FAILED = 2,
    ALL_FIT = 0x3F,
    RANGE_OF_REVISION = 2, /* commands of IDENTIFY: vendor, product, revision low and high, serial low and high */
};

static void reply(CANOPEN_SLAVE *slave, RTS_UI8 command, RTS_UI32 value)
{
    CAN_FRAME *frame = &slave->lss.reply;

    memset(frame, 0, sizeof(*frame));
    frame->id = CANOPEN_LSS_REPLY;
    frame->size = FRAME;
    frame->data[0] = command;
    BytesPut32(frame->data + 1, value);
    slave->lss.has_reply = true;
}

/* Vendor, product, revision, serial number. */
static RTS_UI32 get_identity(const CANOPEN_SLAVE *slave, RTS_UI32 part)
{
    return part == PARTS - 1 ? slave->serial : CanopenDictGetConstant(slave, OBJECT_IDENTITY, (RTS_UI8)(part + 1));
}

static void switch_all(CANOPEN_SLAVE *slave, bool is_configuring)
{
    LSS_SLAVE *lss = &slave->lss;

    if (lss->is_configuring && !is_configuring && slave->node == 0 && lss->next_node != 0)
        slave->wanted_reset = NMT_RESET_COMMUNICATION;
    lss->is_configuring = is_configuring;
    lss->fits = lss->position = 0;
}

/* All four in their order. */
static void select(CANOPEN_SLAVE *slave, RTS_UI32 part, RTS_UI32 value)
{
    LSS_SLAVE *lss = &slave->lss;
    bool fits = part == lss->fits && get_identity(slave, part) == value;

    lss->fits = fits ? (RTS_UI8)(part + 1) : 0;
    if (lss->fits < PARTS)
        return;
    lss->fits = 0;
    lss->is_configuring = true;
    reply(slave, SELECTED, 0);
}

/* Six limits in their order: the device replies to the last one if its identity is within all. */
static void identify(CANOPEN_SLAVE *slave, RTS_UI32 step, RTS_UI32 value)
{
    LSS_SLAVE *lss = &slave->lss;
    RTS_UI32 part = step < RANGE_OF_REVISION ? step : step / 2 + 1;
    RTS_UI32 own = get_identity(slave, part);
    bool is_lowest = step % 2 == 0;
    bool fits = step < RANGE_OF_REVISION ? own == value : is_lowest ? own >= value : own <= value;

    lss->fits = step == 0 ? 0 : lss->fits;
    lss->fits |= (RTS_UI8)(fits << step);
    if (step < IDENTIFY_LAST - IDENTIFY_FIRST)
        return;
    if (lss->fits == ALL_FIT)
        reply(slave, IDENTIFIED, 0);
    lss->fits = 0;
}

/* Complete only when the last bit of the serial number fits and the master goes back to the first part. */
static void scan(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    LSS_SLAVE *lss = &slave->lss;
    RTS_UI32 bit = data[5];
    RTS_UI32 part = data[6];
    RTS_UI32 next = data[7];

    if (slave->node != 0 || lss->is_configuring)
        return;
    if (bit == BEGIN_SCAN) {
        lss->position = 0;
        reply(slave, IDENTIFIED, 0);
        return;
    }
    if (bit >= BITS || part >= PARTS || next >= PARTS || part != lss->position ||
        ((BytesGet32(data + 1) ^ get_identity(slave, part)) >> bit) != 0)
        return;
    lss->position = (RTS_UI8)next;
    lss->is_configuring = bit == 0 && part == PARTS - 1 && next == 0;
    reply(slave, IDENTIFIED, 0);
}

static void set_node(CANOPEN_SLAVE *slave, RTS_UI8 node)
{
    bool is_good = (node >= 1 && node <= CANOPEN_MAX_NODE) || node == CANOPEN_NO_NODE;

    if (is_good)
        slave->lss.next_node = node;
    reply(slave, SET_NODE, is_good ? OK : OUT_OF_RANGE);
}

static void set_bit_rate(CANOPEN_SLAVE *slave, RTS_UI8 table, RTS_UI8 index, RTS_UI32 bit_rate)
{
    static const RTS_UI16 rates[] = {1000, 800, 500, 250, 125, 0, 50, 20, 10};
    bool is_own = table == 0 && index < RTS_COUNT(rates) && bit_rate != 0 && rates[index] == bit_rate;

    reply(slave, SET_BIT_RATE, is_own ? OK : OUT_OF_RANGE);
}

static void store(CANOPEN_SLAVE *slave)
{
    RTS_UI8 node = slave->lss.next_node;

    if (node == 0)
        node = slave->node != 0 ? slave->node : CANOPEN_NO_NODE;
    RTS_RESULT result = CanopenStoreNode(node);
    if (result == ERR_NOT_SUPPORTED)
        reply(slave, STORE, STORE_NOT_SUPPORTED);
    else
        reply(slave, STORE, result == ERR_OK ? OK : STORE_FAILED);
}

/* Commands to a device that is being configured. */
static void configure(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 bit_rate)
{
    switch (data[0]) {
    case SET_NODE:
        set_node(slave, data[1]);
        break;
    case SET_BIT_RATE:
        set_bit_rate(slave, data[1], data[2], bit_rate);
        break;
    case STORE:
        store(slave);
        break;
    case ASK_NODE:
        reply(slave, ASK_NODE, slave->node != 0 ? slave->node : CANOPEN_NO_NODE);
        break;
    default:
        if (data[0] >= ASK_FIRST && data[0] < ASK_NODE)
            reply(slave, data[0], get_identity(slave, data[0] - (RTS_UI32)ASK_FIRST));
        break;
    }
}

void LssSlaveTake(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 bit_rate)
{
    const RTS_UI8 *data = frame->data;
    RTS_UI8 command = data[0];

    if (frame->size != FRAME || (frame->flags & CAN_FLAG_REMOTE) != 0 || (slave->flags & CANOPEN_DEVICE_LSS) == 0)
        return;
    if (command == SWITCH_ALL)
        switch_all(slave, data[1] == 1);
    else if (command >= SELECT_FIRST && command <= SELECT_LAST)
        select(slave, command - (RTS_UI32)SELECT_FIRST, BytesGet32(data + 1));
    else if (command >= IDENTIFY_FIRST && command <= IDENTIFY_LAST)
        identify(slave, command - (RTS_UI32)IDENTIFY_FIRST, BytesGet32(data + 1));
    else if (command == WHO_HAS_NO_NODE && slave->node == 0)
        reply(slave, HAS_NO_NODE, 0);
    else if (command == FASTSCAN)
        scan(slave, data);
    else if (slave->lss.is_configuring)
        configure(slave, data, bit_rate);
    LssSlavePoll(slave);
}

void LssSlavePoll(CANOPEN_SLAVE *slave)
{
    if (slave->lss.has_reply)
        slave->lss.has_reply = !slave->send(&slave->lss.reply);
}

#endif
