/*
 * fuzz_serial_line.h - the other end of the serial line of a device that is fuzzed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef FUZZ_SERIAL_LINE_H
#define FUZZ_SERIAL_LINE_H

#include <stddef.h>
#include <stdint.h>

/* The frame around a packet, at most twice as long and 8 bytes; returns its size. */
size_t serial_frame(const uint8_t *packet, size_t size, uint8_t *frame);

/* Gives the device bytes, at most FAKE_LINE_SIZE, and lets it run until it has read them. */
void serial_deliver(const uint8_t *data, size_t size);

/* Takes the next packet that the device has sent: its size, 0 when there is none. Aborts when what it has sent is not
 * whole frames. `packet`: room for SERIAL_LONGEST. */
enum { SERIAL_LONGEST = 520 };
size_t serial_take(uint8_t *packet);

#endif
