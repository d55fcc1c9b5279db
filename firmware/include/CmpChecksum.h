/*
 * CmpChecksum.h - CRC-32 of images and records, CRC-16 of the serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From any context. The tables have CHECKSUM_TABLE_ENTRIES entries (rts_config.h).
 */
#ifndef CMPCHECKSUM_H
#define CMPCHECKSUM_H

#include "CmpStd.h"

enum { CRC16_INIT = 0x1D0F };

/* CRC-32 as zlib's crc32(): start with 0, hand the result in again to go on. "123456789" gives 0xCBF43926. */
RTS_UI32 CRC32Update(RTS_UI32 crc, const void *data, RTS_SIZE size);

/* CRC-16, polynomial 0x1021, not reflected; start with CRC16_INIT. "123456789" gives 0xE5CC. */
RTS_UI16 CRC16Update(RTS_UI16 crc, const void *data, RTS_SIZE size);

#endif
