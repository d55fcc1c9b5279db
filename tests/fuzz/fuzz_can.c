/*
 * fuzz_can.c - any frames from two tools to a device on a simulated bus, of classic CAN or FD: what it sends are frames
 * of its own identifiers, and a scan is answered in the end.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: frames, each after a byte: bits 0..3 its size, bit 4 the tool, bit 5 to all, bits 6 and 7: time that passes after
 * it (0, 1, 300 ms, 1.1 s).
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "CmpSrvNumbers.h"
#include "IsoTp.h"
#include "SimCan.h"
#include "comm_fakes.h"
#include "fuzz.h"

enum {
    NODE = 9,
    FIRST_TOOL = 200,
    TOOLS = 2,
    SCANNER = 230,
    LISTENER = TOOLS + 1,
    SIZE_MASK = 0x0F,
    NS_PER_MS = 1000000
};

static RTS_UI32 answers;

static void look_at(const CAN_FRAME *frame)
{
    RTS_UI32 target = frame->id >> CAN_TARGET_SHIFT & CAN_ADDRESS_MASK;

    FUZZ_CHECK((frame->id & CAN_ADDRESS_MASK) == NODE && (frame->flags & CAN_FLAG_EXTENDED) != 0);
    FUZZ_CHECK(target >= CAN_TOOL_MIN && target <= CAN_TOOL_MAX && frame->size != 0);
    FUZZ_CHECK(IsoTpKind(frame->data, frame->size) != ISOTP_OTHER);
    answers += target == SCANNER;
}

static void pass(RTS_UI32 ms)
{
    CAN_FRAME frame;

    for (RTS_UI32 i = 0; i <= ms; i += 10) {
        SimCanAdvance(SimCanNow() + 10 * NS_PER_MS);
        fakes_cycle(i == 0 ? ms % 10 : 10);
        while (SimCanReceive(LISTENER, &frame) == ERR_OK)
            if ((frame.id & CAN_ADDRESS_MASK) < CAN_TOOL_MIN)
                look_at(&frame);
    }
}

static void send(RTS_UI32 node, RTS_UI32 source, RTS_UI32 target, const uint8_t *data, RTS_UI32 size, bool fd)
{
    CAN_FRAME frame = {.id = CAN_ID_BASE | target << CAN_TARGET_SHIFT | source,
                       .flags = CAN_FLAG_EXTENDED | (fd ? CAN_FLAG_FD : 0),
                       .size = (RTS_UI8)size};

    memcpy(frame.data, data, size);
    (void)SimCanSend(node, &frame);
}

/* A scan; a packet in frames, of which the last one says how it ends. */
size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t scan[] = {0x28, 0x40, 0x01, 0x00, 0x04, 1, 2, 3, 4};
    static const uint8_t packet[] = {0x48, 0x10, 0x14, 0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x48, 0x21,
                                     0x00, 0x09, 0x00, 0xC8, 0x00, 0x00, 0xC2, 0x48, 0x22, 0x00, 0x01,
                                     0x01, 0x36, 0x65, 0x9D, 0xAB, 0x03, 0x30, 0x00, 0x00};
    static const uint8_t broken[] = {0x18, 0x12, 0x00, 1,    2,    3,    4,    5,    6,    0x08, 0x2F, 1, 2, 3, 4, 5, 6,
                                     7,    0xC3, 0x31, 0x00, 0x00, 0x41, 0x07, 0x08, 0x41, 0,    0,    0, 1, 2, 3, 4};
    static const struct {
        const uint8_t *data;
        size_t size;
    } seeds[] = {{scan, sizeof(scan)}, {packet, sizeof(packet)}, {broken, sizeof(broken)}};

    (void)capacity;
    if (index >= RTS_COUNT(seeds))
        return 0;
    memcpy(data, seeds[index].data, seeds[index].size);
    return seeds[index].size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t scan[] = {CAN_FRAME_SCAN, 0, 0x00, 0x04, 7, 7, 7, 7};
    static const RTS_UI32 times[] = {0, 1, 300, 1100};
    bool fd = size % 2 != 0;

    SimCanReset(1000000, fd ? 4000000 : 0);
    SimCanSetAddress(NODE, CAN_ID_BASE);
    fakes_start();
    for (RTS_UI32 node = 1; node <= TOOLS + 1; node++)
        SimCanStart(node);
    for (size_t i = 0; i < size;) {
        uint8_t head = data[i++];
        RTS_UI32 length = head & SIZE_MASK;
        if (length > size - i)
            length = (RTS_UI32)(size - i);
        RTS_UI32 tool = head >> 4 & 1;
        RTS_UI32 whole = length > CAN_CLASSIC_SIZE ? CAN_CLASSIC_SIZE : length;
        send(1 + tool, FIRST_TOOL + tool, (head & 0x20) != 0 ? CAN_TO_ALL : NODE, data + i, whole, fd);
        i += length;
        pass(times[head >> 6]);
    }
    pass(2 * ISOTP_TIMEOUT_MS + ISOTP_MAX_WAITS); /* what was begun is given up */
    answers = 0;
    send(TOOLS, SCANNER, NODE, scan, sizeof(scan), fd);
    pass(50);
    FUZZ_CHECK(answers == 1); /* the first frame of the reply */
    fakes_hook(CH_EXIT_COMM);
    fakes_hook(CH_EXIT3);
    return 0;
}
