/*
 * fuzz_serial.c - any bytes on the serial line: the receiver finds back, and what it sends are frames.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChecksum.h"
#include "comm_fakes.h"
#include "fuzz.h"

/* A question that is always answered: "how many channels?" */
static const uint8_t question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x02,
                                   0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};

static size_t frame(const uint8_t *data, size_t size, uint8_t *out)
{
    uint16_t crc = CRC16Update(CRC16_INIT, data, size);
    uint8_t tail[2] = {(uint8_t)crc, (uint8_t)(crc >> 8)};
    size_t fill = 0;

    out[fill++] = '#';
    out[fill++] = '<';
    for (size_t i = 0; i < size + 2; i++) {
        out[fill++] = i < size ? data[i] : tail[i - size];
        if (out[fill - 1] == '#')
            out[fill++] = '_';
    }
    out[fill++] = '#';
    out[fill++] = '>';
    return fill;
}

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
        return frame(question, sizeof(question), data);
    case 1:
        return frame(scan, sizeof(scan), data);
    case 2:
        return frame(open, sizeof(open), data);
    case 3:
        return frame(block, 512, data);
    case 4:
        return frame(block, 511, data);
    case 5:
        memcpy(data, "#<#_#>##<<#>", 12);
        return 12;
    default:
        return 0;
    }
}

/* Everything sent so far consists of whole frames. */
static void check_output(void)
{
    uint32_t i = 0;

    while (i < fakes.line_out_size) {
        FUZZ_CHECK(fakes.line_out[i] == '#' && fakes.line_out[i + 1] == '<');
        for (i += 2; fakes.line_out[i] != '#' || fakes.line_out[i + 1] != '>'; i++) {
            FUZZ_CHECK(fakes.line_out[i] != '#' || fakes.line_out[i + 1] == '_');
            FUZZ_CHECK(i + 2 < fakes.line_out_size);
        }
        i += 2;
    }
}

static void deliver(const uint8_t *data, size_t size)
{
    memcpy(fakes.line_in, data, size);
    fakes.line_in_size = (RTS_UI32)size;
    fakes.line_in_read = 0;
    while (fakes.line_in_read < size)
        fakes_cycle(1);
    fakes_cycle(1);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t good[64];
    size_t good_size;

    if (size > FAKE_LINE_SIZE)
        return 0;
    fakes_start();
    deliver(data, size);
    check_output();
    fakes.line_out_size = 0;
    good_size = frame(question, sizeof(question), good);
    deliver(good, good_size);
    check_output();
    FUZZ_CHECK(fakes.line_out_size >= 22);
    return 0;
}
