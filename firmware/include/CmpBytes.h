/*
 * CmpBytes.h - little-endian integers in byte buffers, whatever the CPU's byte order and alignment.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPBYTES_H
#define CMPBYTES_H

#include "CmpStd.h"

static inline RTS_UI16 BytesGet16(const RTS_UI8 *data)
{
    return (RTS_UI16)(data[0] | data[1] << 8);
}

static inline RTS_UI32 BytesGet32(const RTS_UI8 *data)
{
    return BytesGet16(data) | (RTS_UI32)BytesGet16(data + 2) << 16;
}

static inline void BytesPut16(RTS_UI8 *data, RTS_UI32 value)
{
    data[0] = (RTS_UI8)value;
    data[1] = (RTS_UI8)(value >> 8);
}

static inline void BytesPut32(RTS_UI8 *data, RTS_UI32 value)
{
    BytesPut16(data, value);
    BytesPut16(data + 2, value >> 16);
}

#endif
