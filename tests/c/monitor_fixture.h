/*
 * monitor_fixture.h - a client that monitors an application, and the request it writes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef MONITOR_FIXTURE_H
#define MONITOR_FIXTURE_H

#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpSrv.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

RTS_STATIC_ASSERT(NETSERVER_MESSAGE_SIZE >= TESTS_NEED_MESSAGE_SIZE, tests_have_room);

static CLIENT client;
static REPLY reply;
static RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
static BTAG_WRITER writer;

static void setup(void)
{
    fakes_start();
    CHECK(client_connect(&client));
    for (RTS_UI32 area = 0; area < APP_AREA_COUNT; area++)
        for (RTS_UI32 i = 0; i < FAKE_AREA_SIZE; i++)
            fakes_area(area)[i] = (RTS_UI8)(i + 16 * area);
}

static inline void begin_request(void)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
    BTagOpen(&writer, TAG_MON2_APPLICATION, BTAG_ALIGN_0);
    BTagAppend32(&writer, client.app_session);
    BTagAppend32(&writer, FAKE_IMAGE_CRC);
    BTagAppendZeros(&writer, 12);
    BTagClose(&writer);
}

enum { POINTER_AT = 0x10, TARGET_AT = 0x20 };

static inline void put_pointer(RTS_UI32 area, RTS_UI32 offset, uintptr_t value)
{
    memset(fakes_area(area) + offset, 0, MON2_POINTER_SIZE);
    memcpy(fakes_area(area) + offset, &value, sizeof(value));
}

#endif
