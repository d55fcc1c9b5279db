/*
 * fuzz_serial_line.c - the other end of the serial line of a device that is fuzzed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "fuzz_serial_line.h"

#include <string.h>

#include "CmpChecksum.h"
#include "comm_fakes.h"
#include "fuzz.h"

enum { CRC_SIZE = 2 };

size_t serial_frame(const uint8_t *packet, size_t size, uint8_t *frame)
{
    uint16_t crc = CRC16Update(CRC16_INIT, packet, size);
    uint8_t tail[CRC_SIZE] = {(uint8_t)crc, (uint8_t)(crc >> 8)};
    size_t fill = 0;

    frame[fill++] = '#';
    frame[fill++] = '<';
    for (size_t i = 0; i < size + CRC_SIZE; i++) {
        frame[fill++] = i < size ? packet[i] : tail[i - size];
        if (frame[fill - 1] == '#')
            frame[fill++] = '_';
    }
    frame[fill++] = '#';
    frame[fill++] = '>';
    return fill;
}

void serial_deliver(const uint8_t *data, size_t size)
{
    memcpy(fakes.line_in, data, size);
    fakes.line_in_size = (RTS_UI32)size;
    fakes.line_in_read = 0;
    while (fakes.line_in_read < size)
        fakes_cycle(1);
    fakes_cycle(1);
}

static uint8_t sent(uint32_t i)
{
    FUZZ_CHECK(i < fakes.line_out_size);
    return fakes.line_out[i];
}

size_t serial_take(uint8_t *packet)
{
    size_t size = 0;
    uint32_t i = 2;

    if (fakes.line_out_size == 0)
        return 0;
    FUZZ_CHECK(sent(0) == '#' && sent(1) == '<');
    for (; sent(i) != '#' || sent(i + 1) != '>'; i++) {
        FUZZ_CHECK(size < SERIAL_LONGEST);
        packet[size++] = sent(i);
        if (sent(i) == '#')
            FUZZ_CHECK(sent(++i) == '_');
    }
    i += 2;
    fakes.line_out_size -= i;
    memmove(fakes.line_out, fakes.line_out + i, fakes.line_out_size);
    FUZZ_CHECK(size > CRC_SIZE);
    size -= CRC_SIZE;
    FUZZ_CHECK(CRC16Update(CRC16_INIT, packet, size) == (packet[size] | packet[size + 1] << 8));
    return size;
}
