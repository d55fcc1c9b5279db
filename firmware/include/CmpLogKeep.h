/*
 * CmpLogKeep.h - the entries of the log that survive power-off: starts, stops, exceptions, causes of resets.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Entries with LOG_KEPT, and all exceptions, are copied to FILE_KEPT, a record log of its own at the end of the flash, so
 * files cannot take its room. A power cut at any moment costs at most the entry that is written. The last LOG_KEEP are
 * shown. All from main, with LOG_KEEP only.
 */
#ifndef CMPLOGKEEP_H
#define CMPLOGKEEP_H

#include "CmpLog.h"

/* Name of the logger with these entries. */
#define LOG_KEPT_NAME "KeptLog"

/* Origin of a kept entry. */
typedef struct {
    RTS_I64 utc_ns; /* since 1970-01-01; 0: there was no clock, or it was not set */
    RTS_UI32 start; /* number of the power-up, from 1; its time counts from there */
} LOG_KEPT_FROM;

/* Copies the first entry with a number >= `number`, which becomes its handle; numbers go on over power-off.
 * ERR_END_OF_OBJECT: there is none; ERR_NOT_SUPPORTED: no flash for it; ERR_DEVICE: the flash fails. */
RTS_RESULT LogKeepGet(RTS_UI32 number, LOG_ENTRY *entry, LOG_KEPT_FROM *from);

#ifndef RTS_CFFI
RTS_RESULT CmpLogKeep_Hook(CMP_HOOK hook);
#endif

#endif
