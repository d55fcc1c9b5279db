/*
 * test_io_keep.c - parameters of I/O devices that a tool has written, over power-off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpChecksum.h"
#include "CmpIoKeep.h"
#include "CmpSettings.h"
#include "FileStore.h"
#include "IoMgrRequests.h"
#include "io_driver.h"

enum { STORE = 32 * 1024, FIRST = 1, SECOND = 2 };

static RTS_RESULT put_file(const char *name, const void *data, RTS_UI32 size)
{
    RTS_RESULT result = FileStoreBegin(name, size, CRC32Update(0, data, size));

    if (result == ERR_OK)
        result = FileStoreWrite(data, size);
    return result == ERR_OK ? FileStoreEnd() : result;
}

/* A program with a simulated device of 32 bits of inputs; `name` of the device, `gain` a described parameter of it. */
static void flash_program(const char *name, RTS_UI32 gain)
{
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    spec.areas[APP_AREA_OUTPUT] = 32;
    io_init(&io);
    io_add_connector(&io, name, "IoDrvSim");
    io_add_parameter(&io, 100, 8, gain);
    add_copying_task("Main", 10000, 0);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, FIRST, 0, 0, 16);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, SECOND, 0, 32, 16);
    start_io();
}

static void begin_device(const char *settings)
{
    SimFileStoreSize = STORE;
    CHECK_EQUAL(SimFlashConfigure(256 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(put_file(SETTINGS_FILE_NAME, settings, (RTS_UI32)strlen(settings)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    flash_program("Bench", 7);
}

static void begin_keeping(void)
{
    begin_device("[CmpIoMgr]\nStoreChangedParameters=1\n");
}

/* As the service does it. */
static void set_value(RTS_UI32 id, RTS_UI16 value)
{
    CHECK_EQUAL(IoMgrWriteParameter(0, id, &value, 16, 0), ERR_OK);
    IoKeepNote(0, id, &value, 16, 0);
}

static RTS_UI32 value_of(RTS_UI32 id)
{
    RTS_UI16 value = 0;

    CHECK_EQUAL(IoMgrReadParameter(0, id, &value, 16, 0), ERR_OK);
    return value;
}

/* Main makes a pass at the end of each SimAdvance. */
static void pass_ms(RTS_UI32 time)
{
    for (; time > 0; time -= time < 20 ? time : 20)
        CHECK_EQUAL(SimAdvance(ms(time < 20 ? time : 20)), ERR_OK);
}

/* Power goes and comes, and the devices have taken their parameters. */
static void restart(void)
{
    CHECK_EQUAL(SimStart(), ERR_OK);
    pass_ms(10);
}

static void written_parameters_are_there_after_power_off(void)
{
    begin_keeping();
    set_value(FIRST, 1234);
    set_value(SECOND, 1);
    set_value(SECOND, 4321);
    pass_ms(1100);
    restart();
    CHECK_EQUAL(value_of(FIRST), 1234);
    CHECK_EQUAL(value_of(SECOND), 4321);
    flash_program("Bench", 7);
    CHECK_EQUAL(value_of(SECOND), 4321);
}

static void without_the_setting_they_end_with_the_program(void)
{
    begin_device("[CmpIoMgr]\nStoreChangedParameters=0\n");
    set_value(FIRST, 1234);
    pass_ms(1100);
    CHECK(FileStoreFind(IO_KEEP_FILE) == NULL);
    restart();
    CHECK_EQUAL(value_of(FIRST), 0);
}

static void a_device_that_is_described_otherwise_gets_what_is_described(void)
{
    begin_keeping();
    set_value(FIRST, 1234);
    pass_ms(1100);
    flash_program("Bench", 8);
    CHECK_EQUAL(value_of(FIRST), 0);
    flash_program("Other", 7);
    CHECK_EQUAL(value_of(FIRST), 0);
    flash_program("Bench", 7);
    CHECK_EQUAL(value_of(FIRST), 1234);
}

static void deleting_the_file_gives_the_described_values_back(void)
{
    begin_keeping();
    set_value(FIRST, 1234);
    pass_ms(1100);
    CHECK_EQUAL(FileStoreDelete(IO_KEEP_FILE), ERR_OK);
    set_value(SECOND, 5);
    pass_ms(1100);
    restart();
    CHECK_EQUAL(value_of(FIRST), 0);
    CHECK_EQUAL(value_of(SECOND), 5);
}

static void flash_is_written_once_a_second_at_most(void)
{
    begin_keeping();
    set_value(FIRST, 1);
    pass_ms(20);
    const FILE_ENTRY saved = *FileStoreFind(IO_KEEP_FILE);
    for (RTS_UI32 i = 0; i < 40; i++) {
        set_value(FIRST, (RTS_UI16)(100 + i));
        pass_ms(20);
    }
    CHECK(FileStoreFind(IO_KEEP_FILE)->start == saved.start);
    pass_ms(300);
    CHECK(FileStoreFind(IO_KEEP_FILE)->start != saved.start);
}

static void more_than_there_is_room_for_is_refused_and_harms_nothing(void)
{
    begin_keeping();
    set_value(FIRST, 77);
    for (RTS_UI32 id = 1000; id < 1000 + IO_KEEP_SIZE / 24; id++) {
        RTS_UI16 value = 1;
        IoKeepNote(0, id, &value, 16, 0);
    }
    IoKeepNote(0, FIRST, "", 8 * IO_KEEP_SIZE + 1, 0);
    IoKeepNote(99, FIRST, "", 8, 0);
    pass_ms(1100);
    CHECK(FileStoreFind(IO_KEEP_FILE)->size <= IO_KEEP_SIZE);
    CHECK_EQUAL(SimStart(), ERR_OK);
    pass_ms(200);
    CHECK_EQUAL(value_of(FIRST), 77);
}

static void a_file_that_is_none_is_not_used(void)
{
    static RTS_UI8 wild[IO_KEEP_SIZE + 1];

    begin_keeping();
    set_value(FIRST, 77);
    pass_ms(1100);
    const FILE_ENTRY saved = *FileStoreFind(IO_KEEP_FILE);
    CHECK_EQUAL(FileStoreRead(&saved, 0, wild, saved.size), ERR_OK);
    for (RTS_UI32 at = 0; at < saved.size; at++) {
        wild[at] ^= 0xA5;
        CHECK_EQUAL(put_file(IO_KEEP_FILE, wild, saved.size), ERR_OK);
        flash_program("Bench", 7);
        wild[at] ^= 0xA5;
    }
    for (RTS_UI32 size = 0; size < saved.size; size++) {
        CHECK_EQUAL(put_file(IO_KEEP_FILE, wild, size), ERR_OK);
        flash_program("Bench", 7);
        CHECK_EQUAL(value_of(FIRST), 0);
    }
    CHECK_EQUAL(put_file(IO_KEEP_FILE, wild, sizeof wild), ERR_OK);
    flash_program("Bench", 7);
    CHECK_EQUAL(value_of(FIRST), 0);
}

/* ---- a device on a bus ---- */

static struct {
    RTS_UI32 tries;
    RTS_UI32 pending; /* so many tries before the device has answered */
    RTS_RESULT result;
    RTS_UI8 value;
} bus;

static RTS_RESULT write_on_bus(const IoConfigConnector *connector, RTS_UI32 id, const void *data, RTS_UI32 bits,
                               RTS_UI32 bit_offset)
{
    RTS_UNUSED(connector);
    RTS_UNUSED(id);
    RTS_UNUSED(bits);
    RTS_UNUSED(bit_offset);
    if (bus.tries++ < bus.pending)
        return ERR_PENDING;
    if (bus.result == ERR_OK)
        bus.value = *(const RTS_UI8 *)data;
    return bus.result;
}

/* Loads a program with a device of io_driver.h again, which has the value 42 saved. */
static void load_with_bus(RTS_UI32 pending, RTS_RESULT result)
{
    static ICmpIoDrv functions;
    static IO_DRIVER driver;
    const RTS_UI8 saved = 42;

    begin_keeping();
    functions = test_functions;
    functions.IoDrvWriteParameter = write_on_bus;
    memset(&driver, 0, sizeof driver);
    driver.functions = &functions;
    CHECK_EQUAL(IoMgrRegisterInstance(&driver), ERR_OK);
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    io_init(&io);
    io_add_connector(&io, "Valve", "IoDrvTest");
    add_copying_task("Main", 10000, 0);
    memset(&bus, 0, sizeof bus);
    start_io();
    IoKeepNote(0, 5, &saved, 8, 0);
    bus.pending = pending;
    bus.result = result;
    start_io();
}

static void a_device_that_answers_later_gets_its_value_then(void)
{
    load_with_bus(3, ERR_OK);
    CHECK_EQUAL(bus.value, 0);
    pass_ms(500);
    CHECK_EQUAL(bus.value, 42);
    CHECK_EQUAL(bus.tries, 4);
}

static void a_device_that_is_not_there_is_tried_for_half_a_minute(void)
{
    load_with_bus(0, ERR_TIMEOUT);
    pass_ms(29000);
    CHECK(bus.tries > 200);
    pass_ms(2000);
    RTS_UI32 tries = bus.tries;
    pass_ms(5000);
    CHECK_EQUAL(bus.tries, tries);
    load_with_bus(0, ERR_NO_OBJECT);
    pass_ms(1000);
    CHECK_EQUAL(bus.tries, 1);
}

static void save_another(void *unused)
{
    RTS_UNUSED(unused);
    set_value(FIRST, 2);
    pass_ms(1100);
}

static void a_power_cut_leaves_the_old_value_or_the_new_one(void)
{
    RTS_UI32 cuts = 0;

    begin_keeping();
    set_value(FIRST, 1);
    pass_ms(1100);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool cut = true;
        for (RTS_UI32 operation = 1; cut; operation++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(operation, mode);
            cut = SimCall(save_another, NULL) == SIM_POWER_CUT;
            restart();
            CHECK(value_of(FIRST) == 2 || (cut && value_of(FIRST) == 1));
            cuts += cut;
        }
    }
    CHECK(cuts > 9);
}

int main(void)
{
    RUN(written_parameters_are_there_after_power_off);
    RUN(without_the_setting_they_end_with_the_program);
    RUN(a_device_that_is_described_otherwise_gets_what_is_described);
    RUN(deleting_the_file_gives_the_described_values_back);
    RUN(flash_is_written_once_a_second_at_most);
    RUN(more_than_there_is_room_for_is_refused_and_harms_nothing);
    RUN(a_file_that_is_none_is_not_used);
    RUN(a_device_that_answers_later_gets_its_value_then);
    RUN(a_device_that_is_not_there_is_tried_for_half_a_minute);
    RUN(a_power_cut_leaves_the_old_value_or_the_new_one);
    return test_result();
}
