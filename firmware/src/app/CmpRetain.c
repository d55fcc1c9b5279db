/*
 * CmpRetain.c - retain variables in flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The area is copied in main while tasks may preempt or run beside it. A copy counts when no cycle ran meanwhile, so
 * that what is saved is the state between two cycles; only when that cannot be had for a whole save interval, the copy
 * is taken as it is.
 */
#include "CmpRetain.h"

#include <string.h>

#include "CmpIecTask.h"
#include "CmpLog.h"
#include "SysFlashLog.h"
#include "SysTime.h"
#include "rts_config.h"

static struct {
    FLASH_LOG log;
    RTS_UI8 *area;
    RTS_UI32 size;
    RTS_UI32 layout;
    bool saved_valid;      /* `saved_area` is what flash holds for this layout */
    bool failed;           /* the last save failed, and was logged */
    RTS_I64 last_check_ns; /* when the area was last found saved, or was saved */
} retain;

/* What flash holds; it is sized by the application's retain area, as that is. */
enum { HAS_RETAIN = APP_RETAIN_SIZE > 0 };
static RTS_UI8 saved_area[HAS_RETAIN ? APP_RETAIN_SIZE : 1];

#define SAVE_NS ((RTS_I64)APP_RETAIN_SAVE_US * 1000)

RTS_UI32 RetainCapacity(void)
{
    return HAS_RETAIN ? FlashLogCapacity(&retain.log) : 0;
}

void RetainAttach(RTS_UI8 *area, RTS_UI32 size, RTS_UI32 layout)
{
    if (!HAS_RETAIN)
        return;
    retain.area = area;
    retain.size = size;
    retain.layout = layout;
    retain.saved_valid = false;
    retain.last_check_ns = SysTimeGetNs();
}

RTS_UI32 RetainGetSequence(void)
{
    return HAS_RETAIN ? retain.log.sequence : 0;
}

RTS_RESULT RetainRestore(RTS_UI32 after, RTS_UI32 until)
{
    FLASH_LOG_RANGE range = {after, until};
    RTS_RESULT result;

    if (!HAS_RETAIN)
        return ERR_NO_OBJECT;
    if ((RTS_I32)(after - retain.log.sequence) > 0)
        retain.log.sequence = after; /* the log was lost: what is saved from now on shall count */
    if (retain.size == 0)
        return ERR_NO_OBJECT;
    result = FlashLogRead(&retain.log, range, retain.layout, retain.area, retain.size);
    if (result != ERR_OK)
        return result;
    memcpy(saved_area, retain.area, retain.size);
    retain.saved_valid = true;
    return ERR_OK;
}

static bool is_saved(void)
{
    return retain.saved_valid && memcmp(saved_area, retain.area, retain.size) == 0;
}

static void copy(void)
{
    retain.saved_valid = false;
    memcpy(saved_area, retain.area, retain.size);
}

/* Copies the area; true when no task ran a cycle meanwhile. */
static bool copy_between_cycles(void)
{
    bool busy;
    RTS_UI32 before = IecTaskGetActivity(&busy);

    if (busy)
        return false;
    copy();
    return IecTaskGetActivity(&busy) == before;
}

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
    if (!HAS_RETAIN || retain.size == 0 || (is_saved() && !always))
        return ERR_OK;
    copy();
    retain.failed = false; /* a stop that loses them is said, also after saves in between that failed */
    return save_copy();
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

static void save_when_due(void)
{
    enum { TRIES = 4 };
    RTS_I64 waited = SysTimeGetNs() - retain.last_check_ns;
    int i;

    if (retain.size == 0 || waited < SAVE_NS)
        return;
    if (is_saved()) {
        retain.last_check_ns = SysTimeGetNs();
        return;
    }
    for (i = 0; i < TRIES; i++) {
        if (copy_between_cycles()) {
            (void)save_copy();
            return;
        }
    }
    if (waited >= 2 * SAVE_NS) {
        copy();
        (void)save_copy();
    }
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
    if (hook == CH_COMM_CYCLE)
        save_when_due();
    return ERR_OK;
}
