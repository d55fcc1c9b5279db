/*
 * test_canopen_device.c - a CANopen device: damaged dictionaries, block transfer, fastscan, and power cuts while it stores.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenAccess.h"
#include "CanopenDevice.h"
#include "CanopenDevicePdo.h"
#include "CanopenStore.h"
#include "CmpBytes.h"
#include "FileStore.h"
#include "Sim.h"
#include "test.h"

enum { NODE = 5, VALUES = 160, TEXT_PLACE = 16, TEXT_SIZE = 100, SENT = 200, SECTOR = 1024, STORE_SIZE = 10 * SECTOR };
enum { NARROW_PLACE = 120, INTEGER24 = 0x10 };
enum { WORD_PLACE = 2, RO = CANOPEN_ACCESS_READ, RW = CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE };

static CANOPEN_SLAVE slave;
static RTS_UI8 values[VALUES];
static CAN_FRAME sent[SENT];
static RTS_UI32 sent_count;
static RTS_UI32 now_ms;

static CANOPEN_OBJECT objects[] = {
    {OBJECT_IDENTITY, 0, CANOPEN_UNSIGNED8, RO, CANOPEN_CONSTANT, 1, 4},
    {OBJECT_IDENTITY, 1, CANOPEN_UNSIGNED32, RO, CANOPEN_CONSTANT, 4, 0x319},
    {OBJECT_IDENTITY, 2, CANOPEN_UNSIGNED32, RO, CANOPEN_CONSTANT, 4, 7},
    {OBJECT_IDENTITY, 3, CANOPEN_UNSIGNED32, RO, CANOPEN_CONSTANT, 4, 0x10002},
    {0x2000, 0, CANOPEN_UNSIGNED16, RW | CANOPEN_ACCESS_STORED, CANOPEN_IN_VALUES, 2, WORD_PLACE},
    {0x2001, 0, CANOPEN_VISIBLE_STRING, RW | CANOPEN_ACCESS_STORED, CANOPEN_IN_VALUES, TEXT_SIZE, TEXT_PLACE},
    {0x2002, 0, CANOPEN_UNSIGNED8, RO | CANOPEN_ACCESS_TPDO, CANOPEN_IN_VALUES, 1, 0},
};
static const CANOPEN_PDO_SETTING rpdos[1] = {{.cob = 0x200 | CANOPEN_COB_INVALID, .of_node = 1, .type = 255}};
static const CANOPEN_PDO_SETTING tpdos[1] = {
    {.cob = 0x180, .of_node = 1, .type = 255, .count = 1, .map = {0x20020008}}};

static bool take_frame(const CAN_FRAME *frame)
{
    if (sent_count < SENT)
        sent[sent_count++] = *frame;
    return true;
}

static bool begin(RTS_UI8 node)
{
    memset(&slave, 0, sizeof slave);
    memset(values, 0, sizeof values);
    sent_count = 0;
    slave.send = take_frame;
    slave.objects = objects;
    slave.object_count = RTS_COUNT(objects);
    slave.values = values;
    slave.values_size = VALUES;
    slave.defaults[CANOPEN_RPDOS] = rpdos;
    slave.defaults[CANOPEN_TPDOS] = tpdos;
    slave.pdo_count[CANOPEN_RPDOS] = slave.pdo_count[CANOPEN_TPDOS] = 1;
    slave.flags = CANOPEN_DEVICE_STORE | CANOPEN_DEVICE_LSS;
    slave.first_node = node;
    slave.serial = 0x80000001;
    if (!CanopenDeviceBegin(&slave, now_ms))
        return false;
    CanopenDevicePoll(&slave, now_ms);
    sent_count = 0;
    return true;
}

static void start(void)
{
    SimSetFileStore(STORE_SIZE);
    CHECK_EQUAL(SimFlashConfigure(96 * SECTOR, SECTOR, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

static void say(RTS_UI32 id, RTS_UI8 a, RTS_UI8 b, RTS_UI8 c, RTS_UI8 d, RTS_UI32 number)
{
    CAN_FRAME frame = {.id = id, .size = 8, .data = {a, b, c, d}};

    BytesPut32(frame.data + 4, number);
    CanopenDeviceTake(&slave, &frame, 500, now_ms);
}

static void ask(RTS_UI8 command, RTS_UI16 index, RTS_UI32 number)
{
    say(CANOPEN_SDO_REQUEST + NODE, command, (RTS_UI8)index, (RTS_UI8)(index >> 8), 0, number);
}

static RTS_UI32 write_object(RTS_UI16 index, RTS_UI8 sub, const void *data, RTS_UI32 size)
{
    CANOPEN_OBJECT object;
    RTS_UI32 abort = CanopenDictFind(&slave, index, sub, &object);

    return abort != 0 ? abort : CanopenAccessWrite(&slave, &object, data, size, now_ms);
}

/* ---- dictionaries ---- */

static void a_damaged_dictionary_is_refused(void)
{
    static const CANOPEN_OBJECT damaged[] = {
        {0x1018, 3, CANOPEN_UNSIGNED16, RW, CANOPEN_IN_VALUES, 2, 0},                /* out of order */
        {0x2000, 0, CANOPEN_UNSIGNED16, RW, CANOPEN_IN_VALUES, 2, VALUES - 1},       /* outside */
        {0x2000, 0, CANOPEN_UNSIGNED16, RW, CANOPEN_IN_VALUES, 2, 0xFFFFFFFF},       /* wraps */
        {0x2000, 0, CANOPEN_UNSIGNED16, RW, CANOPEN_IN_VALUES, 0, 0},                /* nothing */
        {0x2000, 0, CANOPEN_VISIBLE_STRING, RW, CANOPEN_IN_VALUES, 60, VALUES - 60}, /* no room for the NUL */
        {0x2000, 0, CANOPEN_VISIBLE_STRING, RO, CANOPEN_TEXT, 1, 0},                 /* there are no strings */
        {0x2000, 0, CANOPEN_UNSIGNED32, RW, CANOPEN_CONSTANT, 4, 0},                 /* to be written */
        {0x2000, 0, CANOPEN_UNSIGNED32, RO, CANOPEN_CONSTANT, 8, 0},                 /* too large */
        {0x2000, 0, CANOPEN_UNSIGNED16, RW, CANOPEN_SETTING, 2, 0},                  /* the firmware's */
        {0x2000, 0, CANOPEN_UNSIGNED16, RW, CANOPEN_LIVE, 2, 0},                     /* the firmware's */
        {0x2000, 0, CANOPEN_VISIBLE_STRING, RW, CANOPEN_IN_VALUES, CANOPEN_DEVICE_SDO + 1, 0}, /* for the server */
        {0x2000, 0, INTEGER24, RW, CANOPEN_IN_VALUES, 3, VALUES - 3},                          /* to be widened */
    };
    const CANOPEN_OBJECT good = objects[4];

    CHECK(begin(NODE));
    for (RTS_UI32 i = 0; i < RTS_COUNT(damaged); i++) {
        objects[4] = damaged[i];
        CHECK(!begin(NODE));
    }
    objects[4] = good;
    CHECK(begin(NODE));
}

/* ---- block transfer ---- */

static void lost_segments_of_a_block_are_sent_again(void)
{
    static const char text[] = "0123456789abcdefghijklmnopqrstuvwxyz";

    CHECK(begin(NODE));
    CHECK_EQUAL(write_object(0x2001, 0, text, sizeof text - 1), 0);
    ask(0xA4, 0x2001, 127); /* 36 bytes are 6 segments */
    CHECK_EQUAL(sent[0].data[0], 0xC6);
    CHECK_EQUAL(BytesGet32(sent[0].data + 4), 36);
    ask(0xA3, 0, 0);
    CHECK_EQUAL(sent_count, 1 + 6);
    CHECK_EQUAL(sent[6].data[0], 0x86);
    say(CANOPEN_SDO_REQUEST + NODE, 0xA2, 2, 3, 0, 0); /* the third one is lost: three from there */
    CHECK_EQUAL(sent_count, 7 + 3);
    CHECK_EQUAL(memcmp(sent[7].data + 1, text + 14, 7), 0);
    say(CANOPEN_SDO_REQUEST + NODE, 0xA2, 3, 127, 0, 0);
    CHECK_EQUAL(sent_count, 10 + 1);
    CHECK_EQUAL(sent[10].data[0], 0x81);
    say(CANOPEN_SDO_REQUEST + NODE, 0xA2, 1, 127, 0, 0);
    CHECK_EQUAL(sent[11].data[0], 0xC1 | 6 << 2);
    ask(0xA1, 0, 0);
    ask(SDO_READ, 0x2000, 0); /* follows at once */
    CHECK_EQUAL(sent_count, 13);
    CHECK_EQUAL(sent[12].data[0], 0x4B);
}

static void a_block_with_a_wrong_crc_or_size_changes_nothing(void)
{
    CHECK(begin(NODE));
    for (RTS_UI32 wrong = 0; wrong < 3; wrong++) {
        ask(0xC6, 0x2001, wrong == 1 ? 8 : 9);
        say(CANOPEN_SDO_REQUEST + NODE, 1, '1', '2', '3', 0x37363534); /* "1234567" */
        say(CANOPEN_SDO_REQUEST + NODE, 0x82, '8', '9', 0, 0);
        say(CANOPEN_SDO_REQUEST + NODE, 0xC1 | 5 << 2, wrong == 0 ? 0xC4 : 0xC3, 0x31, 0, 0);
        CHECK_EQUAL(sent[sent_count - 1].data[0], wrong == 2 ? 0xA1 : SDO_ABORT);
        if (wrong < 2)
            CHECK_EQUAL(BytesGet32(sent[sent_count - 1].data + 4), wrong == 0 ? SDO_ABORT_CRC : SDO_ABORT_LENGTH);
        CHECK_EQUAL(values[TEXT_PLACE], wrong == 2 ? '1' : 0);
    }
}

/* ---- LSS ---- */

static void scan(RTS_UI32 number, RTS_UI8 bit, RTS_UI8 part, RTS_UI8 next)
{
    CAN_FRAME frame = {.id = CANOPEN_LSS_REQUEST, .size = 8, .data = {0x51, 0, 0, 0, 0, bit, part, next}};

    BytesPut32(frame.data + 1, number);
    CanopenDeviceTake(&slave, &frame, 500, now_ms);
}

static void fastscan_selects_only_with_the_last_bit_and_the_first_part_next(void)
{
    CHECK(begin(0));
    scan(0, 0x80, 0, 0);
    scan(0x319, 0, 0, 1);
    scan(7, 0, 1, 2);
    scan(0x10002, 0, 2, 3);
    scan(0x80000001, 0, 3, 3);
    CHECK_EQUAL(sent_count, 5);
    CHECK(!slave.lss.is_configuring);
    scan(0x80000000, 0, 3, 0);
    CHECK_EQUAL(sent_count, 5);
    scan(0x80000001, 0, 3, 0);
    CHECK(slave.lss.is_configuring);
    scan(0, 32, 0, 0); /* no such bit */
    scan(0, 0, 4, 0);
    CHECK_EQUAL(sent_count, 6);
}

/* ---- storing ---- */

static void save_new(void *unused)
{
    RTS_UNUSED(unused);
    (void)write_object(OBJECT_STORE, 1, "save", 4);
}

static void set(RTS_UI16 number)
{
    CHECK_EQUAL(write_object(0x2000, 0, &number, 2), 0);
    CHECK_EQUAL(write_object(OBJECT_HEARTBEAT, 0, &number, 2), 0);
    memset(values + TEXT_PLACE, 'a' + number, TEXT_SIZE);
}

static void a_power_cut_while_it_stores_leaves_the_previous_or_the_new_values(void)
{
    for (RTS_UI32 mode = 0; mode < 3; mode++) {
        RTS_UI32 cut = 1;
        bool finished = false;
        for (; !finished && cut < 2000; cut++) {
            start();
            CHECK(begin(NODE));
            set(1);
            save_new(NULL);
            set(2);
            SimFlashCut(cut, mode);
            finished = SimCall(save_new, NULL) != SIM_POWER_CUT;
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(begin(NODE));
            RTS_UI16 number = BytesGet16(values + WORD_PLACE);
            CHECK(number == 1 || number == 2);
            CHECK_EQUAL(slave.settings.heartbeat_ms, number);
            for (RTS_UI32 i = 0; i < TEXT_SIZE; i++)
                CHECK_EQUAL(values[TEXT_PLACE + i], 'a' + number);
            CHECK(!finished || number == 2);
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
        CHECK(finished && cut > 10);
    }
}

static void what_is_stored_is_void_for_another_dictionary(void)
{
    const CANOPEN_OBJECT good = objects[6];

    start();
    CHECK(begin(NODE));
    set(3);
    save_new(NULL);
    objects[6].access = RO;
    CHECK(begin(NODE));
    CHECK_EQUAL(BytesGet16(values + WORD_PLACE), 0);
    CHECK_EQUAL(slave.settings.heartbeat_ms, 0);
    objects[6] = good;
    CHECK(begin(NODE));
    CHECK_EQUAL(BytesGet16(values + WORD_PLACE), 3);
}

/* The fourth byte follows the sign of the three that are stored. */
static void a_narrow_integer_is_restored_with_its_sign(void)
{
    const CANOPEN_OBJECT good = objects[4];
    const RTS_UI8 negative[] = {0xFE, 0xFF, 0xFF};

    start();
    objects[4] = (CANOPEN_OBJECT){0x2000, 0, INTEGER24, RW | CANOPEN_ACCESS_STORED, CANOPEN_IN_VALUES, 3, NARROW_PLACE};
    CHECK(begin(NODE));
    CHECK_EQUAL(write_object(0x2000, 0, negative, 3), 0);
    CHECK_EQUAL(BytesGet32(values + NARROW_PLACE), 0xFFFFFFFE);
    CHECK_EQUAL(CanopenStoreSave(&slave, CANOPEN_PARTS), ERR_OK);
    CHECK(begin(NODE));
    CHECK_EQUAL(BytesGet32(values + NARROW_PLACE), 0xFFFFFFFE);
    objects[4] = good;
}

static void a_file_of_garbage_is_void(void)
{
    RTS_UI8 garbage[400];

    start();
    CHECK(begin(NODE));
    for (RTS_UI32 size = 0; size < sizeof garbage; size += 7) {
        memset(garbage, (int)size, sizeof garbage);
        memcpy(garbage, "COPD", size < 4 ? 0 : 4);
        CHECK_EQUAL(SimPutFile(CANOPEN_STORE_FILE, garbage, size), ERR_OK);
        CHECK_EQUAL(SimPutFile(CANOPEN_NODE_FILE, garbage, size % 9), ERR_OK);
        CHECK(begin(NODE));
        CHECK_EQUAL(slave.node, NODE);
        CHECK_EQUAL(slave.settings.heartbeat_ms, 0);
    }
}

/* ---- errors ---- */

static void error_of_the_program_lasts_over_a_reset_of_communication(void)
{
    const CAN_FRAME reset = {.id = 0, .size = 2, .data = {NMT_RESET_COMMUNICATION, 0}};

    CHECK(begin(NODE));
    CanopenDeviceReport(&slave, CANOPEN_ERROR_PROGRAM, 0x3100);
    CanopenDeviceReport(&slave, CANOPEN_ERROR_LATE, 0x8250);
    CHECK_EQUAL(slave.error_register, 0x15);
    CanopenDeviceTake(&slave, &reset, 500, now_ms);
    CanopenDevicePoll(&slave, now_ms);
    CHECK(slave.error_register != 0);
    CanopenDeviceReport(&slave, CANOPEN_ERROR_PROGRAM, 0);
    CHECK_EQUAL(slave.error_register, 0);
    CHECK_EQUAL(slave.history_count, 2);
}

/* ---- time ---- */

static void every_event_time_is_kept(void)
{
    for (RTS_UI16 ms = 1; ms <= 1000; ms++) {
        CAN_FRAME frame = {.id = 0, .size = 2, .data = {NMT_START, 0}};
        CHECK(begin(NODE));
        CHECK_EQUAL(write_object(OBJECT_TPDO, 5, &ms, 2), 0);
        CanopenDeviceTake(&slave, &frame, 500, now_ms);
        CanopenPdoSendChanged(&slave, now_ms);
        CHECK_EQUAL(sent_count, 1);
        now_ms += ms - 1u;
        CanopenPdoSendChanged(&slave, now_ms);
        CHECK_EQUAL(sent_count, 1);
        CanopenPdoSendChanged(&slave, ++now_ms);
        CHECK_EQUAL(sent_count, 2);
    }
}

int main(void)
{
    start();
    RUN(a_damaged_dictionary_is_refused);
    RUN(lost_segments_of_a_block_are_sent_again);
    RUN(a_block_with_a_wrong_crc_or_size_changes_nothing);
    RUN(fastscan_selects_only_with_the_last_bit_and_the_first_part_next);
    RUN(a_power_cut_while_it_stores_leaves_the_previous_or_the_new_values);
    RUN(what_is_stored_is_void_for_another_dictionary);
    RUN(a_narrow_integer_is_restored_with_its_sign);
    RUN(a_file_of_garbage_is_void);
    RUN(error_of_the_program_lasts_over_a_reset_of_communication);
    RUN(every_event_time_is_kept);
    return test_result();
}
