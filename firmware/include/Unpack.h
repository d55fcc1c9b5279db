/*
 * Unpack.h - unpacks what plctool has packed for a slow line (docs/protocol.md, "Packed data").
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The window is all that has been written before, so that there is no buffer: the sink, which keeps it, copies from it.
 */
#ifndef UNPACK_H
#define UNPACK_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* Where the bytes go. What these return other than ERR_OK ends the unpacking. */
typedef struct {
    RTS_RESULT (*write)(const RTS_UI8 *data, RTS_UI32 size);
    /* Appends `size` bytes, each of them the one `distance` before it; `distance` is 1 at least, and may be less than
     * `size`. Before the first byte there is nothing: ERR_OUT_OF_LIMITS. */
    RTS_RESULT (*copy)(RTS_UI32 distance, RTS_UI32 size);
} UNPACK_SINK;

/*
 * Unpacks `size` bytes of data to exactly `unpacked` bytes, never more. From main, or any context that the sink allows;
 * some 70 bytes of stack. ERR_NO_CONSISTENCY: the data are not that many bytes, or go on after them; up to there the sink
 * has got what they say.
 */
RTS_RESULT Unpack(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked, const UNPACK_SINK *sink);

#endif
