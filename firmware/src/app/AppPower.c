/*
 * AppPower.c - what main does when the power is about to fail.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The program is stopped, so that nothing happens after the moment that is saved. In flash it still is a program that
 * runs: it starts with the next power-up, or when it turns out that the power is back.
 */
#include "AppPower.h"

#include "AppLife.h"
#include "AppPowerFails.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "SysAtomic.h"
#include "SysTime.h"

#if APP_POWER_FAIL

static struct {
    RTS_UI32 fails; /* not handled yet */
    bool waits;     /* for the power to be back: the program ran */
    RTS_UI32 since_ms;
} power;

void AppPowerFails(void)
{
    SysAtomicStore(&power.fails, 1);
}

void AppPowerForget(void)
{
    power.waits = false;
}

static void save(void)
{
    RTS_UI32 start_ms = SysTimeGetMs();
    bool ran = AppStopTasks();
    RTS_RESULT result = ran ? (RTS_RESULT)ERR_OK : RetainSave(false);

    power.since_ms = SysTimeGetMs();
    power.waits = power.waits || ran;
    LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING | LOG_KEPT, result,
           "The power fails: program stopped and values saved in %u ms", (unsigned)(power.since_ms - start_ms));
}

static void go_on(void)
{
    power.waits = false;
    if (AppGetState() != AS_STOP || AppHasException())
        return;
    LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING | LOG_KEPT, ERR_OK,
           "The power is back after %u ms: the program is started again", (unsigned)APP_POWER_BACK_MS);
    (void)AppStartIfAllowed();
}

void AppPowerCheck(void)
{
    if (SysAtomicLoad(&power.fails) != 0) {
        SysAtomicStore(&power.fails, 0);
        save();
    } else if (power.waits && SysTimeGetMs() - power.since_ms >= APP_POWER_BACK_MS) {
        go_on();
    }
}

#endif
