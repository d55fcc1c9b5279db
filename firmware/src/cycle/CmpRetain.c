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

#include "CmpLog.h"
#include "IecCycle.h"
#include "RetainSram.h"
#include "RetainTable.h"
#include "SettingValues.h"
#include "SysFileFlash.h"
#include "SysTime.h"
#include "rts_config.h"

static struct {
    FLASH_LOG log;
    RTS_UI32 last_check_ms; /* when the area was last found saved, or was saved */
    RTS_UI8 *area;
    RTS_UI32 tag; /* of its records */
    bool failed;  /* the last save failed, and was logged */
#if APP_RETAIN_SRAM
    RTS_UI32 record_ms; /* when the last record of values in SRAM was due */
#endif
} retain;

/* All zero without an application. */
static struct {
    const RETAIN_TABLE *table;
    RETAIN_TABLE source; /* of the values in `saved_area` to begin with; size 0: there are none */
    bool persistent_only;
    bool settled;     /* the variables have come through an initialisation */
    bool saved_valid; /* `saved_area` is what flash holds */
    bool asked;       /* for a copy between two cycles */
} kept;

/* It is sized by the application's retain area, as that is. */
enum { HAS_RETAIN = APP_RETAIN_SIZE > 0 };
static RTS_UI8 saved_area[HAS_RETAIN ? APP_RETAIN_SIZE : 1];
static RTS_UI8 taken_at[sizeof saved_area / 8 + 1]; /* a bit for each byte: a value that was put back begins there */

#define SAVE_MS ((RTS_UI32)SETTING(RetainSave))

RTS_UI32 RetainCapacity(void)
{
    return HAS_RETAIN ? FlashLogCapacity(&retain.log) : 0;
}

/* ---- the variables ---- */

void RetainDetach(void)
{
    if (HAS_RETAIN)
        memset(&kept, 0, sizeof kept);
}

void RetainAttach(RTS_UI8 *area, const RETAIN_TABLE *table, RTS_UI32 tag)
{
    if (!HAS_RETAIN)
        return;
    RetainDetach();
    kept.table = table;
    retain.area = area;
    retain.tag = tag;
    retain.last_check_ms = SysTimeGetMs();
}

/* ---- a copy in RAM that survives ---- */

#if APP_RETAIN_SRAM
static bool has_sram(void)
{
    return RetainSramFits(kept.table->area_size);
}

/* The copy of the variables that was made last. */
static void copy_to_sram(void)
{
    RetainSramSave(retain.tag, retain.log.sequence, saved_area, kept.table->area_size);
}

/* True if the variables differ from that copy. */
static bool is_behind(void)
{
    return kept.settled && has_sram() && memcmp(saved_area, retain.area, kept.table->area_size) != 0;
}

/* Saves the copy that was made. True: a record in flash is not due. */
static bool is_in_sram(void)
{
    if (!has_sram())
        return false;
    copy_to_sram();
    if (SysTimeGetMs() - retain.record_ms < SAVE_MS)
        return true;
    retain.record_ms = SysTimeGetMs();
    return false;
}

static bool load_from_sram(const RETAIN_TABLE *table, RTS_UI32 tag, FLASH_LOG_RANGE range)
{
    return RetainSramLoad(tag, retain.log.sequence, range, saved_area, table->area_size);
}
#else
#define is_behind() false
#define is_in_sram() false
#define load_from_sram(table, tag, range) false
#endif

/* ---- where values come from ---- */

static bool is_of_application_before(void)
{
    return kept.source.size > 0 && kept.source.file != kept.table->file;
}

RTS_UI32 RetainGetSequence(void)
{
    return HAS_RETAIN ? retain.log.sequence : 0;
}

static bool is_saved(void)
{
    return kept.saved_valid && memcmp(saved_area, retain.area, kept.table->area_size) == 0;
}

static void take_copy(void)
{
    memcpy(saved_area, retain.area, kept.table->area_size);
}

static void copy(void)
{
    kept.saved_valid = is_saved();
    take_copy();
}

void RetainCapture(bool cold)
{
    if (!HAS_RETAIN)
        return;
    if (kept.settled) {
        copy();
        kept.source = *kept.table;
        kept.persistent_only = false;
        kept.settled = false;
    }
    kept.persistent_only |= cold;
}

/* ---- putting them back ---- */

/* Puts the elements back that both entries have. */
static void take(const KEPT *to, const KEPT *from)
{
    RTS_UI32 place = KeptOffset(to);
    RTS_UI32 number = (RTS_UI32)to->run.first - (RTS_UI32)from->run.first; /* in `from`; wraps where that has none */
    RTS_UI32 i;

    for (i = 0; i < to->run.count; i++, number++, place += to->run.stride) {
        if (number >= from->run.count)
            continue;
        memcpy(retain.area + place, saved_area + KeptOffset(from) + number * from->run.stride, from->run.size);
        taken_at[place / 8] |= (RTS_UI8)(1u << place % 8);
    }
}

static bool is_persistent(const KEPT *entry)
{
    return (entry->variable.place & CDL_KEPT_PERSISTENT) != 0;
}

static int compare(const KEPT *a, const KEPT *b)
{
    return memcmp(a->variable.hash, b->variable.hash, CDL_KEPT_HASH_SIZE);
}

/* Whether a value that the same variable had goes into `to`. A string that is shorter now is initialised. */
static bool is_taken(const KEPT *to, const KEPT *from)
{
    return compare(to, from) == 0 && to->run.size >= from->run.size && (is_persistent(to) || !kept.persistent_only);
}

/* Goes through both tables, which are in the same order. */
void RetainPutBack(void)
{
    RETAIN_TABLE own;
    RETAIN_TABLE source = kept.source;
    unsigned taken = 0;
    unsigned dropped = 0; /* PERSISTENT, and not taken */
    bool more;
    KEPT to;
    KEPT from;

    if (!HAS_RETAIN)
        return;
    memset(taken_at, 0, sizeof taken_at);
    own = *kept.table;
    more = RetainTableNext(&own, &to) == ERR_OK;
    while (RetainTableNext(&source, &from) == ERR_OK) {
        while (more && compare(&to, &from) < 0)
            more = RetainTableNext(&own, &to) == ERR_OK;
        if (more && is_taken(&to, &from)) {
            take(&to, &from);
            taken++;
        } else if (is_persistent(&from)) {
            dropped++;
        }
    }
    if (is_of_application_before())
        LogAdd(CMPID_CmpRetain, dropped > 0 ? LOG_WARNING : LOG_INFO, ERR_OK,
               "PERSISTENT values: %u taken over, %u dropped", taken, dropped);
}

RTS_RESULT RetainLoad(const RETAIN_TABLE *table, RTS_UI32 tag, FLASH_LOG_RANGE range)
{
    RTS_RESULT result;
    bool newer; /* than flash */

    if (!HAS_RETAIN)
        return ERR_NO_OBJECT;
    if ((RTS_I32)(range.after - retain.log.sequence) > 0)
        retain.log.sequence = range.after; /* the log was lost: what is saved from now on shall count */
    if (table->size == 0)
        return ERR_NO_OBJECT;
    result = FlashLogRead(&retain.log, range, tag, saved_area, table->area_size);
    newer = load_from_sram(table, tag, range);
    if (result != ERR_OK && !newer)
        return result;
    kept.source = *table;
    kept.persistent_only = is_of_application_before();
    if (kept.persistent_only)
        return ERR_OK;
    RetainPutBack(); /* at once, to be read while the application waits */
    kept.saved_valid = !newer;
    kept.settled = true;
    return ERR_OK;
}

static RTS_UI8 ieckept(const RTS_UI8 *address, RTS_UI32 size)
{
    RTS_UI32 place = (RTS_UI32)((uintptr_t)address - (uintptr_t)retain.area);

    for (; size > 0 && place < sizeof saved_area; place++, size--) {
        if ((taken_at[place / 8] >> place % 8 & 1) != 0)
            return 1;
    }
    return 0;
}

static const CMP_EXT_FUNCTION externals[] = {
    {"ieckept", 0xEBCA3613, 0x00010000, (RTS_PFN)ieckept}, /* ieckept(POINTER TO BYTE,UDINT):BOOL */
};

/* ---- saving ---- */

static RTS_RESULT save_copy(void)
{
    RTS_RESULT result = FlashLogAppend(&retain.log, retain.tag, saved_area, kept.table->area_size);

    if (result != ERR_OK && !retain.failed)
        LogAdd(CMPID_CmpRetain, LOG_ERROR, result, "Retain variables cannot be saved");
    retain.failed = result != ERR_OK;
    kept.saved_valid = result == ERR_OK;
    retain.last_check_ms = SysTimeGetMs();
    return result;
}

RTS_RESULT RetainSave(bool always)
{
    if (!HAS_RETAIN)
        return ERR_OK;
    kept.asked = false;
    if (!kept.settled)
        return ERR_OK;
    copy();
    if (kept.saved_valid && !always)
        return ERR_OK;
    retain.failed = false; /* a stop that loses them is logged, also after saves in between that failed */
    return save_copy();
}

#if ONLINE_CHANGE
void RetainExchange(const RETAIN_TABLE *table, RTS_UI32 tag)
{
    if (!HAS_RETAIN)
        return;
    kept.table = table;
    kept.settled = table->size > 0;
    kept.saved_valid = false;
    kept.asked = false;
    retain.tag = tag;
    take_copy();
}

RTS_RESULT RetainSaveExchanged(void)
{
    return HAS_RETAIN && kept.settled ? save_copy() : (RTS_RESULT)ERR_OK;
}
#endif

void RetainSettle(bool failed)
{
    if (!HAS_RETAIN || (failed && !is_of_application_before()))
        return;
    kept.settled = kept.table->size > 0;
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

#if FILE_STORE_FILES > 0
const RTS_UI8 *RetainGetSaved(RTS_UI32 *size, RTS_UI32 *tag)
{
    if (!HAS_RETAIN || !kept.settled || !kept.saved_valid)
        return NULL;
    *size = kept.table->area_size;
    *tag = retain.tag;
    return saved_area;
}

RTS_UI8 *RetainGetRoom(void)
{
    kept.saved_valid = false;
    return saved_area;
}

RTS_RESULT RetainRestore(bool valid)
{
    if (!valid)
        return RetainSave(true);
    memcpy(retain.area, saved_area, kept.table->area_size);
    return save_copy();
}

#if ONLINE_CHANGE
RTS_RESULT RetainRestoreFrom(const RETAIN_TABLE *table)
{
    kept.source = *table;
    kept.persistent_only = false;
    RetainPutBack();
    take_copy();
    return save_copy();
}
#endif
#endif

/* Whether a copy is wanted. */
static bool is_due(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (kept.asked || is_behind())
        return true;
    if (!kept.settled || now_ms - retain.last_check_ms < SAVE_MS)
        return false;
    retain.last_check_ms = now_ms;
    return !is_saved();
}

static void save_when_due(void)
{
    if (!is_due())
        return;
    kept.saved_valid = false;
    kept.asked = !IecTaskBetweenCycles(take_copy);
    if (!kept.asked && !is_in_sram())
        (void)save_copy();
}

/* A device whose retain flash fails still runs, with initial values. */
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
    if (hook == CH_INIT) {
        CMP_CLEAR(retain);
        CMP_CLEAR(kept);
    }
    if (hook == CH_INIT2)
        open_log();
    if (hook == CH_INIT3)
        return CMRegisterExternal(externals, RTS_COUNT(externals));
    if (hook == CH_COMM_CYCLE)
        save_when_due();
    return ERR_OK;
}
