/*
 * channel_fixture.c - see channel_fixture.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "channel_fixture.h"

CLIENT client;
RTS_UI8 message[NETSERVER_MESSAGE_SIZE + 512];
RTS_UI8 reply[NETSERVER_MESSAGE_SIZE];
RTS_UI8 package[BLK_MAX_SIZE];

const CHANNEL_COUNTERS *counters(void)
{
    return ChannelGetCounters();
}

void fill_driver(RTS_UI32 size)
{
    for (int i = 0; i < SIM_LINK_PACKETS; i++)
        client_send_block(&client, 1, FIRST, message, size, 0, 480);
}

void setup(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    CHECK(client_open(&client));
}

RTS_UI32 echo_message(RTS_UI32 data)
{
    RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, data);
    BTagOpen(&writer, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0);
    for (RTS_UI32 i = 0; i < data; i++)
        BTagAppend(&writer, &(RTS_UI8){(RTS_UI8)(i * 7)}, 1);
    BTagClose(&writer);
    return client_message(&client, SG_DEVICE, SRV_DEV_ECHO, content, writer.size, message);
}

RTS_UI32 take(RTS_UI8 type)
{
    RTS_UI32 size = client_take(&client, NULL, package);

    return size != 0 && package[0] == type ? size : 0;
}

bool is_silent(void)
{
    return client_take(&client, NULL, package) == 0;
}

bool is_ack(RTS_UI32 number, RTS_UI8 flags)
{
    return take(CHANNEL_PKG_ACK) == sizeof(CHANNEL_ACK) && package[1] == flags &&
           BytesGet16(package + 2) == client.channel && BytesGet32(package + 4) == number;
}

bool is_close(RTS_UI16 error)
{
    return take(CHANNEL_PKG_CLOSE) == sizeof(CHANNEL_CLOSE) && BytesGet16(package + 10) == error;
}

bool is_block(RTS_UI32 number)
{
    return take(CHANNEL_PKG_DATA) != 0 && BytesGet32(package + 4) == number;
}

bool works(CLIENT *who)
{
    REPLY answer;

    return client_request(who, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &answer);
}
