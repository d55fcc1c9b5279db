/*
 * can_share.c - how much of a CAN bus carries image bytes during a download, on a simulated bus: virtual time, so the
 * figures are the same on every machine. The device and the tool take no time; what is measured are the frames. Data
 * are sent as plctool sends them: messages that fill their packets, the next one before the reply to the previous one
 * has come.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Prints a line for each kind of bus, longest message and longest packet: its name, these lengths, bytes, seconds, and
 * bytes per second at best: of ISO-TP alone, packets of the largest size, one after the other, of which all bytes count;
 * and with the heads of router, channel, message and elements in them.
 */
#include <stdio.h>
#include <string.h>

#include "CmpPackets.h"
#include "CmpBytes.h"
#include "can_client.h"
#include "comm_fakes.h"

enum {
    IMAGE = 16000,
    KBIT = 1000,
    UNIT = 16,            /* pieces are multiples of it */
    ACKNOWLEDGEMENTS = 4, /* at most, before a reply */
    UNDER_WAY = 6,        /* messages */
    FOR_ALL = 4,          /* messages for which there is one reply */
};

static RTS_UI8 image[IMAGE];

static RTS_UI8 message[NETSERVER_MESSAGE_SIZE];

static RTS_UI32 make_message(const CLIENT *client, RTS_UI32 offset, RTS_UI32 size, bool may_wait)
{
    static RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
    CDL_POSITION position;
    BTAG_WRITER writer;

    BytesPut32(position.flags, (offset == 0 ? 0 : DLF_CONTINUEDOWNLOAD) | (may_wait ? DLF_REPLYMAYWAIT : 0));
    BytesPut32(position.offset, offset);
    BytesPut32(position.total_size, IMAGE);
    BytesPut32(position.crc, 0x12345678);
    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0, &position, sizeof(position));
    BTagWrite(&writer, TAG_CDL_DATA, BTAG_ALIGN_0, image + offset, size);
    return client_message(client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, content, writer.size, message);
}

/* Bytes of a message besides those of the image. */
static RTS_UI32 heads(const CLIENT *client)
{
    return make_message(client, 0, UNIT, false) - UNIT;
}

/* What the device has by now, as its next reply says; 0 when there is none. Acknowledgements may come before it. */
static RTS_UI32 take_reply(CLIENT *client)
{
    REPLY reply;
    RTS_UI32 size = 0;

    for (RTS_UI32 i = 0; i < ACKNOWLEDGEMENTS && size == 0; i++)
        size = client_take_message(client, message);
    if (size < 20)
        return 0;
    BTagReaderInit(&reply.tags, message + 20, size - 20);
    return reply_number(&reply, TAG_CDL_NEXT);
}

enum { PREFIX = CHANNEL_FIRST_SIZE - sizeof(CHANNEL_DATA) }; /* of a message in its first block */

/* Bytes of a message in a block. */
static RTS_UI32 block_room(const CLIENT *client)
{
    return client_room(client) - (RTS_UI32)sizeof(CHANNEL_DATA);
}

/* Bytes of a message of `longest` bytes at most that fills its packets. */
static RTS_UI32 filling(const CLIENT *client, RTS_UI32 longest)
{
    RTS_UI32 filled = (longest + PREFIX) / block_room(client) * block_room(client);

    return filled == 0 ? longest : filled - PREFIX;
}

/* Bytes of the image in it. */
static RTS_UI32 piece_of(const CLIENT *client, RTS_UI32 longest)
{
    return (filling(client, longest) - heads(client)) / UNIT * UNIT;
}

/* Each FOR_ALL pieces have one reply, and so has the last one. */
static bool has_reply(RTS_UI32 piece, RTS_UI32 pieces)
{
    return piece % FOR_ALL == FOR_ALL - 1 || piece + 1 == pieces;
}

static bool send_image(CLIENT *client, RTS_UI32 longest)
{
    RTS_UI32 piece = piece_of(client, longest);
    RTS_UI32 pieces = (IMAGE + piece - 1) / piece;
    RTS_UI32 replied = 0;
    RTS_UI32 arrived = 0;

    for (RTS_UI32 sent = 0; sent < pieces || replied < pieces;) {
        RTS_UI32 left = IMAGE - sent * piece;
        if (sent < pieces && sent - replied < UNDER_WAY) {
            client_send_message(
                client, message,
                make_message(client, sent * piece, left < piece ? left : piece, !has_reply(sent, pieces)));
            sent++;
            continue;
        }
        for (; !has_reply(replied, pieces); replied++)
            client->received++;
        replied++;
        if ((arrived = take_reply(client)) == 0)
            return false;
    }
    return arrived == IMAGE;
}

static double frame_seconds(RTS_UI32 size, bool fd)
{
    CAN_FRAME frame = {.id = CAN_ID_BASE | DEVICE_NODE << CAN_TARGET_SHIFT | 200,
                       .flags = CAN_FLAG_EXTENDED | (fd ? CAN_FLAG_FD | CAN_FLAG_FAST : 0),
                       .size = (RTS_UI8)CanRoundSize(size)};

    memcpy(frame.data, image, frame.size);
    return (double)SimCanFrameNs(&frame) / 1e9;
}

/* Seconds a packet takes at best: a first frame, one of flow control, all others full. */
static double packet_seconds(RTS_UI32 size, bool fd)
{
    RTS_UI32 full = fd ? CAN_FD_SIZE : CAN_CLASSIC_SIZE;
    RTS_UI32 left = size - (full - 2);
    double packet = frame_seconds(full, fd) + frame_seconds(ISOTP_FLOW_SIZE, fd);

    for (; left > full - 1; left -= full - 1)
        packet += frame_seconds(full, fd);
    return packet + frame_seconds(1 + left, fd);
}

/* Bytes of the image per second when messages of `longest` bytes at most follow each other, each in as few packets as it
 * needs, and nothing is sent back. */
static double framed_rate(const CLIENT *client, RTS_UI32 longest, bool fd)
{
    RTS_UI32 size = filling(client, longest);
    double seconds = 0;

    for (RTS_UI32 left = PREFIX + size, part; left != 0; left -= part) {
        part = left < block_room(client) ? left : block_room(client);
        seconds += packet_seconds(CLIENT_HEADER_SIZE + (RTS_UI32)sizeof(CHANNEL_DATA) + part, fd);
    }
    return (size - heads(client)) / seconds;
}

static bool measure(const char *name, RTS_UI32 longest, RTS_UI32 packet, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    CLIENT client;

    can_start(bit_rate, data_bit_rate);
    can_client(&client, can_tool(200));
    client.packet = packet;
    client_send_open(&client, 7, longest);
    bool done = client_take_open(&client) == CHANNEL_OPEN_OK && client_login(&client) && client_login_app(&client);
    RTS_I64 start = SimCanNow();
    done = done && send_image(&client, longest);
    double seconds = (double)(SimCanNow() - start) / 1e9;
    RTS_UI32 size = packet > BLK_MAX_SIZE ? packet : BLK_MAX_SIZE;
    done = done && client_room(&client) == size - CLIENT_HEADER_SIZE;
    printf("%s\t%u\t%u\t%d\t%.4f\t%.0f\t%.0f\n", name, (unsigned)longest, (unsigned)size, IMAGE, seconds,
           size / packet_seconds(size, data_bit_rate != 0), framed_rate(&client, longest, data_bit_rate != 0));
    can_end();
    return done;
}

int main(void)
{
    static const struct {
        RTS_UI32 message;
        RTS_UI32 packet; /* 0: those of all devices */
    } longest[] = {{576, 0}, {2048, 0}, {2048, CAN_PACKET_SIZE}, {NETSERVER_MESSAGE_SIZE, CAN_PACKET_SIZE}};
    bool done = true;

    for (RTS_UI32 i = 0, random = 1; i < IMAGE; i++) {
        random = random * 1664525u + 1013904223u;
        image[i] = (RTS_UI8)(random >> 24);
    }
    for (RTS_UI32 i = 0; i < RTS_COUNT(longest); i++)
        done = done && measure("CAN 125 kbit/s", longest[i].message, longest[i].packet, 125 * KBIT, 0) &&
               measure("CAN 500 kbit/s", longest[i].message, longest[i].packet, 500 * KBIT, 0) &&
               measure("CAN 1 Mbit/s", longest[i].message, longest[i].packet, 1000 * KBIT, 0) &&
               measure("CAN FD 500 kbit/s, 2 Mbit/s", longest[i].message, longest[i].packet, 500 * KBIT, 2000 * KBIT);
    return done ? 0 : 1;
}
