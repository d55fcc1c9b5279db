/*
 * RunLamp.c - the lamp of a board is on while the program runs: a component that hears of events (CmpEventMgr.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * While something is forced it changes for a moment in every second: it goes out if the program runs, else it flashes.
 */
#include "AppState.h"
#include "BareMetal.h"
#include "CmpEventMgr.h"
#include "CmpForce.h"
#include "CmpItf.h"
#include "SysTime.h"

enum { PERIOD_MS = 1024, CHANGED_MS = 128 }; /* powers of two: the clock wraps */

static bool runs;
static bool is_on;

static void show(void)
{
    bool forced = ForceGetCount() > 0 && SysTimeGetMs() % PERIOD_MS < CHANGED_MS;

    if (is_on != (runs != forced)) {
        is_on = !is_on;
        BoardRunLamp(is_on);
    }
}

static void note(EVENT_PARAM *event)
{
    runs = event->event == EVT_StartDone;
    show();
}

RTS_RESULT RunLamp_Hook(CMP_HOOK hook);

RTS_RESULT RunLamp_Hook(CMP_HOOK hook)
{
    static const RTS_UI32 events[] = {EVT_StartDone, EVT_StopDone, EVT_CmpApp_Exception};
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    if (hook == CH_INIT) {
        runs = is_on = false;
        BoardRunLamp(false);
    }
    for (i = 0; hook == CH_INIT3 && result == ERR_OK && i < RTS_COUNT(events); i++)
        result = EventRegisterCallback(CMPID_CmpAppEmbedded, events[i], note, NULL);
    if (FORCE_MAX > 0 && hook == CH_COMM_CYCLE)
        show();
    return result;
}
