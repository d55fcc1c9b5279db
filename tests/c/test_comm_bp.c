/*
 * test_comm_bp.c - CmpAppBPSrv: the services of breakpoints, and requests that would do harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppBP.h"
#include "CmpPackets.h"
#include "monitor_fixture.h"

static void begin(void)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
}

/* Sends; TAG_ERROR, or the result in the reply. */
static RTS_UI32 call(RTS_UI16 service)
{
    CHECK(client_call(&client, SG_APPLICATION_BP, service, &writer, &reply));
    return reply_error(&reply) != ERR_OK ? reply_error(&reply) : reply_number(&reply, TAG_SERVICE_RESULT);
}

static void a_debugger_comes_and_goes(void)
{
    setup();
    begin();
    BTagWrite32(&writer, TAG_BP_KEEP, 1);
    CHECK_EQUAL(call(SRV_BP_ATTACH), ERR_OK);
    CHECK_EQUAL(fakes.bp.attached, 1);
    CHECK_EQUAL(fakes.bp.kept, 1);
    begin();
    CHECK_EQUAL(call(SRV_BP_DETACH), ERR_OK);
    CHECK_EQUAL(fakes.bp.detached, 1);
}

static void the_state_has_its_layout_and_says_that_the_debugger_lives(void)
{
    BTAG tag;
    const BP_STATE *state;

    setup();
    fakes.bp.status.halted = 1;
    fakes.bp.status.serial = 7;
    fakes.bp.status.code_offset = 0x1234;
    fakes.bp.status.stack = 0x1122334455667788u;
    fakes.bp.status.area[APP_AREA_CODE] = 0xCAFE;
    begin();
    CHECK(client_call(&client, SG_APPLICATION_BP, SRV_BP_STATUS, &writer, &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_BP_STATE, sizeof(BP_STATE), sizeof(BP_STATE), &tag), ERR_OK);
    state = (const BP_STATE *)tag.data;
    CHECK_EQUAL(BytesGet32(state->halted), 1);
    CHECK_EQUAL(BytesGet32(state->serial), 7);
    CHECK_EQUAL(BytesGet32(state->code_offset), 0x1234);
    CHECK_EQUAL(BytesGet32(state->stack + 4), 0x11223344);
    CHECK_EQUAL(BytesGet32(state->area + 8 * APP_AREA_CODE), 0xCAFE);
    CHECK_EQUAL(fakes.bp.alive, 1);
}

static RTS_UI32 set(const BP_RECORD *record, RTS_UI32 size)
{
    begin();
    BTagWrite(&writer, TAG_BP_RECORD, BTAG_ALIGN_0, record, size);
    return call(SRV_BP_SET);
}

static void a_breakpoint_arrives_with_its_condition(void)
{
    BP_RECORD record = {{0x10}, {3}, {0}, BP_LESS, BP_SIGNED, {0}, {1, 2, 4, 0xFF, {8, 0, 0, 0, 12}}, {0xFE, 0xFF}};
    const BP_BREAKPOINT *entry = &fakes.bp.list[0];

    setup();
    CHECK_EQUAL(set(&record, sizeof record), ERR_OK);
    CHECK_EQUAL(entry->offset, 0x10);
    CHECK_EQUAL(entry->skip, 3);
    CHECK_EQUAL(entry->condition.relation, BP_LESS);
    CHECK_EQUAL(entry->condition.kind, BP_SIGNED);
    CHECK_EQUAL(entry->condition.value, 0xFFFE);
    CHECK_EQUAL(entry->condition.place.offset[1], 12);
    CHECK_EQUAL(entry->condition.place.pointers, 2);
}

static void a_bad_breakpoint_is_refused(void)
{
    BP_RECORD record = {{0x10}, {0}, {0}, BP_EQUAL, 0, {0}, {0, PLACE_POINTERS + 1, 4, 0xFF, {0}}, {0}};

    setup();
    CHECK_EQUAL(set(&record, sizeof record), ERR_PARAMETER);
    CHECK_EQUAL(set(&record, sizeof record - 1), ERR_SIZE_MISMATCH);
    begin();
    CHECK_EQUAL(call(SRV_BP_SET), ERR_L7_TAG_MISSING);
    CHECK_EQUAL(fakes.bp.count, 0);
}

static void temporary_traps_replace_those_of_before_unless_more_come(void)
{
    setup();
    begin();
    BTagWrite(&writer, TAG_BP_OFFSETS, BTAG_ALIGN_0, "\x01\0\0\0\x02\0\0\0", 8);
    CHECK_EQUAL(call(SRV_BP_TEMPORARY), ERR_OK);
    BTagWrite32(&writer, TAG_BP_MORE, 1);
    CHECK_EQUAL(call(SRV_BP_TEMPORARY), ERR_OK);
    CHECK_EQUAL(fakes.bp.temporary_count, 4);
    begin();
    BTagWrite(&writer, TAG_BP_OFFSETS, BTAG_ALIGN_0, "\x09\0\0\0", 4);
    CHECK_EQUAL(call(SRV_BP_TEMPORARY), ERR_OK);
    CHECK_EQUAL(fakes.bp.temporary_count, 1);
    CHECK_EQUAL(fakes.bp.temporary[0], 9);
    begin();
    BTagWrite(&writer, TAG_BP_OFFSETS, BTAG_ALIGN_0, "\x09\0\0\0\x01", 5);
    CHECK_EQUAL(call(SRV_BP_TEMPORARY), ERR_SIZE_MISMATCH);
}

static void variables_to_compare_arrive_with_or_without_their_traps(void)
{
    BP_RECORD record = {{0}, {0}, {0}, 0, 0, {0}, {1, 1, 4, 0xFF, {8, 0, 0, 0, 12}}, {0}};

    setup();
    begin();
    BTagWrite(&writer, TAG_BP_RECORD, BTAG_ALIGN_0, &record, sizeof record);
    CHECK_EQUAL(call(SRV_BP_WATCH), ERR_OK);
    CHECK_EQUAL(fakes.bp.watches, 1);
    CHECK_EQUAL(fakes.bp.watch.offset[1], 12);
    CHECK_EQUAL(fakes.bp.watch_traps, 0);
    begin();
    BTagWrite(&writer, TAG_BP_OFFSETS, BTAG_ALIGN_0, "\x01\0\0\0\x02\0\0\0", 8);
    BTagWrite32(&writer, TAG_BP_MORE, 1);
    CHECK_EQUAL(call(SRV_BP_WATCH), ERR_OK);
    CHECK_EQUAL(fakes.bp.watches, 1);
    CHECK_EQUAL(fakes.bp.watch_traps, 3);
    record.place.pointers = PLACE_POINTERS + 1;
    begin();
    BTagWrite(&writer, TAG_BP_RECORD, BTAG_ALIGN_0, &record, sizeof record);
    CHECK_EQUAL(call(SRV_BP_WATCH), ERR_PARAMETER);
    CHECK_EQUAL(fakes.bp.watches + fakes.bp.watch_traps, 0);
}

static RTS_UI32 go(RTS_UI32 how, RTS_UI32 serial)
{
    begin();
    BTagWrite32(&writer, TAG_BP_HOW, how);
    BTagWrite32(&writer, TAG_BP_SERIAL, serial);
    return call(SRV_BP_GO);
}

static void a_request_to_go_on_is_for_one_halt(void)
{
    setup();
    fakes.bp.status.serial = 5;
    CHECK_EQUAL(go(BP_STEP, 5), ERR_OK);
    CHECK_EQUAL(fakes.bp.how, BP_STEP);
    CHECK_EQUAL(go(BP_GO, 4), ERR_OK);
    CHECK_EQUAL(fakes.bp.gone_on, 1);
}

static RTS_UI32 read_stack(RTS_UI32 distance, RTS_UI32 size)
{
    begin();
    BTagWrite32(&writer, TAG_BP_DISTANCE, distance);
    BTagWrite32(&writer, TAG_BP_SIZE, size);
    return call(SRV_BP_READ_STACK);
}

static void the_stack_is_read_and_written_within_its_bounds(void)
{
    static const RTS_UI32 bad[][2] = {{60, 8}, {0, 65}, {0xFFFFFFFF, 8}, {8, 0xFFFFFFFF}, {0, 0}, {64, 1}};
    BTAG data;
    RTS_UI32 i;

    setup();
    memcpy(fakes.bp.stack + 8, "abcdefgh", 8);
    CHECK_EQUAL(read_stack(8, 8), ERR_OK);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_BP_DATA, 8, 8, &data), ERR_OK);
    CHECK(memcmp(data.data, "abcdefgh", 8) == 0);
    for (i = 0; i < RTS_COUNT(bad); i++)
        CHECK_EQUAL(read_stack(bad[i][0], bad[i][1]), ERR_OUT_OF_LIMITS);
    begin();
    BTagWrite32(&writer, TAG_BP_DISTANCE, 60);
    BTagWrite(&writer, TAG_BP_DATA, BTAG_ALIGN_0, "wxyz", 4);
    CHECK_EQUAL(call(SRV_BP_WRITE_STACK), ERR_OK);
    CHECK(memcmp(fakes.bp.stack + 60, "wxyz", 4) == 0);
    begin();
    BTagWrite32(&writer, TAG_BP_DISTANCE, 61);
    BTagWrite(&writer, TAG_BP_DATA, BTAG_ALIGN_0, "wxyz", 4);
    CHECK_EQUAL(call(SRV_BP_WRITE_STACK), ERR_OUT_OF_LIMITS);
}

static void one_breakpoint_is_cleared_or_all(void)
{
    BP_RECORD record = {{0x10}, {0}, {0}, 0, 0, {0}, {0, 0, 0, 0, {0}}, {0}};
    BTAG offsets;

    setup();
    CHECK_EQUAL(set(&record, sizeof record), ERR_OK);
    begin();
    CHECK(client_call(&client, SG_APPLICATION_BP, SRV_BP_LIST, &writer, &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_BP_OFFSETS, 8, 8, &offsets), ERR_OK);
    BTagWrite32(&writer, TAG_BP_OFFSET, 0x10);
    CHECK_EQUAL(call(SRV_BP_CLEAR), ERR_OK);
    CHECK_EQUAL(fakes.bp.cleared, 0x10);
    begin();
    CHECK_EQUAL(call(SRV_BP_CLEAR), ERR_OK);
    CHECK_EQUAL(fakes.bp.count, 0);
}

int main(void)
{
    RUN(a_debugger_comes_and_goes);
    RUN(the_state_has_its_layout_and_says_that_the_debugger_lives);
    RUN(a_breakpoint_arrives_with_its_condition);
    RUN(a_bad_breakpoint_is_refused);
    RUN(temporary_traps_replace_those_of_before_unless_more_come);
    RUN(variables_to_compare_arrive_with_or_without_their_traps);
    RUN(a_request_to_go_on_is_for_one_halt);
    RUN(the_stack_is_read_and_written_within_its_bounds);
    RUN(one_breakpoint_is_cleared_or_all);
    return test_result();
}
