/*
 * fuzz_serial.c - any bytes on the serial line: the receiver finds back, and what it sends are frames.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "comm_fakes.h"
#include "fuzz.h"
#include "fuzz_serial_line.h"

/* A question that is always answered: "how many channels?" */
static const uint8_t question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x02,
                                   0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t scan[] = {0xC5, 0x0B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01,
                                   0x02, 0xC2, 0x00, 0x04, 0x23, 0x23, 0x00, 0x00};
    static const uint8_t open[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x02, 0x00,
                                   0x00, 0xC3, 0x00, 0x01, 0x01, 0x08, 0x92, 0x77, 0xAC, 0x81, 0xD4,
                                   0x21, 0x83, 0x00, 0x40, 0x1F, 0x00, 0x05, 0x00, 0x00, 0x00};
    uint8_t block[514];

    (void)capacity;
    memset(block, '#', sizeof(block));
    switch (index) {
    case 0:
        return serial_frame(question, sizeof(question), data);
    case 1:
        return serial_frame(scan, sizeof(scan), data);
    case 2:
        return serial_frame(open, sizeof(open), data);
    case 3:
        return serial_frame(block, 512, data);
    case 4:
        return serial_frame(block, 511, data);
    case 5:
        memcpy(data, "#<#_#>##<<#>", 12);
        return 12;
    default:
        return 0;
    }
}

/* The size of the longest packet that the device has sent, 0: none; aborts when something else than frames is there. */
static size_t take_all(void)
{
    uint8_t packet[SERIAL_LONGEST];
    size_t longest = 0;
    size_t size;

    while ((size = serial_take(packet)) != 0)
        longest = size > longest ? size : longest;
    return longest;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t good[64];

    if (size > FAKE_LINE_SIZE)
        return 0;
    fakes_start();
    serial_deliver(data, size);
    (void)take_all();
    serial_deliver(good, serial_frame(question, sizeof(question), good));
    FUZZ_CHECK(take_all() >= 16);
    return 0;
}
