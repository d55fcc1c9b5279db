/*
 * SimMain.c - a task that waits for main: main is the thread that the task runs in.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysMain.h"

#include "CmpAppCalls.h"
#include "SimPower.h"
#include "rts_config.h"
#include "sim_port.h"

#if APP_CALL_WAIT_MS > 0

/* A power cut ends what main does at once, and the cycle of the task at its end. No cycle is aborted in between, as that
 * would leave the work of main in its middle. */
bool SysMainWait(const RTS_UI32 *word, RTS_UI32 value)
{
    bool is_on;

    RTS_UNUSED(word);
    RTS_UNUSED(value);
    SimSuperviseHold(true);
    is_on = SimPowerRunPart(AppCallsServe);
    SimSuperviseHold(false);
    return is_on;
}

void SysMainWake(const RTS_UI32 *word)
{
    RTS_UNUSED(word);
}

#endif
