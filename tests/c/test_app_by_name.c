/*
 * test_app_by_name.c - functions and variables of the program for components in C, also of damaged tables.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppByName.h"
#include "AppException.h"
#include "AppState.h"
#include "app_device.h"

enum { TYPE = 0x12345678, CALL = 0x1ABCDEF0, RESULT_OFFSET = 32 };

typedef struct {
    RTS_UI8 bytes[256];
    RTS_UI32 size;
} TABLE;

static void add_export(TABLE *table, const CDL_EXPORT *entry, const char *name)
{
    RTS_UI32 length = (RTS_UI32)strlen(name) + 1;

    memcpy(table->bytes + table->size, entry, sizeof *entry);
    memcpy(table->bytes + table->size + sizeof *entry, name, length);
    table->size = (table->size + (RTS_UI32)sizeof *entry + length + 3) & ~3u;
}

/* A counter, whose value is `counter`; `Add` adds 5 to the number it is called with. */
static void spec_with_table(APP_SPEC *spec, TABLE *table)
{
    CDL_EXPORT variable = {TYPE, CDL_EXPORT_VARIABLE, COUNTER_OFFSET, 4, APP_AREA_DATA};
    CDL_EXPORT function = {CALL, 0, RESULT_OFFSET, 4, APP_AREA_DATA};
    CDL_EXPORT endless = {CALL, 0, 0, 0, APP_AREA_NONE};

    spec_counter(spec, 3);
    memset(table, 0, sizeof *table);
    function.entry = here(spec);
    emit_add(spec, APP_AREA_DATA, RESULT_OFFSET, 5);
    emit_ret(spec);
    endless.entry = here(spec);
    emit_endless_loop(spec);
    add_export(table, &variable, "Counter");
    add_export(table, &endless, "Endless");
    add_export(table, &function, "Main.Add");
    spec->exports = table->bytes;
    spec->exports_size = table->size;
}

static RTS_RESULT load(const APP_SPEC *spec)
{
    APP_BYTES image;

    build_image(&image, spec);
    return download(&image);
}

static void a_component_finds_what_the_program_offers(void)
{
    APP_SPEC spec;
    TABLE table;
    APP_NAMED function, variable;
    RTS_I32 value = 7;

    start_blank();
    CHECK_EQUAL(AppFindFunctionByName("Main.Add", CALL, &function), ERR_APP_NOT_LOADED);
    spec_with_table(&spec, &table);
    CHECK_EQUAL(load(&spec), ERR_OK);
    CHECK_EQUAL(AppFindFunctionByName("mAIN.add", CALL, &function), ERR_OK);
    CHECK_EQUAL(AppCallFunction(&function, &value, sizeof value), ERR_OK);
    CHECK_EQUAL(value, 12);
    CHECK_EQUAL(AppFindVariableByName("counter", TYPE, &variable), ERR_OK);
    value = 40;
    CHECK_EQUAL(AppWriteVariable(&variable, &value, sizeof value), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(10000000), ERR_OK);
    CHECK_EQUAL(AppReadVariable(&variable, &value, sizeof value), ERR_OK);
    CHECK(value > 40);
    CHECK_EQUAL(AppFindFunctionByName("Counter", TYPE, &function), ERR_NO_OBJECT);
    CHECK_EQUAL(AppFindFunctionByName("Main", CALL, &function), ERR_NO_OBJECT);
    CHECK_EQUAL(AppFindFunctionByName("Main.Add2", CALL, &function), ERR_NO_OBJECT);
    CHECK_EQUAL(AppFindFunctionByName("Main.Add", CALL + 1, &function), ERR_APP_SIGNATURE_MISMATCH);
    CHECK_EQUAL(AppFindVariableByName("Counter", TYPE + 1, &variable), ERR_TYPE_MISMATCH);
}

static void a_wrong_size_or_kind_is_refused(void)
{
    APP_SPEC spec;
    TABLE table;
    APP_NAMED function, variable;
    RTS_I32 value[2] = {1, 2};

    start_blank();
    spec_with_table(&spec, &table);
    CHECK_EQUAL(load(&spec), ERR_OK);
    CHECK_EQUAL(AppFindFunctionByName("Main.Add", CALL, &function), ERR_OK);
    CHECK_EQUAL(AppFindVariableByName("Counter", TYPE, &variable), ERR_OK);
    CHECK_EQUAL(AppCallFunction(&function, value, sizeof value), ERR_SIZE_MISMATCH);
    CHECK_EQUAL(AppReadVariable(&variable, value, 2), ERR_SIZE_MISMATCH);
    CHECK_EQUAL(AppCallFunction(&variable, value, 4), ERR_INVALID_HANDLE);
    CHECK_EQUAL(AppReadVariable(&function, value, 4), ERR_INVALID_HANDLE);
    CHECK(value[0] == 1 && value[1] == 2);
}

static void an_endless_function_is_ended_and_stops_the_program(void)
{
    APP_SPEC spec;
    TABLE table;
    APP_NAMED endless;

    start_blank();
    spec_with_table(&spec, &table);
    CHECK_EQUAL(load(&spec), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(AppFindFunctionByName("Endless", CALL, &endless), ERR_OK);
    SimSetCycleLimit(100);
    CHECK_EQUAL(AppCallFunction(&endless, NULL, 0), ERR_EXCEPTION);
    SimSetCycleLimit(2000);
    CHECK_EQUAL(AppExceptionGet()->code, RTSEXCPT_WATCHDOG);
    CHECK_EQUAL(AppGetState(), AS_STOP);
    CHECK_EQUAL(AppCallFunction(&endless, NULL, 0), ERR_EXCEPTION);
    CHECK(log_has("Call from C: "));
}

static void what_was_found_is_valid_after_a_reset_and_refused_after_a_download(void)
{
    APP_SPEC spec;
    TABLE table;
    APP_NAMED function;
    RTS_I32 value = 1;

    start_blank();
    spec_with_table(&spec, &table);
    CHECK_EQUAL(load(&spec), ERR_OK);
    CHECK_EQUAL(AppFindFunctionByName("Main.Add", CALL, &function), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(AppCallFunction(&function, &value, sizeof value), ERR_OK);
    CHECK_EQUAL(value, 6);
    emit_ret(&spec);
    CHECK_EQUAL(load(&spec), ERR_OK);
    CHECK_EQUAL(AppCallFunction(&function, &value, sizeof value), ERR_INVALID_HANDLE);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(AppCallFunction(&function, &value, sizeof value), ERR_APP_NOT_LOADED);
    CHECK_EQUAL(value, 6);
}

/* Any word of the table is anything: nothing outside of the areas and the code is ever used. */
static void damaged_tables_are_refused_and_lead_nowhere(void)
{
    static const RTS_UI32 words[] = {0,          1,          60,         64,         0x7FFFFFFF,
                                     0x80000000, 0xFFFFFFFC, 0xFFFFFFFE, 0xFFFFFFFF, APP_AREA_CODE};
    static const char *const names[] = {"Counter", "Main.Add", "Nothing"};
    APP_SPEC spec;
    TABLE table;
    APP_NAMED named;
    RTS_UI8 value[4];
    RTS_UI32 size, i, k, n;

    spec_with_table(&spec, &table);
    for (size = 0; size < table.size; size += 4) {
        start_blank();
        spec.exports_size = size;
        CHECK_EQUAL(load(&spec), ERR_OK);
        CHECK(AppFindFunctionByName("Main.Add", CALL, &named) != ERR_OK);
    }
    spec.exports_size = table.size;
    for (i = 0; i < table.size; i += 4) {
        for (k = 0; k < RTS_COUNT(words); k++) {
            TABLE damaged = table;
            start_blank();
            memcpy(damaged.bytes + i, &words[k], sizeof words[k]);
            spec.exports = damaged.bytes;
            CHECK_EQUAL(load(&spec), ERR_OK);
            for (n = 0; n < RTS_COUNT(names); n++) {
                if (AppFindVariableByName(names[n], TYPE, &named) == ERR_OK) {
                    CHECK(AppReadVariable(&named, value, sizeof value) == ERR_OK || named.size != sizeof value);
                    CHECK(named.area < APP_AREA_CODE && named.offset + named.size <= 64);
                }
                if (AppFindFunctionByName(names[n], CALL, &named) == ERR_OK)
                    CHECK(named.entry < spec.code_size && (named.size == 0 || named.offset + named.size <= 64));
            }
        }
    }
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_component_finds_what_the_program_offers);
    RUN(a_wrong_size_or_kind_is_refused);
    RUN(an_endless_function_is_ended_and_stops_the_program);
    RUN(what_was_found_is_valid_after_a_reset_and_refused_after_a_download);
    RUN(damaged_tables_are_refused_and_lead_nowhere);
    return test_result();
}
