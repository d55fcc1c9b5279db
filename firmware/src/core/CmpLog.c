/*
 * CmpLog.c - the log ring.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Writers may be main, tasks and interrupts at once: each takes a number of its own and with it a place, and none
 * waits. An entry is valid while its place holds its number; a reader looks before and after the copy.
 */
#include "CmpLog.h"

#include <stdarg.h>
#include <string.h>

#include "CMUtils.h"
#include "SettingValues.h"
#include "SysAtomic.h"
#include "SysTime.h"

enum { PLACES = LOG_MAX_ENTRIES > 0 ? LOG_MAX_ENTRIES : 1 };

static struct {
    RTS_UI32 count; /* entries ever added */
    LOG_ENTRY ring[PLACES];
} logger;

/* True if the settings leave entries of this class out. */
static bool is_filtered(RTS_UI32 log_class)
{
    return SETTINGS && (log_class & ((RTS_UI32)SETTING(LogFilter) | LOG_EXCEPTION | LOG_KEPT)) == 0;
}

void LogAddEntry(RTS_UI32 component, RTS_UI32 log_class, RTS_UI32 error, const char *format, ...)
{
    RTS_UI32 handle;
    LOG_ENTRY *entry;
    va_list arguments;

    if (is_filtered(log_class))
        return;
    handle = SysAtomicAdd(&logger.count, 1) + 1;
    entry = &logger.ring[handle % PLACES];
    SysAtomicStore(&entry->handle, 0);
    SysAtomicFence();
    entry->component = component;
#if LOG_KEEP > 0
    entry->log_class = (RTS_UI16)(log_class & ~(RTS_UI32)LOG_KEPT);
    entry->kept = (log_class & (LOG_KEPT | LOG_EXCEPTION)) != 0;
#else
    entry->log_class = log_class;
#endif
    entry->error = error;
    entry->time_ns = SysTimeGetNs();
    va_start(arguments, format);
    CMUtlvsnprintf(entry->text, sizeof entry->text, format, arguments);
    va_end(arguments);
    SysAtomicStore(&entry->handle, handle);
}

/* Copies entry `handle` when its place still holds it. */
static bool copy_entry(RTS_UI32 handle, LOG_ENTRY *entry)
{
    const LOG_ENTRY *place = &logger.ring[handle % PLACES];

    if (SysAtomicLoad(&place->handle) != handle)
        return false;
    *entry = *place;
    entry->text[LOG_TEXT_SIZE - 1] = '\0';
    SysAtomicFence();
    return SysAtomicLoad(&place->handle) == handle;
}

RTS_RESULT LogGetEntry(RTS_UI32 handle, LOG_ENTRY *entry)
{
    RTS_UI32 last = SysAtomicLoad(&logger.count);

    if (last > PLACES && handle <= last - PLACES)
        handle = last - PLACES + 1;
    if (handle == 0)
        handle = 1;
    for (; handle <= last; handle++) {
        if (copy_entry(handle, entry))
            return ERR_OK;
    }
    return ERR_END_OF_OBJECT;
}

RTS_RESULT CmpLog_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM)
        CMP_CLEAR(logger);
    return ERR_OK;
}
