/*
 * canopen_download.h - a CANopen device whose manager replaces the program by block transfer, without a bus.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPEN_DOWNLOAD_H
#define CANOPEN_DOWNLOAD_H

#include "CanopenDevice.h"
#include "CmpBytes.h"
#include "CmpCan.h"
#include "CmpCanopenProgram.h"
#include "IoDrvCanopenDevice.h"
#include "app_image.h"

enum { DOWNLOAD_NODE = 5, DOWNLOAD_SEGMENT = 7, DOWNLOAD_MS = 1, NO_FRAME = -1 };

static CANOPEN_SLAVE downloaded; /* the device */
static const CANOPEN_PROGRAM *downloaded_program;
static CAN_FRAME download_reply;
static int download_last_frame = NO_FRAME; /* the manager sends no frame after this one */
static int download_frames;

static const CANOPEN_OBJECT download_objects[] = {
    {0x1018, 0, CANOPEN_UNSIGNED8, CANOPEN_ACCESS_READ, CANOPEN_CONSTANT, 1, 4},
    {0x1F50, 1, CANOPEN_DOMAIN, CANOPEN_ACCESS_WRITE, CANOPEN_PROGRAM_OBJECT, 1, PROGRAM_DATA},
    {0x1F51, 1, CANOPEN_UNSIGNED8, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE, CANOPEN_PROGRAM_OBJECT, 1,
     PROGRAM_CONTROL},
};

void IoDrvCanopenDeviceSetProgram(const CANOPEN_PROGRAM *program)
{
    downloaded_program = program;
}

RTS_UI32 IoDrvCanopenDeviceMakeReply(CAN_FRAME *frame)
{
    *frame = (CAN_FRAME){.id = CANOPEN_SDO_REPLY + DOWNLOAD_NODE, .size = 8, .data = {SDO_WRITE_DONE, 0x51, 0x1F, 1}};
    return 0;
}

static bool download_take(const CAN_FRAME *frame)
{
    if (frame->id == CANOPEN_SDO_REPLY + DOWNLOAD_NODE)
        download_reply = *frame;
    return true;
}

RTS_RESULT CanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    return download_take(frame) ? ERR_OK : ERR_DEVICE;
}

/* Sends a request; returns the first byte of the reply, 0: there is none. */
static RTS_UI8 download_say(const RTS_UI8 *data)
{
    CAN_FRAME frame = {.id = CANOPEN_SDO_REQUEST + DOWNLOAD_NODE, .size = 8};

    download_reply.data[0] = 0;
    if (download_last_frame != NO_FRAME && download_frames >= download_last_frame)
        return 0;
    download_frames++;
    memcpy(frame.data, data, sizeof(frame.data) < 8 ? sizeof(frame.data) : 8);
    CanopenDeviceTake(&downloaded, &frame, 500, DOWNLOAD_MS);
    (void)CmpCanopenProgram_Hook(CH_COMM_CYCLE);
    return download_reply.data[0];
}

static bool download_begin(RTS_UI32 size)
{
    RTS_UI8 request[8] = {0xC6, 0x50, 0x1F, 1};

    (void)CmpCanopenProgram_Hook(CH_INIT2);
    memset(&downloaded, 0, sizeof downloaded);
    downloaded.send = download_take;
    downloaded.program = downloaded_program;
    downloaded.objects = download_objects;
    downloaded.object_count = RTS_COUNT(download_objects);
    downloaded.first_node = DOWNLOAD_NODE;
    download_frames = 0;
    if (!CanopenDeviceBegin(&downloaded, DOWNLOAD_MS))
        return false;
    CanopenDevicePoll(&downloaded, DOWNLOAD_MS);
    BytesPut32(request + 4, size);
    return download_say(request) == 0xA4;
}

static bool download_blocks(const APP_BYTES *image)
{
    RTS_UI8 block = download_reply.data[4];
    RTS_UI8 number = 0;

    for (RTS_UI32 at = 0; at < image->size; at += DOWNLOAD_SEGMENT) {
        RTS_UI8 segment[8] = {0};
        RTS_UI32 left = image->size - at;
        RTS_UI8 last = left <= DOWNLOAD_SEGMENT ? 0x80 : 0;
        segment[0] = (RTS_UI8)(++number | last);
        memcpy(segment + 1, image->bytes + at, left < DOWNLOAD_SEGMENT ? left : DOWNLOAD_SEGMENT);
        RTS_UI8 reply = download_say(segment);
        if (last == 0 && number < block)
            continue;
        if (reply != 0xA2)
            return false;
        block = download_reply.data[2];
        number = 0;
    }
    return true;
}

/* The CRC of the transfer: the device computes it over the parts that it passes on. */
static RTS_UI16 download_crc(const APP_BYTES *image)
{
    RTS_UI32 crc = 0;

    for (RTS_UI32 i = 0; i < image->size; i++) {
        crc ^= (RTS_UI32)image->bytes[i] << 8;
        for (int bit = 0; bit < 8; bit++)
            crc = (crc & 0x8000) != 0 ? crc << 1 ^ 0x1021 : crc << 1;
    }
    return (RTS_UI16)crc;
}

/* ERR_FAILED: the device has refused, or the manager was killed. */
static RTS_RESULT download_by_canopen(const APP_BYTES *image)
{
    static const RTS_UI8 start[8] = {0x2F, 0x51, 0x1F, 1, PROGRAM_START};
    RTS_UI8 unused = (RTS_UI8)((DOWNLOAD_SEGMENT - image->size % DOWNLOAD_SEGMENT) % DOWNLOAD_SEGMENT);
    RTS_UI8 request[8] = {(RTS_UI8)(0xC1 | unused << 2)};

    BytesPut16(request + 1, download_crc(image));
    if (!download_begin(image->size) || !download_blocks(image) || download_say(request) != 0xA1)
        return ERR_FAILED;
    return download_say(start) == SDO_WRITE_DONE ? ERR_OK : ERR_FAILED;
}

#endif
