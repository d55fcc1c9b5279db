/*
 * RunLamp.c - the lamp of a board is on while the program runs: a component that hears of events (CmpEventMgr.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppState.h"
#include "CmpEventMgr.h"
#include "CmpItf.h"
#include "BareMetal.h"

static void show(const EVENT_PARAM *event)
{
    BoardRunLamp(event->event == EVT_StartDone);
}

RTS_RESULT RunLamp_Hook(CMP_HOOK hook);

RTS_RESULT RunLamp_Hook(CMP_HOOK hook)
{
    static const RTS_UI32 events[] = {EVT_StartDone, EVT_StopDone, EVT_CmpApp_Exception};
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    if (hook == CH_INIT)
        BoardRunLamp(false);
    for (i = 0; hook == CH_INIT3 && result == ERR_OK && i < RTS_COUNT(events); i++)
        result = EventRegisterCallback(CMPID_CmpAppEmbedded, events[i], show, NULL);
    return result;
}
