/*
 * CmpBlkDrvSimpleCom.h - the serial block driver: frames "#<" packet crc "#>". codesys-v3-protocol 1.3.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPBLKDRVSIMPLECOM_H
#define CMPBLKDRVSIMPLECOM_H

#include "CmpRouterEmbedded.h"

typedef struct {
    RTS_UI32 frames;
    RTS_UI32 crc_errors;
    RTS_UI32 overflows;   /* longer than any packet of this device */
    RTS_UI32 too_short;   /* no room for a CRC */
    RTS_UI32 bad_escapes; /* "#" and neither "_", "<" nor ">" */
    RTS_UI32 unfinished;  /* "#<" within a frame */
    RTS_UI32 ends_without_start;
} COM_COUNTERS;

/* NULL when the port has no such line. */
const COM_COUNTERS *BlkDrvComGetCounters(RTS_UI32 line);
extern const BLK_COUNTERS BlkDrvComCounters; /* the same with names */

RTS_RESULT CmpBlkDrvSimpleCom_Hook(CMP_HOOK hook);

#endif
