/*
 * CmpLog.h - the log ring (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Entries have component, class, error and a message; the oldest is overwritten. Manual 3.9, codesys-v3-protocol 4.10.
 */
#ifndef CMPLOG_H
#define CMPLOG_H

#include "CmpStd.h"
#include "rts_config.h"
#ifndef RTS_CFFI
#include "CmpErrors.h"
#include "CmpItf.h"
#endif

enum { LOG_INFO = 1, LOG_WARNING = 2, LOG_ERROR = 4, LOG_EXCEPTION = 8, LOG_DEBUG = 0x10 };

typedef struct {
    RTS_UI32 handle; /* counts from 1, never reused */
    RTS_UI32 component;
#if LOG_KEEP > 0
    RTS_UI16 log_class;
    RTS_UI16 kept; /* not 0: survives power-off */
#else
    RTS_UI32 log_class;
#endif
    RTS_UI32 error;
    RTS_I64 time_ns;
    char text[LOG_TEXT_SIZE];
} LOG_ENTRY;

#ifndef RTS_CFFI
/* With a class: the entry survives power-off (CmpLogKeep.h), whatever the filter of the settings is. All exceptions do. */
enum { LOG_KEPT = LOG_KEEP > 0 ? 0x100 : 0 };

/* Adds an entry; `format` is a literal with the conversions of CMUtils.h. From main or a task context. Without log
 * its arguments are not evaluated, and the messages take no flash. */
#define LogAdd(...)                   \
    do {                              \
        if (LOG_MAX_ENTRIES > 0)      \
            LogAddEntry(__VA_ARGS__); \
    } while (0)
void LogAddEntry(RTS_UI32 component, RTS_UI32 log_class, RTS_UI32 error, const char *format, ...) RTS_FORMAT(4, 5);

RTS_RESULT CmpLog_Hook(CMP_HOOK hook);
#endif

/* Copies the first entry with a handle >= `handle`. ERR_END_OF_OBJECT when there is none. */
RTS_RESULT LogGetEntry(RTS_UI32 handle, LOG_ENTRY *entry);

#endif
