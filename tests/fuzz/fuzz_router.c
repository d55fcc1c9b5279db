/*
 * fuzz_router.c - any packet: nothing is answered but its sender, and no answer is longer than a block.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpSrvNumbers.h"
#include "SimLink.h"
#include "comm_fakes.h"
#include "fuzz.h"

#define SEED(bytes) {(const uint8_t *)(bytes), sizeof(bytes) - 1}

static const struct {
    const uint8_t *data;
    size_t size;
} packets[] = {
    SEED("\xC5\x6B\x40\x03\x00\x11\x00\xAF\x00\x01\x00\x00\x02\xC2\x00\x04\x01\x00\x00\x00"),
    SEED("\xC5\x6B\x40\x03\x00\x11\x00\xAF\x00\x01\x00\x00\x02\xC2\x01\x01\x01\x00\x00\x00"),
    SEED("\xC5\x6B\x40\x03\x00\x11\x00\xAF\x00\x01\x00\x00\x02\xC2\x03\x01\x01\x00\x00\x00"),
    SEED("\xC5\x6B\x40\x03\x00\x11\x00\xAF\x00\x01\x00\x00\x01\xC2\x00\x04\x01\x00\x00\x00N\0o\0d\0e\0"
         "7\0\0\0"),
    SEED("\xC5\x7C\x40\x03\x00\x10\x12\x34\x00\x32\x00\x00\x02\xC2\x00\x04\x69\x69\x20\x04"),
    SEED("\xC5\x0B\x40\x01\x00\x10\x00\xAF"),
    SEED("\xC5\x0B\x40\x02\x00\x10\x00\xAF\x12\x34\x56\x78"),
    SEED("\xC5\x6B\x40\x40\x00\x43\x2D\xDC\xC0\xA8\x38\x72\x2D\xDF\x0A\x00\x02\x0F\x83\x0F"
         "\xC3\x00\x01\x01\x08\x92\x77\xAC\x81\xD4\x21\x83\x00\x40\x1F\x00\x05\x00\x00\x00"),
    SEED("\xC5\x6B\x40\x40\x00\x11\x00\x01\x00\x02\x00\x00\xC2\x00\x01\x01\x36\x65\x9D\xAB"),
};

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    if (index >= RTS_COUNT(packets) || packets[index].size > capacity)
        return 0;
    memcpy(data, packets[index].data, packets[index].size);
    return packets[index].size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t answer[BLK_MAX_SIZE];
    RTS_UI32 answer_size;

    fakes_start();
    if (SimLinkSend(data, (RTS_UI32)size) != ERR_OK)
        return 0;
    while ((answer_size = SimLinkReceive(answer, sizeof(answer))) != 0) {
        size_t words = data[5] >> 4;
        FUZZ_CHECK(answer_size >= 12 && answer[0] == ROUTER_MAGIC);
        FUZZ_CHECK((size_t)(answer[5] & 15) == words && words != 0);
        FUZZ_CHECK(memcmp(answer + 6, data + 2 * (data[1] & 7) + 2 * (data[5] & 15), 2 * words) == 0);
    }
    return 0;
}
