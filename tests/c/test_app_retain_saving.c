/*
 * test_app_retain_saving.c - when retain variables are saved while their copy takes its time, as it does with tasks that
 * run beside each other.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpRetain is compiled a second time here, with a flash log and tasks that are fakes.
 */
#include <string.h>

#include "../../firmware/src/cycle/CmpRetain.c"

#include "test.h"

enum { AREA_SIZE = 64 };

static RTS_UI8 area[AREA_SIZE];
static RTS_UI8 written[AREA_SIZE];
static RTS_UI32 saves;
static RTS_UI32 asked;
static bool moment; /* the copy can be taken now */
static RTS_UI32 now_ms;

RTS_RESULT FlashLogOpen(FLASH_LOG *log, RTS_UI32 file)
{
    RTS_UNUSED(file);
    memset(log, 0, sizeof *log);
    return ERR_OK;
}

RTS_RESULT FlashLogRead(const FLASH_LOG *log, FLASH_LOG_RANGE range, RTS_UI32 tag, void *data, RTS_UI32 size)
{
    RTS_UNUSED(log);
    RTS_UNUSED(range);
    RTS_UNUSED(tag);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_NO_OBJECT;
}

RTS_RESULT FlashLogAppend(FLASH_LOG *log, RTS_UI32 tag, const void *data, RTS_UI32 size)
{
    RTS_UNUSED(log);
    RTS_UNUSED(tag);
    saves++;
    memcpy(written, data, size);
    return ERR_OK;
}

RTS_UI32 FlashLogCapacity(const FLASH_LOG *log)
{
    RTS_UNUSED(log);
    return AREA_SIZE;
}

RTS_RESULT FlashLogKeep(FLASH_LOG *log, RTS_UI32 until)
{
    RTS_UNUSED(log);
    RTS_UNUSED(until);
    return ERR_OK;
}

void FlashLogKeepNone(FLASH_LOG *log)
{
    RTS_UNUSED(log);
}

RTS_RESULT SysFileRead(RTS_UI32 file, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_UNUSED(file);
    RTS_UNUSED(offset);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_DEVICE;
}

RTS_RESULT RetainTableNext(RETAIN_TABLE *table, KEPT *kept)
{
    RTS_UNUSED(table);
    RTS_UNUSED(kept);
    return ERR_NO_OBJECT;
}

bool IecTaskBetweenCycles(void (*copy_it)(void))
{
    asked++;
    if (moment)
        copy_it();
    return moment;
}

RTS_UI32 SysTimeGetMs(void)
{
    return now_ms;
}

void LogAddEntry(RTS_UI32 component, RTS_UI32 log_class, RTS_UI32 error, const char *format, ...)
{
    RTS_UNUSED(component);
    RTS_UNUSED(log_class);
    RTS_UNUSED(error);
    RTS_UNUSED(format);
}

RTS_RESULT CMRegisterExternal(const CMP_EXT_FUNCTION *table, RTS_SIZE count)
{
    RTS_UNUSED(table);
    RTS_UNUSED(count);
    return ERR_OK;
}

/* An application whose initial values have been saved; `ms` later. */
static void begin(RTS_UI32 ms)
{
    static const RETAIN_TABLE table = {0, 0, sizeof(CDL_KEPT), AREA_SIZE};

    now_ms = 0;
    moment = false;
    CHECK_EQUAL(CmpRetain_Hook(CH_INIT), ERR_OK);
    CHECK_EQUAL(CmpRetain_Hook(CH_INIT2), ERR_OK);
    RetainAttach(area, &table, 1);
    RetainSettle(false);
    saves = 0;
    asked = 0;
    now_ms = ms;
}

static void pass(void)
{
    CHECK_EQUAL(CmpRetain_Hook(CH_COMM_CYCLE), ERR_OK);
}

static void a_copy_is_asked_for_until_it_is_there_and_saved_once(void)
{
    begin(1000);
    area[0]++;
    pass();
    pass();
    CHECK(asked == 2 && saves == 0);
    moment = true;
    pass();
    CHECK(asked == 3 && saves == 1 && written[0] == area[0]);
    pass();
    CHECK(asked == 3 && saves == 1);
}

static void what_did_not_change_is_not_asked_for(void)
{
    begin(1000);
    pass();
    area[0]++;
    now_ms += 999;
    pass();
    CHECK_EQUAL(asked, 0);
    now_ms++;
    pass();
    CHECK_EQUAL(asked, 1);
}

/* What the tasks copied meanwhile is not what is saved. */
static void a_stop_while_a_copy_is_asked_for_saves_what_is_there(void)
{
    begin(1000);
    area[0]++;
    pass();
    memset(saved_area, 0xEE, AREA_SIZE);
    area[0]++;
    CHECK_EQUAL(RetainSave(false), ERR_OK);
    CHECK(saves == 1 && memcmp(written, area, AREA_SIZE) == 0);
    now_ms += 1000;
    pass();
    CHECK(asked == 1 && saves == 1);
}

static void nothing_is_saved_before_the_initialisation_is_over(void)
{
    static const RETAIN_TABLE table = {0, 0, sizeof(CDL_KEPT), AREA_SIZE};

    begin(1000);
    RetainAttach(area, &table, 1);
    now_ms += 5000;
    pass();
    CHECK_EQUAL(RetainSave(false), ERR_OK);
    RetainSettle(true); /* it failed */
    pass();
    CHECK_EQUAL(RetainSave(true), ERR_OK);
    CHECK(asked == 0 && saves == 0);
    RetainSettle(false);
    CHECK_EQUAL(saves, 1);
}

int main(void)
{
    RUN(a_copy_is_asked_for_until_it_is_there_and_saved_once);
    RUN(what_did_not_change_is_not_asked_for);
    RUN(a_stop_while_a_copy_is_asked_for_saves_what_is_there);
    RUN(nothing_is_saved_before_the_initialisation_is_over);
    return test_result();
}
