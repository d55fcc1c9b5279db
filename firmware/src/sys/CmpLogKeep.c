/*
 * CmpLogKeep.c - the entries of the log that survive power-off.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each entry is a record of its own. A half of the file has room for LOG_KEEP of them and some that power cuts spoil, so
 * that the last LOG_KEEP are there also while the other half is erased.
 */
#include "CmpLogKeep.h"

#include <string.h>

#include "CMUtils.h"
#include "SysFileFlash.h"
#include "SysFlashLog.h"
#include "SysTime.h"
#include "SysTimeRtc.h"

#if LOG_KEEP > 0

enum { KEPT_TAG = 0x31504B4C };

/* 64-bit numbers are two words, the low one first, so that no record has a gap. */
typedef struct {
    RTS_UI32 time_ns[2];
    RTS_UI32 utc_ns[2];
    RTS_UI32 start;
    RTS_UI16 component;
    RTS_UI16 log_class;
    RTS_UI32 error;
    char text[LOG_KEEP_TEXT_SIZE];
} LINE;

RTS_STATIC_ASSERT(SysFileAlign(FLASH_LOG_HEAD_SIZE + sizeof(LINE)) == LOG_KEEP_RECORD, record_of_a_line);
RTS_STATIC_ASSERT(LOG_KEEP_TEXT_SIZE <= LOG_TEXT_SIZE, line_fits_an_entry);

static struct {
    FLASH_LOG log;
    RTS_RESULT opened;
    RTS_UI32 start; /* number of this power-up */
    RTS_UI32 last;  /* handle of the last entry of the log that was looked at */
    RTS_UI32 used;  /* lines of the burst */
    RTS_UI32 since_ms;
    RTS_UI32 left_out;
} keep;

static void split(RTS_I64 value, RTS_UI32 words[2])
{
    words[0] = (RTS_UI32)value;
    words[1] = (RTS_UI32)((RTS_UI64)value >> 32);
}

static RTS_I64 joined(const RTS_UI32 words[2])
{
    return (RTS_I64)((RTS_UI64)words[1] << 32 | words[0]);
}

/* ---- writing ---- */

/* Spares the flash: LOG_KEEP_BURST lines at once, then one each LOG_KEEP_REFILL_MS. */
static bool take(void)
{
    RTS_UI32 more = (SysTimeGetMs() - keep.since_ms) / LOG_KEEP_REFILL_MS;

    keep.since_ms += more * LOG_KEEP_REFILL_MS;
    keep.used = keep.used > more ? keep.used - more : 0;
    if (keep.used >= LOG_KEEP_BURST)
        return false;
    keep.used++;
    return true;
}

/* A half that fails is given up for the other one. */
static RTS_RESULT append(const LINE *line)
{
    RTS_RESULT result = FlashLogAppend(&keep.log, KEPT_TAG, line, sizeof *line);

    if (result == ERR_OK)
        return ERR_OK;
    FlashLogTurn(&keep.log);
    return FlashLogAppend(&keep.log, KEPT_TAG, line, sizeof *line);
}

static void write_line(const LOG_ENTRY *entry)
{
    RTS_I64 utc_ns = 0;
    LINE line = {0};
    RTS_RESULT result;

    if (SysTimeRtcGet(&utc_ns) != ERR_OK)
        utc_ns = 0;
    split(entry->time_ns, line.time_ns);
    split(utc_ns, line.utc_ns);
    line.start = keep.start;
    line.component = (RTS_UI16)entry->component;
    line.log_class = entry->log_class;
    line.error = entry->error;
    memcpy(line.text, entry->text, CMUtlStrNLen(entry->text, LOG_KEEP_TEXT_SIZE - 1));
    result = append(&line);
    if (result == ERR_OK)
        return;
    keep.opened = result;
    LogAdd(CMPID_CmpLogKeep, LOG_ERROR, result, "The log is not kept: the flash fails");
}

/* Tells in a line of its own how many were left out before this one. */
static void write_left_out(const LOG_ENTRY *entry)
{
    LOG_ENTRY note = *entry;

    note.component = CMPID_CmpLogKeep;
    note.log_class = LOG_WARNING;
    note.error = ERR_OK;
    CMUtlsnprintf(note.text, sizeof note.text, "%u entries were not kept: there were too many",
                  (unsigned)keep.left_out);
    keep.left_out = 0;
    write_line(&note);
}

static void keep_entry(const LOG_ENTRY *entry)
{
    if (!take()) {
        keep.left_out++;
        return;
    }
    if (keep.left_out > 0)
        write_left_out(entry);
    write_line(entry);
}

/* Not inlined: the entries are on the stack. */
static RTS_NOINLINE void keep_new(void)
{
    LOG_ENTRY entry;

    while (keep.opened == ERR_OK && LogGetEntry(keep.last + 1, &entry) == ERR_OK) {
        keep.last = entry.handle;
        if (entry.kept)
            keep_entry(&entry);
    }
}

/* ---- reading ---- */

/* The number of the oldest line that is shown. */
static RTS_UI32 first_number(void)
{
    return keep.log.sequence > LOG_KEEP ? keep.log.sequence - LOG_KEEP + 1 : 1;
}

static RTS_RESULT read_line(RTS_UI32 number, LINE *line)
{
    FLASH_LOG_RANGE one = {number - 1, number};

    return FlashLogRead(&keep.log, one, KEPT_TAG, line, sizeof *line);
}

static void take_line(const LINE *line, RTS_UI32 number, LOG_ENTRY *entry, LOG_KEPT_FROM *from)
{
    memset(entry, 0, sizeof *entry);
    entry->handle = number;
    entry->component = line->component;
    entry->log_class = line->log_class;
    entry->error = line->error;
    entry->time_ns = joined(line->time_ns);
    memcpy(entry->text, line->text, LOG_KEEP_TEXT_SIZE - 1);
    from->utc_ns = joined(line->utc_ns);
    from->start = line->start;
}

RTS_RESULT LogKeepGet(RTS_UI32 number, LOG_ENTRY *entry, LOG_KEPT_FROM *from)
{
    LINE line;

    if (keep.opened != ERR_OK && keep.log.sequence == 0)
        return keep.opened;
    if (number < first_number())
        number = first_number();
    for (; number <= keep.log.sequence; number++) {
        if (read_line(number, &line) != ERR_OK)
            continue; /* a power cut or the flash has spoilt it */
        take_line(&line, number, entry, from);
        return ERR_OK;
    }
    return ERR_END_OF_OBJECT;
}

/* ---- start ---- */

static void open_file(void)
{
    LINE line;

    CMP_CLEAR(keep);
    keep.opened = ERR_NOT_SUPPORTED;
    if (SysFileGetArea(FILE_KEPT)->size == 0)
        return;
    keep.opened = FlashLogOpen(&keep.log, FILE_KEPT);
    if (keep.opened != ERR_OK) { /* lines that cannot be read are not worth more than those to come */
        FlashLogRenew(&keep.log);
        keep.opened = ERR_OK;
    }
    keep.start = read_line(keep.log.sequence, &line) == ERR_OK ? line.start + 1 : 1;
}

RTS_RESULT CmpLogKeep_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM2)
        open_file();
    else if (hook == CH_COMM_CYCLE || hook == CH_EXIT_SYSTEM2)
        keep_new();
    return ERR_OK;
}

#endif
