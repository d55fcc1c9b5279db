/*
 * CyclePhases.c - what components do in the cycle of every task, and the safe state.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CyclePhases.h"

#include <string.h>

#include "AppAreas.h"
#include "CmpItf.h"
#include "rts_config.h"

typedef struct {
    CYCLE_PHASE when;
    PF_CYCLE_PHASE run;
} ENTRY;

enum { PLACES = CYCLE_MAX_PHASES > 0 ? CYCLE_MAX_PHASES : 1 };

/* In the order of registration. */
static struct {
    RTS_UI32 count;
    RTS_UI32 used; /* a bit for each phase that has one */
    ENTRY row[PLACES];
} phases;

RTS_RESULT CyclePhaseRegister(CYCLE_PHASE when, PF_CYCLE_PHASE run)
{
    if (CYCLE_MAX_PHASES == 0 || phases.count == PLACES)
        return ERR_NOMEMORY;
    phases.row[phases.count].when = when;
    phases.row[phases.count].run = run;
    phases.count++;
    phases.used |= 1u << when;
    return ERR_OK;
}

bool CyclePhasesExist(void)
{
    return CYCLE_MAX_PHASES > 0 && phases.count > 0;
}

void CyclePhasesRun(CYCLE_PHASE when, RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UI32 i;

    if (CYCLE_MAX_PHASES == 0 || (phases.used >> when & 1) == 0)
        return;
    for (i = 0; i < phases.count; i++) {
        if (phases.row[i].when == when)
            phases.row[i].run(task, context);
    }
}

void CyclePhasesForget(void)
{
    if (CYCLE_MAX_PHASES > 0)
        CMP_CLEAR(phases);
}

void AppEnterSafeState(void)
{
    AppAreasClearOutputs();
    CyclePhasesRun(CYCLE_SAFE_STATE, 0, NULL);
}
