/*
 * CmpRetain.c - RETAIN and PERSISTENT variables in flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * There is one copy of the area in RAM: what was saved last, a record that is read, or the variables at a reset. A
 * value is put back from it into the area that has its initial values by then.
 */
#include "CmpRetain.h"

#include <string.h>

#include "CmpChecksum.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "RetainTable.h"
#include "SysFileFlash.h"
#include "SysTime.h"
#include "rts_config.h"

/* What `saved_area` holds for the variables to begin with. */
enum { SOURCE_NONE, SOURCE_OWN, SOURCE_BEFORE };

static struct {
    FLASH_LOG log;
    RTS_UI8 *area;
    RTS_UI32 size; /* of the area in bytes, 0: nothing is kept */
    RTS_UI32 layout;
    RETAIN_TABLE table;
    RETAIN_TABLE source_table;
    RTS_UI8 source; /* SOURCE_* */
    bool persistent_only;
    bool settled;          /* the variables have come through an initialisation */
    bool saved_valid;      /* `saved_area` is what flash holds for this layout */
    bool asked;            /* for a copy between two cycles */
    bool failed;           /* the last save failed, and was logged */
    RTS_I64 last_check_ns; /* when the area was last found saved, or was saved */
} retain;

/* It is sized by the application's retain area, as that is. */
enum { HAS_RETAIN = APP_RETAIN_SIZE > 0 };
static RTS_UI8 saved_area[HAS_RETAIN ? APP_RETAIN_SIZE : 1];

#define SAVE_NS ((RTS_I64)APP_RETAIN_SAVE_US * 1000)

RTS_UI32 RetainCapacity(void)
{
    return HAS_RETAIN ? FlashLogCapacity(&retain.log) : 0;
}

/* ---- the variables ---- */

/* Names what a table keeps, and where. */
static RTS_UI32 layout_of(const RETAIN_TABLE *table)
{
    RTS_UI32 crc = 0;

    (void)SysFileCRC32(table->file, table->offset, table->size, &crc);
    return crc;
}

void RetainDetach(void)
{
    if (!HAS_RETAIN)
        return;
    retain.size = 0;
    retain.table.size = 0;
    retain.source = SOURCE_NONE;
    retain.persistent_only = false;
    retain.settled = false;
    retain.saved_valid = false;
    retain.asked = false;
}

void RetainAttach(RTS_UI8 *area, const RETAIN_TABLE *table)
{
    if (!HAS_RETAIN)
        return;
    RetainDetach();
    retain.area = area;
    retain.size = table->size > 0 ? table->area_size : 0;
    retain.table = *table;
    retain.layout = layout_of(table);
    retain.last_check_ns = SysTimeGetNs();
}

/* ---- where values come from ---- */

RTS_UI32 RetainGetSequence(void)
{
    return HAS_RETAIN ? retain.log.sequence : 0;
}

RTS_RESULT RetainRestore(FLASH_LOG_RANGE range)
{
    RTS_RESULT result;

    if (!HAS_RETAIN)
        return ERR_NO_OBJECT;
    if ((RTS_I32)(range.after - retain.log.sequence) > 0)
        retain.log.sequence = range.after; /* the log was lost: what is saved from now on shall count */
    if (retain.size == 0)
        return ERR_NO_OBJECT;
    result = FlashLogRead(&retain.log, range, retain.layout, saved_area, retain.size);
    if (result != ERR_OK)
        return result;
    retain.source = SOURCE_OWN;
    retain.source_table = retain.table;
    retain.saved_valid = true;
    return ERR_OK;
}

RTS_RESULT RetainTakeOver(const RETAIN_TABLE *before, FLASH_LOG_RANGE range)
{
    RTS_RESULT result;

    if (!HAS_RETAIN || before->size == 0)
        return ERR_NO_OBJECT;
    result = FlashLogRead(&retain.log, range, layout_of(before), saved_area, before->area_size);
    if (result != ERR_OK)
        return result;
    retain.source = SOURCE_BEFORE;
    retain.source_table = *before;
    retain.persistent_only = true;
    return ERR_OK;
}

static bool is_saved(void)
{
    return retain.saved_valid && memcmp(saved_area, retain.area, retain.size) == 0;
}

static void copy(void)
{
    if (is_saved())
        return;
    retain.saved_valid = false;
    memcpy(saved_area, retain.area, retain.size);
}

void RetainCapture(bool cold)
{
    if (!HAS_RETAIN || retain.size == 0)
        return;
    retain.persistent_only = retain.persistent_only || cold;
    if (!retain.settled)
        return;
    copy();
    retain.source = SOURCE_OWN;
    retain.source_table = retain.table;
    retain.persistent_only = cold;
    retain.settled = false;
}

/* ---- putting them back ---- */

/* A part of the retain area, of which it is to be found out whether a value in it is kept. */
typedef struct {
    RTS_UI32 offset;
    RTS_UI32 size;
    bool kept;
} QUERY;

static void put_back(const KEPT *to, RTS_UI32 place, RTS_UI32 from, RTS_UI32 size)
{
    memcpy(retain.area + place, saved_area + from, size);
    memset(retain.area + place + to->size - to->text, 0, to->text); /* a string that is shorter now ends there */
}

static void ask(QUERY *query, RTS_UI32 place, RTS_UI32 size)
{
    if (place < query->offset + query->size && query->offset < place + size)
        query->kept = true;
}

/* Puts the elements back that both entries have, or looks whether `query` is about one of them. */
static void take(const KEPT *to, const KEPT *from, QUERY *query)
{
    RTS_UI32 size = to->size < from->size ? to->size : from->size;
    RTS_I64 skip = (RTS_I64)to->first - from->first; /* elements that only one of them has at its beginning */
    RTS_I64 i = skip < 0 ? -skip : 0;

    for (; i < to->count && i + skip < from->count; i++) {
        RTS_UI32 place = to->offset + (RTS_UI32)i * to->stride;
        if (query != NULL)
            ask(query, place, size);
        else
            put_back(to, place, from->offset + (RTS_UI32)(i + skip) * from->stride, size);
    }
}

/* Goes through both tables, which are in the same order. Returns the number of values taken; *dropped: those that were
 * PERSISTENT and are not taken. */
static unsigned take_all(QUERY *query, unsigned *dropped)
{
    RETAIN_TABLE own = retain.table;
    RETAIN_TABLE source = retain.source_table;
    bool more;
    unsigned taken = 0;
    KEPT to;
    KEPT from;

    *dropped = 0;
    more = RetainTableNext(&own, &to) == ERR_OK;
    while (RetainTableNext(&source, &from) == ERR_OK) {
        while (more && memcmp(to.hash, from.hash, sizeof to.hash) < 0)
            more = RetainTableNext(&own, &to) == ERR_OK;
        if (more && memcmp(to.hash, from.hash, sizeof to.hash) == 0 && (to.persistent || !retain.persistent_only)) {
            take(&to, &from, query);
            taken++;
        } else {
            *dropped += from.persistent;
        }
    }
    return taken;
}

void RetainPutBack(void)
{
    unsigned dropped;
    unsigned taken;

    if (!HAS_RETAIN || retain.source == SOURCE_NONE)
        return;
    taken = take_all(NULL, &dropped);
    if (retain.source == SOURCE_BEFORE)
        LogAdd(CMPID_CmpRetain, dropped > 0 ? LOG_WARNING : LOG_INFO, ERR_OK,
               "PERSISTENT values of the program before: %u taken over, %u dropped", taken, dropped);
}

static RTS_UI8 ieckept(const RTS_UI8 *address, RTS_UI32 size)
{
    QUERY query = {(RTS_UI32)((uintptr_t)address - (uintptr_t)retain.area), size, false};
    unsigned dropped;

    if (retain.source != SOURCE_NONE)
        (void)take_all(&query, &dropped);
    return query.kept;
}

static const CMP_EXT_FUNCTION externals[] = {
    {"ieckept", 0xEBCA3613, 0x00010000, (RTS_PFN)ieckept}, /* ieckept(POINTER TO BYTE,UDINT):BOOL */
};

/* ---- saving ---- */

static RTS_RESULT save_copy(void)
{
    RTS_RESULT result = FlashLogAppend(&retain.log, retain.layout, saved_area, retain.size);

    if (result != ERR_OK && !retain.failed)
        LogAdd(CMPID_CmpRetain, LOG_ERROR, result, "Retain variables cannot be saved");
    retain.failed = result != ERR_OK;
    retain.saved_valid = result == ERR_OK;
    retain.last_check_ns = SysTimeGetNs();
    return result;
}

RTS_RESULT RetainSave(bool always)
{
    if (!HAS_RETAIN)
        return ERR_OK;
    retain.asked = false;
    if (retain.size == 0 || (!always && (!retain.settled || is_saved())))
        return ERR_OK;
    if (retain.settled)
        copy();
    else if (retain.source != SOURCE_OWN)
        return ERR_OK;
    retain.failed = false; /* a stop that loses them is said, also after saves in between that failed */
    return save_copy();
}

void RetainSettle(bool failed)
{
    if (!HAS_RETAIN || (failed && retain.source != SOURCE_BEFORE))
        return;
    retain.settled = true;
    (void)RetainSave(false);
}

void RetainKeep(RTS_UI32 until)
{
    if (HAS_RETAIN)
        (void)FlashLogKeep(&retain.log, until);
}

void RetainKeepNone(void)
{
    if (HAS_RETAIN)
        FlashLogKeepNone(&retain.log);
}

/* Whether a copy is wanted. */
static bool is_due(void)
{
    if (retain.asked)
        return true;
    if (retain.size == 0 || !retain.settled || SysTimeGetNs() - retain.last_check_ns < SAVE_NS)
        return false;
    if (!is_saved())
        return true;
    retain.last_check_ns = SysTimeGetNs();
    return false;
}

static void save_when_due(void)
{
    if (!is_due())
        return;
    retain.saved_valid = false;
    retain.asked = !IecTaskSnapshot(saved_area, retain.area, retain.size);
    if (!retain.asked)
        (void)save_copy();
}

/* A device whose retain flash is broken still runs, with initial values. */
static void open_log(void)
{
    RTS_RESULT result = FlashLogOpen(&retain.log, FILE_RETAIN);

    if (result != ERR_OK)
        LogAdd(CMPID_CmpRetain, LOG_ERROR, result, "Saved retain variables cannot be read");
}

RTS_RESULT CmpRetain_Hook(CMP_HOOK hook)
{
    if (!HAS_RETAIN)
        return ERR_OK;
    if (hook == CH_INIT)
        CMP_CLEAR(retain);
    if (hook == CH_INIT2)
        open_log();
    if (hook == CH_INIT3)
        return CMRegisterExternal(externals, RTS_COUNT(externals));
    if (hook == CH_COMM_CYCLE)
        save_when_due();
    return ERR_OK;
}
