/*
 * semihost.h - output and exit status of a test that runs in QEMU.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SEMIHOST_H
#define SEMIHOST_H

#include <stdint.h>

#include "semihost_call.h"

/* Arguments are static: QEMU cannot look into a page that begins with a guard, as the stack's and the vectors' do. */

static inline void semihost_print(const char *text)
{
    enum { SYS_WRITE0 = 4, PIECE = 64 };
    static char piece[PIECE + 1];

    while (*text != '\0') {
        uint32_t size = 0;
        while (size < PIECE && *text != '\0')
            piece[size++] = *text++;
        piece[size] = '\0';
        semihost(SYS_WRITE0, piece);
    }
}

static inline void semihost_exit(uint32_t status)
{
    enum { SYS_EXIT_EXTENDED = 0x20, ADP_STOPPED_APPLICATION_EXIT = 0x20026 };
    static uint32_t block[2];
    block[0] = ADP_STOPPED_APPLICATION_EXIT;
    block[1] = status;
    semihost(SYS_EXIT_EXTENDED, block);
}

#endif
