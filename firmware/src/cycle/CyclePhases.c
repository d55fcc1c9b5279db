/*
 * CyclePhases.c - what components do in the cycle of every task, and the safe state.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CyclePhases.h"

#include <string.h>

#include "AppAreas.h"
#include "CmpItf.h"
#include "SysAtomic.h"
#include "rts_config.h"

enum { PLACES = CYCLE_MAX_PHASES > 0 ? CYCLE_MAX_PHASES : 1 };

CYCLE_ENTRY *cycle_phases[CYCLE_SAFE_STATE + 1];

static struct {
    RTS_UI8 used;  /* see CyclePhasesGet */
    RTS_UI8 taken; /* of `row` */
    CYCLE_ENTRY row[PLACES];
} phases;

static void append(CYCLE_PHASE when, CYCLE_ENTRY *entry)
{
    CYCLE_ENTRY **end = &cycle_phases[when];

    while (*end != NULL)
        end = &(*end)->next;
    *end = entry;
    phases.used |= (RTS_UI8)(1u << when);
}

RTS_RESULT CyclePhaseRegister(CYCLE_PHASE when, PF_CYCLE_PHASE run)
{
    CYCLE_ENTRY *entry;

    if (CYCLE_MAX_PHASES == 0 || phases.taken == PLACES)
        return CMNoRoom(CYCLE_OWN_PHASES);
    entry = &phases.row[phases.taken++];
    entry->run = run;
    append(when, entry);
    return ERR_OK;
}

#if CYCLE_PHASES_CHANGE
void CyclePhaseAdd(CYCLE_PHASE when, CYCLE_ENTRY *entry)
{
    entry->next = NULL;
    SysAtomicFence(); /* a task sees it complete */
    append(when, entry);
}

/* A task that is at `entry` goes on from there. */
void CyclePhaseRemove(CYCLE_PHASE when, const CYCLE_ENTRY *entry)
{
    CYCLE_ENTRY **at = &cycle_phases[when];

    while (*at != entry)
        at = &(*at)->next;
    *at = entry->next;
    if (cycle_phases[when] == NULL)
        phases.used &= (RTS_UI8) ~(1u << when);
}
#endif

RTS_UI32 CyclePhasesGet(void)
{
    return CYCLE_MAX_PHASES > 0 ? phases.used : 0;
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
    if (CyclePhasesGet() != 0)
        CyclePhasesRun(CYCLE_SAFE_STATE, 0, NULL);
}
