/*
 * RetainSram.h - the newest copy of the retain variables, in RAM that keeps its content while the power is off.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It has two places, written in turn, each with a checksum, so a power cut while one is written leaves the other. A copy counts
 * only together with the flash log: until the log gets its next record, which is newer. All from main. With APP_RETAIN_SRAM.
 */
#ifndef RETAINSRAM_H
#define RETAINSRAM_H

#include "CmpStd.h"
#include "SysFlashLog.h"

/* True if it has room for a copy of `size` bytes. */
bool RetainSramFits(RTS_UI32 size);

/* Saves a copy of the application with this tag, made when the newest record of the log had the number `sequence`. */
void RetainSramSave(RTS_UI32 tag, RTS_UI32 sequence, const void *data, RTS_UI32 size);

/* Reads the newest copy that has this tag and size, if it is as new as record `sequence` of the log, and that is in the range.
 * False: there is none, and `data` is as it was. */
bool RetainSramLoad(RTS_UI32 tag, RTS_UI32 sequence, FLASH_LOG_RANGE range, void *data, RTS_UI32 size);

#endif
