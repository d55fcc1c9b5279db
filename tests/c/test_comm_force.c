/*
 * test_comm_force.c - CmpMonitor2: the services that force variables, and requests that would do harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpForce.h"
#include "CmpPackets.h"
#include "monitor_fixture.h"

static void begin_force(void)
{
    begin_request();
    BTagOpen(&writer, TAG_MON2_FORCED, BTAG_ALIGN_0);
}

static void add_place(const MON2_PLACE *place, const void *value, RTS_UI32 size)
{
    BTagAppend(&writer, place, sizeof(*place));
    BTagAppend(&writer, value, size);
    BTagAppendZeros(&writer, 8 - size);
}

static void add(RTS_UI8 size, const void *value, RTS_UI8 area, RTS_UI32 offset)
{
    MON2_PLACE place = {area, 0, size, PLACE_ALL_BITS, {0}};

    BytesPut32(place.offset, offset);
    add_place(&place, value, size > 8 ? 8 : size);
}

/* Sends; returns TAG_ERROR, or TAG_MON2_ERROR, or ERR_OK when the reply is empty. */
static RTS_UI32 send_to(RTS_UI16 service)
{
    BTagClose(&writer);
    CHECK(client_call(&client, SG_MONITORING2, service, &writer, &reply));
    if (reply.size == 20)
        return ERR_OK;
    return reply_error(&reply) != ERR_OK ? reply_error(&reply) : reply_number(&reply, TAG_MON2_ERROR);
}

static RTS_UI32 send_force(void)
{
    return send_to(SRV_MON2_FORCE);
}

static RTS_UI32 force(RTS_UI8 size, const void *value, RTS_UI8 area, RTS_UI32 offset)
{
    begin_force();
    add(size, value, area, offset);
    return send_force();
}

/* Asks for the list from `start` on; how many entries came. */
static RTS_UI32 list(RTS_UI32 start, BTAG *entries)
{
    begin_request();
    BTagWrite32(&writer, TAG_MON2_FORCE_START, start);
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_FORCE_LIST, &writer, &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_MON2_FORCE_MAX), FORCE_MAX);
    if (BTagFind(&reply.tags, TAG_MON2_FORCED, 1, reply.tags.size, entries) != ERR_OK)
        return 0;
    CHECK_EQUAL(entries->size % sizeof(MON2_FORCED), 0);
    return entries->size / (RTS_UI32)sizeof(MON2_FORCED);
}

static void setup_forces(void)
{
    setup();
    ForceEndAll();
}

static void variables_are_forced_and_listed(void)
{
    static const MON2_PLACE bit = {APP_AREA_DATA, 0, 1, 0x04, {0x20}};
    BTAG entries;

    setup_forces();
    begin_force();
    add(1, "\xA1", APP_AREA_RETAIN, 1);
    add(8, "\xB1\xB2\xB3\xB4\xB5\xB6\xB7\xB8", APP_AREA_DATA, 8);
    add_place(&bit, "\x04", 1);
    CHECK_EQUAL(send_force(), ERR_OK);
    CHECK_EQUAL(fakes_area(APP_AREA_RETAIN)[1], 0xA1);
    CHECK_EQUAL(list(0, &entries), 3);
    CHECK(memcmp(entries.data,
                 "\x01\0\x01\xFF"
                 "\x01\0\0\0"
                 "\0\0\0\0\0\0\0\0\0\0\0\0"
                 "\xA1\0\0\0\0\0\0\0",
                 28) == 0);
    CHECK(memcmp(entries.data + 28,
                 "\0\0\x08\xFF"
                 "\x08\0\0\0"
                 "\0\0\0\0\0\0\0\0\0\0\0\0"
                 "\xB1\xB2\xB3\xB4\xB5\xB6\xB7\xB8",
                 28) == 0);
    CHECK(memcmp(entries.data + 56,
                 "\0\0\x01\x04"
                 "\x20\0\0\0"
                 "\0\0\0\0\0\0\0\0\0\0\0\0"
                 "\x04\0\0\0\0\0\0\0",
                 28) == 0);
    CHECK_EQUAL(list(2, &entries), 1);
    CHECK_EQUAL(list(3, &entries), 0);
    CHECK_EQUAL(list(0xFFFFFFFF, &entries), 0);
}

static void one_force_ends_or_all_do(void)
{
    BTAG entries;

    setup_forces();
    CHECK_EQUAL(force(1, "\x01", APP_AREA_DATA, 1), ERR_OK);
    CHECK_EQUAL(force(1, "\x02", APP_AREA_DATA, 2), ERR_OK);
    begin_force();
    add(1, "\0", APP_AREA_DATA, 1);
    add(1, "\0", APP_AREA_DATA, 3); /* not forced: another tool may have ended it */
    CHECK_EQUAL(send_to(SRV_MON2_UNFORCE), ERR_OK);
    CHECK_EQUAL(list(0, &entries), 1);
    CHECK_EQUAL(entries.data[4], 2);
    BTagWriterInit(&writer, content, sizeof(content) - 20);
    BTagOpen(&writer, TAG_APP_DESCRIPTOR, BTAG_ALIGN_2);
    BTagWrite32(&writer, TAG_APP_SESSION, client.app_session);
    BTagClose(&writer);
    CHECK(client_call(&client, SG_APPLICATION, SRV_APP_RELEASE_FORCE_LIST, &writer, &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_OK);
    CHECK_EQUAL(list(0, &entries), 0);
}

static void one_bad_entry_forces_nothing(void)
{
    static const struct {
        MON2_PLACE place;
        RTS_UI32 error;
    } bad[] = {
        {{APP_AREA_DATA, 0, 1, 0xFF, {FAKE_AREA_SIZE & 0xFF, FAKE_AREA_SIZE >> 8}}, MONITORING_ERR_INVALID_INDEX},
        {{APP_AREA_DATA, 0, 8, 0xFF, {(FAKE_AREA_SIZE - 7) & 0xFF, (FAKE_AREA_SIZE - 7) >> 8}},
         MONITORING_ERR_INVALID_INDEX},
        {{APP_AREA_DATA, 0, 4, 0xFF, {0xFF, 0xFF, 0xFF, 0xFF}}, MONITORING_ERR_INVALID_INDEX},
        {{APP_AREA_COUNT, 0, 1, 0xFF, {0}}, MONITORING_ERR_INVALID_AREA},
        {{0xFF, 0, 1, 0xFF, {0}}, MONITORING_ERR_INVALID_AREA},
        {{APP_AREA_CODE, 0, 1, 0xFF, {0}}, MONITORING_ERR_OPERATION_DENIED},
        {{APP_AREA_DATA, 0, 0, 0xFF, {0}}, MONITORING_ERR_UNSUPPORTED_DATATYPE},
        {{APP_AREA_DATA, 0, 3, 0xFF, {0}}, MONITORING_ERR_UNSUPPORTED_DATATYPE},
        {{APP_AREA_DATA, 0, 16, 0xFF, {0}}, MONITORING_ERR_UNSUPPORTED_DATATYPE},
        {{APP_AREA_DATA, 0, 2, 0x04, {0}}, MONITORING_ERR_UNSUPPORTED_DATATYPE},
        {{APP_AREA_DATA, PLACE_POINTERS + 1, 1, 0xFF, {0}}, MONITORING_ERR_NESTING_DEPTH},
        {{APP_AREA_DATA, 0xFF, 1, 0xFF, {0}}, MONITORING_ERR_NESTING_DEPTH},
    };
    BTAG entries;

    for (RTS_UI32 i = 0; i < RTS_COUNT(bad); i++) {
        setup_forces();
        begin_force();
        add(1, "\x01", APP_AREA_DATA, 1);
        add_place(&bad[i].place, "\1", 1);
        CHECK_EQUAL(send_force(), bad[i].error);
        CHECK_EQUAL(reply_number(&reply, TAG_MON2_ERROR_INDEX), 1);
        CHECK_EQUAL(list(0, &entries), 0);
    }
}

static void a_list_that_is_cut_off_forces_nothing(void)
{
    BTAG entries;

    for (RTS_UI32 missing = 1; missing <= 2 * sizeof(MON2_FORCED); missing += missing == 27 ? 2 : 1) {
        setup_forces();
        begin_force();
        add(1, "\x01", APP_AREA_DATA, 1);
        add(1, "\x02", APP_AREA_DATA, 2);
        writer.size -= missing;
        CHECK(send_force() != ERR_OK);
        CHECK_EQUAL(list(0, &entries), 0);
    }
}

static void a_full_list_refuses_the_first_one_that_has_no_room(void)
{
    BTAG entries;
    RTS_UI32 got;
    RTS_UI32 all = 0;

    setup_forces();
    for (RTS_UI32 i = 0; i < FORCE_MAX - 1; i++)
        CHECK_EQUAL(force(1, "\x01", APP_AREA_DATA, i), ERR_OK);
    begin_force();
    add(1, "\x09", APP_AREA_DATA, 0); /* is there */
    add(1, "\x01", APP_AREA_DATA, 500);
    add(1, "\x01", APP_AREA_DATA, 501);
    CHECK_EQUAL(send_force(), MONITORING_ERR_FORCE_FAILED);
    CHECK_EQUAL(reply_number(&reply, TAG_MON2_ERROR_INDEX), 2);
    while ((got = list(all, &entries)) != 0) /* in as many replies as it takes */
        all += got;
    CHECK_EQUAL(all, FORCE_MAX - 1);
    CHECK_EQUAL(force(1, "\x01", APP_AREA_DATA, 500), ERR_OK);
}

static void pointers_are_noted_and_must_lead_somewhere(void)
{
    MON2_PLACE place = {APP_AREA_DATA, 0, 1, PLACE_ALL_BITS, {POINTER_AT}};
    BTAG entries;

    setup_forces();
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)(fakes_area(APP_AREA_DATA) + POINTER_AT)); /* to itself */
    for (place.pointers = 1; place.pointers <= PLACE_POINTERS; place.pointers++) {
        begin_force();
        add_place(&place, fakes_area(APP_AREA_DATA) + POINTER_AT, 1);
        CHECK_EQUAL(send_force(), ERR_OK);
        CHECK_EQUAL(list(place.pointers - 1u, &entries), 1);
        CHECK_EQUAL(entries.data[1], place.pointers);
    }
    place.pointers = 1;
    put_pointer(APP_AREA_DATA, POINTER_AT, 0);
    begin_force();
    add_place(&place, "\x02", 1);
    CHECK_EQUAL(send_force(), MONITORING_ERR_INVALID_POINTER);
    begin_force();
    add_place(&place, "", 0); /* ends all the same */
    CHECK_EQUAL(send_to(SRV_MON2_UNFORCE), ERR_OK);
    CHECK_EQUAL(list(0, &entries), PLACE_POINTERS - 1);
}

static void a_read_says_that_something_is_forced(void)
{
    setup_forces();
    for (RTS_UI32 forced = 0; forced < 2; forced++) {
        begin_request();
        BTagOpen(&writer, TAG_MON2_READ_LIST, BTAG_ALIGN_2);
        BTagOpen(&writer, TAG_MON2_READ_VAR, BTAG_ALIGN_2);
        BTagWrite32(&writer, TAG_MON2_VAR_SIZE, 1);
        BTagWrite(&writer, TAG_MON2_VAR_CODE, BTAG_ALIGN_0, "\x02\x10\x00\x06\x00", 5);
        BTagClose(&writer);
        BTagClose(&writer);
        CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_READ, &writer, &reply));
        BTAG tag;
        CHECK_EQUAL(BTagFind(&reply.tags, TAG_MON2_FORCE_SERIAL, 4, 4, &tag) == ERR_OK, forced);
        CHECK_EQUAL(force(1, "\x01", APP_AREA_DATA, 1), ERR_OK);
    }
}

static void another_application_is_not_forced(void)
{
    setup_forces();
    fakes.status.image_crc ^= 1;
    CHECK_EQUAL(force(1, "\x01", APP_AREA_DATA, 1), ERR_APP_INVALID_DATAID);
    CHECK_EQUAL(ForceGetCount(), 0);
}

int main(void)
{
    RUN(variables_are_forced_and_listed);
    RUN(one_force_ends_or_all_do);
    RUN(one_bad_entry_forces_nothing);
    RUN(a_list_that_is_cut_off_forces_nothing);
    RUN(a_full_list_refuses_the_first_one_that_has_no_room);
    RUN(pointers_are_noted_and_must_lead_somewhere);
    RUN(a_read_says_that_something_is_forced);
    RUN(another_application_is_not_forced);
    return test_result();
}
