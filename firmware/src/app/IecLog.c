/*
 * IecLog.c - messages of the program in the log.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called from tasks. The text comes by value, so no address of the program is read with the rights of the runtime.
 */
#include "IecLog.h"

#if IEC_LOG_BURST

#include <string.h>

#include "CmpLog.h"
#include "CmpStd.h"
#include "SysAtomic.h"
#include "SysTime.h"

enum { VERSION = 0x00010000, TEXT_SIZE = IEC_LOG_WORDS * 8 + 1, FIRST_PRINTABLE = ' ', DELETE = 0x7F };

static struct {
    RTS_UI32 used;     /* messages of the burst */
    RTS_UI32 since_ms; /* when `used` last went down */
    RTS_UI32 left_out;
} budget;

/* Gives back the messages of the time that has passed. Of several tasks one does. */
static void refill(void)
{
    RTS_UI32 since = SysAtomicLoad(&budget.since_ms);
    RTS_UI32 more = (SysTimeGetMs() - since) / IEC_LOG_REFILL_MS;
    RTS_UI32 used;

    if (more == 0 || !SysAtomicReplace(&budget.since_ms, since, since + more * IEC_LOG_REFILL_MS))
        return;
    do {
        used = SysAtomicLoad(&budget.used);
    } while (!SysAtomicReplace(&budget.used, used, used > more ? used - more : 0));
}

static bool take(void)
{
    RTS_UI32 used;

    refill();
    do {
        used = SysAtomicLoad(&budget.used);
        if (used >= IEC_LOG_BURST)
            return false;
    } while (!SysAtomicReplace(&budget.used, used, used + 1));
    return true;
}

static void report_left_out(void)
{
    RTS_UI32 count = SysAtomicLoad(&budget.left_out);

    if (count > 0 && SysAtomicReplace(&budget.left_out, count, 0))
        LogAdd(CMPID_IecLog, LOG_WARNING, ERR_OK, "%u messages of the program left out: it logs too often",
               (unsigned)count);
}

/* An exception is of the runtime: tools show its location. */
static RTS_UI32 class_of(RTS_UI32 log_class)
{
    if ((log_class & (LOG_ERROR | LOG_EXCEPTION)) != 0)
        return LOG_ERROR;
    if ((log_class & LOG_WARNING) != 0)
        return LOG_WARNING;
    return log_class == LOG_DEBUG ? LOG_DEBUG : LOG_INFO;
}

/* A message stays one line. */
static void replace_controls(char *text)
{
    for (; *text != '\0'; text++) {
        if ((RTS_UI8)*text < FIRST_PRINTABLE || *text == DELETE)
            *text = ' ';
    }
}

/* Adds a message; false when there were too many. */
static RTS_UI8 log_add(RTS_UI32 log_class, RTS_UI32 error, RTS_UI64 word0, RTS_UI64 word1, RTS_UI64 word2,
                       RTS_UI64 word3, RTS_UI64 word4, RTS_UI64 word5, RTS_UI64 word6, RTS_UI64 word7, RTS_UI64 word8,
                       RTS_UI64 word9)
{
    const RTS_UI64 words[IEC_LOG_WORDS] = {word0, word1, word2, word3, word4, word5, word6, word7, word8, word9};
    char text[TEXT_SIZE] = {0};

    if (!take()) {
        SysAtomicAdd(&budget.left_out, 1);
        return 0;
    }
    memcpy(text, words, sizeof words);
    replace_controls(text);
    report_left_out();
    LogAdd(CMPID_IecLog, class_of(log_class), error, "%s", text);
    return 1;
}

APP_GATE(log_add);

static const CMP_EXT_FUNCTION functions[] = {
    /* log_add(UDINT,UDINT,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD):BOOL */
    {"log_add", 0x85293920, VERSION, (RTS_PFN)APP_GATED(log_add)},
};

RTS_RESULT IecLog_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(budget);
    return hook == CH_INIT3 ? CMRegisterExternal(functions, RTS_COUNT(functions)) : ERR_OK;
}

#endif
