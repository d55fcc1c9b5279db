/*
 * test_comm_trace.c - CmpTraceSrv: the services of traces, and requests that would do harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpPackets.h"
#include "CmpTraceMgr.h"
#include "monitor_fixture.h"

typedef struct {
    TRACE_CONFIG head;
    MON2_PLACE records[2];
} CONFIG;

static CONFIG config;

static void setup_trace(void)
{
    setup();
    TraceDeleteAll();
    fakes.task_count = 1;
    memset(&config, 0, sizeof(config));
    BytesPut32(config.head.image_crc, FAKE_IMAGE_CRC);
    BytesPut32(config.head.every, 1);
    strcpy(config.head.name, "pump");
    config.head.records = 2;
    for (RTS_UI32 i = 0; i < 2; i++) {
        config.records[i].size = 4;
        config.records[i].mask = PLACE_ALL_BITS;
    }
}

static void begin_content(void)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
}

static bool call(RTS_UI16 service)
{
    return client_call(&client, SG_TRACE, service, &writer, &reply);
}

/* TAG_ERROR of the reply, else TAG_TRACE_RESULT, else ERR_OK. */
static RTS_UI32 create(RTS_UI32 size)
{
    BTAG tag;

    begin_content();
    BTagWrite(&writer, TAG_TRACE_CONFIG, BTAG_ALIGN_0, &config, size);
    CHECK(call(SRV_TRACE_CREATE));
    if (BTagFind(&reply.tags, TAG_TRACE_RESULT, 4, 4, &tag) == ERR_OK)
        return reply_number(&reply, TAG_TRACE_RESULT);
    return reply_error(&reply);
}

static RTS_UI32 ask(RTS_UI16 service, RTS_UI32 id)
{
    begin_content();
    BTagWrite32(&writer, TAG_TRACE_ID, id);
    CHECK(call(service));
    return reply_error(&reply);
}

static void a_packet_is_created_listed_read_and_deleted(void)
{
    BTAG tag;
    RTS_UI32 id;

    setup_trace();
    CHECK_EQUAL(create(sizeof(config)), ERR_OK);
    id = reply_number(&reply, TAG_TRACE_ID);
    CHECK_EQUAL(ask(SRV_TRACE_LIST, 0), ERR_OK);
    CHECK_EQUAL(reply_number(&reply, TAG_TRACE_ID), id);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_TRACE_CONFIG, sizeof(config), sizeof(config), &tag), ERR_OK);
    CHECK(memcmp(tag.data, &config, sizeof(config)) == 0);
    CHECK_EQUAL(ask(SRV_TRACE_LIST, id), ERR_OK);
    CHECK(BTagFind(&reply.tags, TAG_TRACE_ID, 4, 4, &tag) == ERR_L7_TAG_MISSING);
    CHECK_EQUAL(ask(SRV_TRACE_READ, id), ERR_OK);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_TRACE_STATE, sizeof(TRACE_STATE), sizeof(TRACE_STATE), &tag), ERR_OK);
    CHECK_EQUAL(BytesGet32(((const TRACE_STATE *)tag.data)->state), TRACE_TRIGGERED);
    CHECK_EQUAL(BytesGet32(((const TRACE_STATE *)tag.data)->count), 0);
    CHECK_EQUAL(ask(SRV_TRACE_DELETE, id), ERR_OK);
    CHECK_EQUAL(ask(SRV_TRACE_DELETE, id), ERR_INVALIDID);
    CHECK_EQUAL(ask(SRV_TRACE_READ, id), ERR_INVALIDID);
}

static void a_bad_place_is_named(void)
{
    setup_trace();
    config.records[1].area = 9;
    CHECK_EQUAL(create(sizeof(config)), MONITORING_ERR_INVALID_AREA);
    CHECK_EQUAL(reply_number(&reply, TAG_TRACE_RECORD), 1);
    config.records[1].area = APP_AREA_DATA;
    BytesPut32(config.records[1].offset, 0xFFFFFFFE);
    CHECK_EQUAL(create(sizeof(config)), MONITORING_ERR_INVALID_INDEX);
}

static void a_configuration_that_is_cut_off_or_too_long_creates_nothing(void)
{
    BTAG tag;

    setup_trace();
    for (RTS_UI32 size = 1; size < sizeof(config); size++)
        CHECK_EQUAL(create(size), ERR_SIZE_MISMATCH);
    config.head.records = 255;
    CHECK_EQUAL(create(sizeof(config)), ERR_SIZE_MISMATCH);
    CHECK_EQUAL(ask(SRV_TRACE_LIST, 0), ERR_OK);
    CHECK(BTagFind(&reply.tags, TAG_TRACE_ID, 4, 4, &tag) == ERR_L7_TAG_MISSING);
}

static void any_configuration_is_refused_or_recorded_within_the_buffer(void)
{
    RTS_UI32 random = 7;
    RTS_UI32 created = 0;

    setup_trace();
    for (RTS_UI32 i = 0; i < 4000; i++) {
        CONFIG before = config;
        for (RTS_UI32 n = 0; n < 1 + i % 3; n++) {
            random = random * 1664525 + 1013904223;
            ((RTS_UI8 *)&config)[4 + (random >> 8) % (sizeof(config) - 4)] = (RTS_UI8)(random >> 24);
        }
        if (create(sizeof(config)) == ERR_OK) {
            created++;
            CHECK_EQUAL(ask(SRV_TRACE_READ, reply_number(&reply, TAG_TRACE_ID)), ERR_OK);
        }
        if (i % 7 == 0)
            TraceDeleteAll();
        config = before;
    }
    CHECK(created > 50);
    TraceDeleteAll();
}

static void requests_without_their_elements_are_refused(void)
{
    setup_trace();
    for (RTS_UI16 service = SRV_TRACE_CREATE; service <= SRV_TRACE_READ; service++) {
        begin_content();
        CHECK(call(service));
        CHECK_EQUAL(reply_error(&reply), service == SRV_TRACE_LIST ? ERR_OK : ERR_L7_TAG_MISSING);
    }
    begin_content();
    CHECK(call(SRV_TRACE_READ + 1));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_UNKNOWNCMD);
}

int main(void)
{
    RUN(a_packet_is_created_listed_read_and_deleted);
    RUN(a_bad_place_is_named);
    RUN(a_configuration_that_is_cut_off_or_too_long_creates_nothing);
    RUN(any_configuration_is_refused_or_recorded_within_the_buffer);
    RUN(requests_without_their_elements_are_refused);
    return test_result();
}
