/*
 * fuzz_canopen_device.c - any frames to a CANopen device, in any state, and a bus without room.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A row of steps: a byte whose three lowest bits choose an SDO request, NMT, LSS, SYNC, an RPDO, a heartbeat, an RPDO in
 * the context of the port or a pause, and whose others are its size, or the pause. Whatever comes, the device can be reset
 * afterwards, and reads and writes an object.
 */
#include <string.h>

#include "CanopenDevice.h"
#include "CanopenDevicePdo.h"
#include "CmpBytes.h"
#include "FileStore.h"
#include "SysLock.h"
#include "fuzz.h"

enum { NODE = 5, WHOLE = 8, VALUES = 128, TEXT_SIZE = 60, CANARY = 0xA5, GUARD = 16 };
enum { TO_SDO, TO_NMT, TO_LSS, TO_SYNC, TO_RPDO, TO_HEARTBEAT, TO_URGENT, PAUSE };

static CANOPEN_SLAVE slave;
static RTS_UI8 values[VALUES + GUARD];
static CAN_FRAME sent;
static RTS_UI32 sent_count;
static bool is_full;
static RTS_UI32 now_ms;

static const CANOPEN_OBJECT objects[] = {
    {0x1000, 0, CANOPEN_UNSIGNED32, CANOPEN_ACCESS_READ, CANOPEN_CONSTANT, 4, 0x195},
    {0x1018, 0, CANOPEN_UNSIGNED8, CANOPEN_ACCESS_READ, CANOPEN_CONSTANT, 1, 4},
    {0x1018, 1, CANOPEN_UNSIGNED32, CANOPEN_ACCESS_READ, CANOPEN_CONSTANT, 4, 7},
    {0x1F50, 1, CANOPEN_DOMAIN, CANOPEN_ACCESS_WRITE, CANOPEN_PROGRAM_OBJECT, 1, PROGRAM_DATA},
    {0x1F51, 1, CANOPEN_UNSIGNED8, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE, CANOPEN_PROGRAM_OBJECT, 1,
     PROGRAM_CONTROL},
    {0x2000, 0, CANOPEN_UNSIGNED16, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_TPDO, CANOPEN_IN_VALUES, 2, 0},
    {0x2001, 0, CANOPEN_BOOLEAN, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE | CANOPEN_ACCESS_RPDO, CANOPEN_IN_VALUES, 1,
     2},
    {0x2002, 0, CANOPEN_UNSIGNED32, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE | CANOPEN_ACCESS_RPDO, CANOPEN_IN_VALUES,
     4, 4},
    {0x2003, 0, CANOPEN_VISIBLE_STRING, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE, CANOPEN_IN_VALUES, TEXT_SIZE,
     VALUES - TEXT_SIZE - 1},
};
/* ---- a program: its bytes come in order and fit ---- */

static RTS_UI32 program_size;
static bool is_downloading;

static RTS_UI32 begin_program(bool has_size, RTS_UI32 size)
{
    program_size = 0;
    is_downloading = !has_size || size < 1000;
    return is_downloading ? 0 : SDO_ABORT_MEMORY;
}

static RTS_UI32 write_program(const RTS_UI8 *data, RTS_UI32 size)
{
    volatile RTS_UI8 last = size > 0 ? data[size - 1] : 0; /* all of it can be read */

    FUZZ_CHECK(is_downloading && size <= CANOPEN_DEVICE_SDO);
    (void)last;
    program_size += size;
    return program_size > 500 ? SDO_ABORT_HARDWARE : 0;
}

static RTS_UI32 end_program(void)
{
    FUZZ_CHECK(is_downloading);
    is_downloading = false;
    return program_size < 20 ? SDO_ABORT_LENGTH : 0;
}

static RTS_UI32 command_program(RTS_UI8 command)
{
    return command > PROGRAM_CLEAR ? SDO_ABORT_VALUE : (RTS_UI32)CANOPEN_REPLIES_LATER;
}

static void read_program(RTS_UI32 place, RTS_UI8 *data, RTS_UI32 *size)
{
    FUZZ_CHECK(place != PROGRAM_DATA && *size <= CANOPEN_DEVICE_SDO);
    memset(data, (int)place, *size);
}

static const CANOPEN_PROGRAM program = {begin_program, write_program, end_program, command_program, read_program};

static const CANOPEN_PDO_SETTING rpdos[] = {
    {.cob = 0x200, .of_node = 1, .type = 255, .count = 2, .map = {0x20010001, 0x20020020}},
    {.cob = 0x300, .of_node = 1, .type = 1, .count = 1, .map = {0x20020020}},
};
static const CANOPEN_PDO_SETTING tpdos[] = {
    {.cob = 0x180, .of_node = 1, .type = 255, .event_ms = 50, .count = 1, .map = {0x20000010}},
    {.cob = 0x280, .of_node = 1, .type = 0, .count = 1, .map = {0x20000010}},
};

RTS_UI32 SysLockEnter(void)
{
    static RTS_UI32 depth;

    return ++depth;
}

void SysLockLeave(RTS_UI32 before)
{
    (void)before;
}

/* ---- a file store without room ---- */

void FileStoreOpen(void)
{
}

const FILE_ENTRY *FileStoreFind(const char *name)
{
    (void)name;
    return NULL;
}

bool FileStoreIsWriting(void)
{
    return false;
}

RTS_RESULT FileStoreBegin(const char *name, RTS_UI32 size, RTS_UI32 crc)
{
    (void)name;
    (void)size;
    (void)crc;
    return ERR_DISK_FULL;
}

RTS_RESULT FileStoreCreate(const char *name)
{
    (void)name;
    return ERR_DISK_FULL;
}

RTS_RESULT FileStoreWrite(const RTS_UI8 *data, RTS_UI32 size)
{
    (void)data;
    (void)size;
    return ERR_DEVICE;
}

RTS_RESULT FileStoreRead(const FILE_ENTRY *entry, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    (void)entry;
    (void)offset;
    (void)data;
    (void)size;
    return ERR_DEVICE;
}

RTS_RESULT FileStoreEnd(void)
{
    return ERR_DEVICE;
}

RTS_RESULT FileStoreFinish(RTS_UI32 crc)
{
    (void)crc;
    return ERR_DEVICE;
}

RTS_RESULT FileStoreDelete(const char *name)
{
    (void)name;
    return ERR_NO_OBJECT;
}

void FileStoreAbort(void)
{
}

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
#define SDO(...) (WHOLE) << 3 | TO_SDO, __VA_ARGS__
    static const uint8_t seeds[][72] = {
        {SDO(0x40, 0x00, 0x10, 0, 0, 0, 0, 0), 0x10 | TO_NMT, 1, 5, TO_SYNC, 40 | TO_RPDO, 1, 2, 3, 4, 5},
        {SDO(0x21, 0x03, 0x20, 0, 9, 0, 0, 0), SDO(0x00, 'a', 'b', 'c', 'd', 'e', 'f', 'g'),
         SDO(0x1B, 'h', 'i', 0, 0, 0, 0, 0)},
        {SDO(0xC6, 0x03, 0x20, 0, 8, 0, 0, 0), SDO(0x01, 1, 2, 3, 4, 5, 6, 7), SDO(0x82, 8, 0, 0, 0, 0, 0, 0),
         SDO(0xD9, 0, 0, 0, 0, 0, 0, 0)},
        {SDO(0xC6, 0x50, 0x1F, 1, 21, 0, 0, 0), SDO(0x01, 1, 2, 3, 4, 5, 6, 7), SDO(0x02, 8, 9, 1, 2, 3, 4, 5),
         SDO(0x83, 1, 2, 3, 4, 5, 6, 7), SDO(0xC1, 0, 0, 0, 0, 0, 0, 0), SDO(0x2F, 0x51, 0x1F, 1, 1, 0, 0, 0)},
        {SDO(0x21, 0x50, 0x1F, 1, 21, 0, 0, 0), SDO(0x00, 1, 2, 3, 4, 5, 6, 7), SDO(0x10, 8, 9, 1, 2, 3, 4, 5),
         SDO(0x01, 1, 2, 3, 4, 5, 6, 7)},
        {SDO(0xA4, 0x03, 0x20, 0, 5, 0, 0, 0), SDO(0xA3, 0, 0, 0, 0, 0, 0, 0), SDO(0xA2, 1, 5, 0, 0, 0, 0, 0),
         SDO(0xA1, 0, 0, 0, 0, 0, 0, 0)},
        {SDO(0x23, 0x00, 0x18, 1, 0x85, 1, 0, 0xC0), SDO(0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0),
         SDO(0x23, 0x00, 0x1A, 1, 0x10, 0, 0, 0x20), SDO(0x2F, 0x00, 0x1A, 0, 1, 0, 0, 0)},
        {WHOLE << 3 | TO_LSS, 0x51, 0, 0, 0, 0, 0x80, 0, 0, WHOLE << 3 | TO_LSS, 0x04, 1, 0, 0, 0, 0, 0, 0,
         WHOLE << 3 | TO_LSS, 0x11, 9, 0, 0, 0, 0,    0, 0},
    };

    if (index >= RTS_COUNT(seeds) || capacity < sizeof(seeds[0]))
        return 0;
    memcpy(data, seeds[index], sizeof(seeds[0]));
    return sizeof(seeds[0]);
}

static bool take_frame(const CAN_FRAME *frame)
{
    FUZZ_CHECK(frame->size <= WHOLE && frame->flags == 0 && frame->id <= 0x7FF);
    if (is_full)
        return false;
    sent = *frame;
    sent_count++;
    return true;
}

static void say(RTS_UI32 id, const RTS_UI8 *data, RTS_UI8 size)
{
    CAN_FRAME frame = {.id = id, .size = size};

    memcpy(frame.data, data, size);
    if (!CanopenPdoTakeUrgent(&slave, &frame, now_ms))
        CanopenDeviceTake(&slave, &frame, 500, now_ms);
}

static void pass(RTS_UI32 ms)
{
    now_ms += ms;
    CanopenDevicePoll(&slave, now_ms);
    CanopenPdoUnpack(&slave);
    CanopenPdoSendChanged(&slave, now_ms);
    values[0]++;
    (void)CanopenDeviceGetWaitMs(&slave, now_ms);
}

static void begin(void)
{
    memset(&slave, 0, sizeof(slave));
    memset(values, 0, VALUES);
    memset(values + VALUES, CANARY, GUARD);
    now_ms = 0xFFFFF000; /* it wraps */
    is_full = false;
    slave.send = take_frame;
    slave.program = &program;
    slave.objects = objects;
    slave.object_count = RTS_COUNT(objects);
    slave.values = values;
    slave.values_size = VALUES;
    slave.defaults[CANOPEN_RPDOS] = rpdos;
    slave.defaults[CANOPEN_TPDOS] = tpdos;
    slave.pdo_count[CANOPEN_RPDOS] = slave.pdo_count[CANOPEN_TPDOS] = 2;
    slave.flags = CANOPEN_DEVICE_LSS | CANOPEN_DEVICE_STORE;
    slave.first_node = NODE;
    FUZZ_CHECK(CanopenDeviceBegin(&slave, now_ms));
    pass(0);
}

static size_t step(const uint8_t *input, size_t size)
{
    static const RTS_UI32 ids[] = {0x600, 0, CANOPEN_LSS_REQUEST, CANOPEN_SYNC, 0x200, 0x701, 0x300};
    uint8_t head = input[0];
    RTS_UI8 data[WHOLE] = {0};
    RTS_UI8 length = (RTS_UI8)(head >> 3 & 0x0F);

    if ((head & 7) == PAUSE) {
        is_full = (head & 0x40) != 0;
        pass((head & 0x80) != 0 ? 500 : length);
        return 1;
    }
    if (length > WHOLE)
        length = WHOLE;
    memcpy(data, input + 1, length < size - 1 ? length : size - 1);
    say(ids[head & 7] + ((head & 7) == TO_SDO || (head & 7) == TO_RPDO || (head & 7) == TO_URGENT ? slave.node : 0),
        data, length);
    pass((head & 0x80) != 0);
    return 1 + (size_t)length;
}

/* It can be reset, and writes and reads an object. */
static void check_recovery(void)
{
    static const RTS_UI8 reset[] = {NMT_RESET_NODE, 0};
    static const RTS_UI8 write[] = {0x23, 0x02, 0x20, 0, 1, 2, 3, 4};
    static const RTS_UI8 read[] = {0x40, 0x02, 0x20, 0, 0, 0, 0, 0};
    static const RTS_UI8 got[] = {0x43, 0x02, 0x20, 0, 1, 2, 3, 4};

    is_full = false;
    slave.lss.next_node = NODE;
    slave.lss.has_reply = false;
    slave.wanted_reset = NMT_RESET_COMMUNICATION;
    pass(1);
    say(0, reset, sizeof(reset));
    pass(1);
    FUZZ_CHECK(slave.state == NODE_PREOPERATIONAL);
    say(CANOPEN_SDO_REQUEST + NODE, write, sizeof(write));
    say(CANOPEN_SDO_REQUEST + NODE, read, sizeof(read));
    FUZZ_CHECK(sent.id == CANOPEN_SDO_REPLY + NODE && memcmp(sent.data, got, sizeof(got)) == 0);
    for (RTS_UI32 i = 0; i < GUARD; i++)
        FUZZ_CHECK(values[VALUES + i] == CANARY);
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    begin();
    for (size_t i = 0; i < size;)
        i += step(input + i, size - i);
    check_recovery();
    return 0;
}
