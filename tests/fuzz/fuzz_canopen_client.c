/*
 * fuzz_canopen_client.c - any replies to an SDO transfer of the manager: in one frame, in segments, in blocks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The first byte has the direction in bit 0 and, in the others, the size of the value in units of 4 bytes. Then a row of
 * steps: a byte whose bit 0 is a pause of so many ms, and whose bit 1 takes away the room to send; without bit 0 a reply of
 * 8 bytes follows. Whatever comes, the transfer ends in time, and nothing is written past the value.
 */
#include <string.h>

#include "CanopenSdoClient.h"
#include "fuzz.h"

enum { NODE = 5, TIMEOUT_MS = 100, FRAME = 8, UNIT = 4, MOST_FRAMES = 200, PAUSE = 1, IS_FULL = 2 };

static SDO_CLIENT client;
static RTS_UI32 now_ms, sent;
static bool is_full;

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    /* a read and a write of 200 bytes in blocks, a read in segments */
    static const uint8_t seeds[][64] = {
        {100, 0, 0x41, 0, 0x20, 0, 200, 0, 0, 0, 0, 0xC6, 0, 0x20, 0, 200, 0, 0, 0,        0,
         1,   1, 2,    3, 4,    5, 6,   7, 0, 2, 7, 6,    5, 4,    3, 2,   1, 0, 0x80 | 3, 1},
        {101, 0, 0xA4, 0, 0x20, 0,    20, 0,   0, 0, 0, 0xA2, 20, 20, 0,
         0,   0, 0,    0, 0,    0xA2, 9,  127, 0, 0, 0, 0,    0,  0,  0xA1},
        {8, 0, 0x41, 0, 0x20, 0, 14, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 0, 0x11, 1, 2, 3, 4, 5, 6, 7},
    };
    static const uint8_t sizes[] = {46, 37, 28};

    if (index >= sizeof(sizes) || capacity < sizes[index])
        return 0;
    memcpy(data, seeds[index], sizes[index]);
    return sizes[index];
}

static bool take_frame(void *owner, const CAN_FRAME *frame)
{
    (void)owner;
    FUZZ_CHECK(frame->size == FRAME && frame->id == CANOPEN_SDO_REQUEST + NODE);
    sent += !is_full;
    return !is_full;
}

static void pass(RTS_UI32 ms)
{
    now_ms += ms;
    sent = 0;
    SdoClientPoll(&client, now_ms);
    (void)SdoClientSend(&client, take_frame, NULL, now_ms);
    FUZZ_CHECK(sent < MOST_FRAMES); /* a block at the most */
    FUZZ_CHECK(client.writes || client.done <= client.room);
    FUZZ_CHECK(!client.writes || client.done <= client.size);
}

static void begin(RTS_UI8 head, RTS_UI8 *value)
{
    RTS_UI32 size = (RTS_UI32)(head & ~1u) / 2 * UNIT;

    memset(&client, 0, sizeof(client));
    client.timeout_ms = TIMEOUT_MS;
    client.in = value;
    client.room = size < UNIT ? UNIT : size;
    now_ms = 0xFFFFFF00; /* it wraps */
    is_full = false;
    if ((head & 1) != 0)
        SdoClientWrite(&client, NODE, 0x2000, 0, value, size, now_ms);
    else
        SdoClientRead(&client, NODE, 0x2000, 0, now_ms);
    pass(0);
}

static size_t step(const uint8_t *input, size_t size)
{
    CAN_FRAME reply = {.id = CANOPEN_SDO_REPLY + NODE, .size = FRAME};

    is_full = (input[0] & IS_FULL) != 0;
    if ((input[0] & PAUSE) != 0) {
        pass(input[0] >> 2);
        return 1;
    }
    memcpy(reply.data, input + 1, size - 1 < FRAME ? size - 1 : FRAME);
    SdoClientTake(&client, &reply, now_ms);
    pass(0);
    return 1 + FRAME;
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    RTS_UI8 *value;

    if (size == 0)
        return 0;
    value = calloc(input[0] < 2 ? UNIT : (input[0] & ~1u) / 2 * UNIT, 1); /* the sanitizer sees its end */
    begin(input[0], value);
    for (size_t i = 1; i < size; i += step(input + i, size - i))
        ;
    is_full = false;
    pass(TIMEOUT_MS);
    FUZZ_CHECK(client.state != SDO_BUSY && !client.has_request);
    free(value);
    return 0;
}
