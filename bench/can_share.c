/*
 * can_share.c - how much of a CAN bus carries image bytes during a download, on a simulated bus: virtual time, so the
 * figures are the same on every machine. The device and the tool take no time; what is measured are the frames.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Prints a line for each kind of bus: its name, bytes, seconds, and the share of what ISO-TP carries at best: packets of
 * the largest size, one after the other, of which all bytes count.
 */
#include <stdio.h>
#include <string.h>

#include "CmpPackets.h"
#include "CmpBytes.h"
#include "can_client.h"
#include "comm_fakes.h"

enum { IMAGE = 16000, PIECE = 4000, KBIT = 1000 };

static RTS_UI8 image[IMAGE];

static bool send_piece(CLIENT *client, RTS_UI32 offset)
{
    static RTS_UI8 content[PIECE + 64];
    CDL_POSITION position;
    BTAG_WRITER writer;
    static REPLY reply;

    BytesPut32(position.flags, 0);
    BytesPut32(position.offset, offset);
    BytesPut32(position.total_size, IMAGE);
    BytesPut32(position.crc, 0x12345678);
    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0, &position, sizeof(position));
    BTagWrite(&writer, TAG_CDL_DATA, BTAG_ALIGN_0, image + offset, PIECE);
    return client_call(client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, &writer, &reply) &&
           reply_number(&reply, TAG_CDL_NEXT) == offset + PIECE;
}

static double frame_seconds(RTS_UI32 size, bool fd)
{
    CAN_FRAME frame = {.id = CAN_ID_BASE | DEVICE_NODE << CAN_TARGET_SHIFT | 200,
                       .flags = CAN_FLAG_EXTENDED | (fd ? CAN_FLAG_FD | CAN_FLAG_FAST : 0),
                       .size = (RTS_UI8)CanRoundSize(size)};

    memcpy(frame.data, image, frame.size);
    return (double)SimCanFrameNs(&frame) / 1e9;
}

/* Seconds a byte takes at best: a first frame, one of flow control, all others full. */
static double best(bool fd)
{
    RTS_UI32 full = fd ? CAN_FD_SIZE : CAN_CLASSIC_SIZE;
    RTS_UI32 left = BLK_MAX_SIZE - (full - 2);
    double packet = frame_seconds(full, fd) + frame_seconds(ISOTP_FLOW_SIZE, fd);

    for (; left > full - 1; left -= full - 1)
        packet += frame_seconds(full, fd);
    return (packet + frame_seconds(1 + left, fd)) / BLK_MAX_SIZE;
}

static bool measure(const char *name, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    CLIENT client;

    can_start(bit_rate, data_bit_rate);
    can_client(&client, can_tool(200));
    bool done = client_open(&client) && client_login(&client) && client_login_app(&client);
    RTS_I64 start = SimCanNow();
    for (RTS_UI32 offset = 0; done && offset < IMAGE; offset += PIECE)
        done = send_piece(&client, offset);
    double seconds = (double)(SimCanNow() - start) / 1e9;
    printf("%s\t%d\t%.4f\t%.4f\n", name, IMAGE, seconds, IMAGE * best(data_bit_rate != 0) / seconds);
    can_end();
    return done;
}

int main(void)
{
    for (RTS_UI32 i = 0, random = 1; i < IMAGE; i++) {
        random = random * 1664525u + 1013904223u;
        image[i] = (RTS_UI8)(random >> 24);
    }
    return measure("CAN 125 kbit/s", 125 * KBIT, 0) && measure("CAN 500 kbit/s", 500 * KBIT, 0) &&
                   measure("CAN 1 Mbit/s", 1000 * KBIT, 0) &&
                   measure("CAN FD 500 kbit/s, 2 Mbit/s", 500 * KBIT, 2000 * KBIT)
               ? 0
               : 1;
}
