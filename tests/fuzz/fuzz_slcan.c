/*
 * fuzz_slcan.c - any bytes in any pieces on an SLCAN line: what comes out are frames that can exist, and the next good
 * line is one.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: the bytes of the line; the first one is how many are read at a time.
 */
#include <string.h>

#include "Slcan.h"
#include "fuzz.h"

static struct {
    const uint8_t *data;
    size_t size;
    size_t piece;
} line;

static RTS_UI32 read_line(RTS_UI8 *data, RTS_UI32 size)
{
    size_t count = size < line.size ? size : line.size;

    count = count < line.piece ? count : line.piece;
    memcpy(data, line.data, count);
    line.data += count;
    line.size -= count;
    return (RTS_UI32)count;
}

static RTS_UI32 write_line(const RTS_UI8 *data, RTS_UI32 size)
{
    (void)data;
    return size;
}

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const char *const seeds[] = {"\x40t12330A0B0C\rT1F40058080102030405060708\r",
                                        "\x07t0012AABB1234\rr1234\rR000000051\r\a\r",
                                        "\x09sw057101\rF24\rsb256256\rF00\rsa000000\r",
                                        "\001B00000001107\rd0019090000000000000000000000\rD1FFFFFFF0\r"};

    (void)capacity;
    if (index >= RTS_COUNT(seeds))
        return 0;
    memcpy(data, seeds[index], strlen(seeds[index]));
    return strlen(seeds[index]);
}

static void give(const uint8_t *data, size_t size)
{
    line.data = data;
    line.size = size;
}

static RTS_UI32 take_all(SLCAN *slcan, CAN_FRAME *frame)
{
    RTS_UI32 frames = 0;

    while (line.size != 0) {
        while (SlcanReceive(slcan, frame) == ERR_OK) {
            char text[SLCAN_TEXT_SIZE];
            CAN_FRAME again;
            FUZZ_CHECK(CanIsFrame(frame));
            RTS_UI32 size = SlcanEncode(frame, text);
            FUZZ_CHECK(size <= sizeof(text) && SlcanDecode(text, size - 1, &again) && again.id == frame->id);
            frames++;
        }
    }
    return frames;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t good[] = "\rT0ABCDEF0110\r";
    static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};
    static SLCAN slcan;
    CAN_FRAME frame;

    FUZZ_CHECK(SlcanOpen(&slcan, (SLCAN_LINE){read_line, write_line}, 500000, 2000000) == ERR_OK);
    FUZZ_CHECK(SlcanSetFilters(&slcan, all, RTS_COUNT(all)) == ERR_OK);
    line.piece = size != 0 && data[0] != 0 ? data[0] : 64;
    give(data, size);
    (void)take_all(&slcan, &frame);
    give(good, sizeof(good) - 1);
    FUZZ_CHECK(take_all(&slcan, &frame) >= 1 && frame.id == 0x0ABCDEF0);
    return 0;
}
