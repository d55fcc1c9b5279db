/*
 * CmpBytes.h - little-endian integers in byte buffers, whatever the CPU's byte order and alignment.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPBYTES_H
#define CMPBYTES_H

#include <string.h>

#include "CmpStd.h"

/* Whether the CPU itself keeps integers like this. The compiler knows: only one of the two ways below is in the code,
 * and memcpy is one instruction on CPUs that reach integers anywhere. */
static inline bool BytesAreNative(void)
{
    const RTS_UI16 one = 1;
    RTS_UI8 first;

    memcpy(&first, &one, sizeof(first));
    return first == 1;
}

static inline RTS_UI16 BytesGet16(const RTS_UI8 *data)
{
    RTS_UI16 value;

    if (!BytesAreNative())
        return (RTS_UI16)(data[0] | data[1] << 8);
    memcpy(&value, data, sizeof(value));
    return value;
}

static inline RTS_UI32 BytesGet32(const RTS_UI8 *data)
{
    RTS_UI32 value;

    if (!BytesAreNative())
        return BytesGet16(data) | (RTS_UI32)BytesGet16(data + 2) << 16;
    memcpy(&value, data, sizeof(value));
    return value;
}

static inline void BytesPut16(RTS_UI8 *data, RTS_UI32 value)
{
    RTS_UI16 number = (RTS_UI16)value;

    if (BytesAreNative()) {
        memcpy(data, &number, sizeof(number));
    } else {
        data[0] = (RTS_UI8)value;
        data[1] = (RTS_UI8)(value >> 8);
    }
}

static inline void BytesPut32(RTS_UI8 *data, RTS_UI32 value)
{
    if (BytesAreNative()) {
        memcpy(data, &value, sizeof(value));
    } else {
        BytesPut16(data, value);
        BytesPut16(data + 2, value >> 16);
    }
}

#endif
