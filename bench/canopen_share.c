/*
 * canopen_share.c - how much of the time frames are on the bus while SDO transfers go to a CANopen device of this project and
 * from it, on a simulated bus of 500 kbit/s. Client and device take no time; what is measured is the protocol.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Prints a line for each kind: its name, bytes, seconds, and the share.
 */
#include <stdio.h>

#include "../tests/c/canopen_transfers.h"

enum { TIMES = 200, LARGE = 2000 };

static RTS_UI8 data[LARGE];

static bool expedited_write(void)
{
    return write_segments(WORD, data, 4);
}

static bool expedited_read(void)
{
    return read_segments(WORD);
}

static bool segments_write(void)
{
    return write_segments(TEXT, data, LARGE);
}

static bool segments_read(void)
{
    return read_segments(TEXT);
}

static bool blocks_write(void)
{
    return write_blocks(data, LARGE);
}

static bool manager_write(void)
{
    return write_object(TEXT, data, LARGE);
}

static bool manager_read(void)
{
    return read_object(TEXT);
}

static bool measure(const char *name, bool (*transfer)(void), RTS_UI32 bytes)
{
    RTS_I64 begun = SimCanNow();
    RTS_I64 busy = SimCanBusyNs();

    for (RTS_UI32 i = 0; i < TIMES; i++)
        if (!transfer()) {
            fprintf(stderr, "%s: a transfer has failed\n", name);
            return false;
        }
    RTS_I64 taken = SimCanNow() - begun;
    printf("%s\t%u\t%.6f\t%.4f\n", name, (unsigned)(bytes * TIMES), (double)taken / 1e9,
           (double)(SimCanBusyNs() - busy) / (double)taken);
    return true;
}

int main(void)
{
    begin();
    for (RTS_UI32 i = 0; i < LARGE; i++)
        data[i] = (RTS_UI8)('!' + i * 7 % 90);
    bool done =
        measure("expedited writes", expedited_write, 4) && measure("expedited reads", expedited_read, 4) &&
        measure("writes in segments", segments_write, LARGE) && measure("reads in segments", segments_read, LARGE) &&
        measure("writes in blocks", blocks_write, LARGE) && measure("reads in blocks", read_blocks, LARGE) &&
        measure("writes of the manager", manager_write, LARGE) && measure("reads of the manager", manager_read, LARGE);
    return done ? 0 : 1;
}
