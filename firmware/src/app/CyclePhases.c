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

enum { PLACES = CYCLE_MAX_PHASES > 0 ? CYCLE_MAX_PHASES : 1 };

CYCLE_ENTRY *cycle_phases[CYCLE_SAFE_STATE + 1];

static struct {
    RTS_UI32 count;
    CYCLE_ENTRY row[PLACES];
} phases;

RTS_RESULT CyclePhaseRegister(CYCLE_PHASE when, PF_CYCLE_PHASE run)
{
    CYCLE_ENTRY **end = &cycle_phases[when];

    if (CYCLE_MAX_PHASES == 0 || phases.count == PLACES)
        return CMNoRoom(CYCLE_OWN_PHASES);
    while (*end != NULL)
        end = &(*end)->next;
    *end = &phases.row[phases.count++];
    (*end)->run = run;
    return ERR_OK;
}

bool CyclePhasesExist(void)
{
    return CYCLE_MAX_PHASES > 0 && phases.count > 0;
}

void CyclePhasesForget(void)
{
    if (CYCLE_MAX_PHASES > 0) {
        CMP_CLEAR(phases);
        CMP_CLEAR(cycle_phases);
    }
}

void AppEnterSafeState(void)
{
    AppAreasClearOutputs();
    if (CyclePhasesExist())
        CyclePhasesRun(CYCLE_SAFE_STATE, 0, NULL);
}
