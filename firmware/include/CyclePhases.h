/*
 * CyclePhases.h - what components do in the cycle of every task, before and after its code, and the safe state.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A cycle is a row of phases: inputs, the process image of the task (AppImage.h), before the code, the code, after the
 * code, the process image, outputs, record. A component registers what it does in a phase in CH_INIT3, for good, or adds
 * and removes it while tasks run (CmpForce). While none is registered, a task without process image pays one compare
 * before its code and one after it.
 *
 * All phases of a cycle run in the context of its task, which may be interrupted by tasks of a higher priority and, on
 * several cores, run at the same time as others: a phase that shares data with other tasks locks them itself
 * (SysLock.h; no lock is held when it is called). They belong to the cycle: monitoring and retain wait for their end,
 * statistics and watchdog count their time. But an error in them is not an exception of the program: a phase does
 * not block, and ends by itself, within the time that its component documents. After code that failed there are no
 * phases; the last two are left out when the application was stopped meanwhile: it may be in its safe state.
 */
#ifndef CYCLEPHASES_H
#define CYCLEPHASES_H

#include "CmpErrors.h"
#include "CmpIecAbi.h"
#include "CmpStd.h"

/* In the order of a cycle; of two that are registered for the same phase, the first registered comes first. */
typedef enum {
    CYCLE_INPUTS,      /* drivers fill the shared inputs, before the task gets its copy */
    CYCLE_BEFORE_CODE, /* inputs are forced, in what the task sees */
    CYCLE_AFTER_CODE,  /* outputs are forced, in what the task has written */
    CYCLE_OUTPUTS,     /* drivers take the shared outputs, which have what the task changed */
    CYCLE_RECORD,      /* trace */
    CYCLE_SAFE_STATE,  /* in no cycle: devices get what is safe, see AppEnterSafeState */
} CYCLE_PHASE;

/* `task`: its index; `context`: the areas as the task sees them, and the time of the cycle. Of CYCLE_SAFE_STATE: 0 and
 * NULL. */
typedef void (*PF_CYCLE_PHASE)(RTS_UI32 task, const IEC_CONTEXT *context);

/* From main, in CH_INIT3. ERR_NOMEMORY when CYCLE_MAX_PHASES are registered: raise CYCLE_OWN_PHASES. */
RTS_RESULT CyclePhaseRegister(CYCLE_PHASE when, PF_CYCLE_PHASE run);

/* By CYCLE_PHASE, in the order of registration. */
typedef struct CYCLE_ENTRY {
    PF_CYCLE_PHASE run;
    struct CYCLE_ENTRY *next;
} CYCLE_ENTRY;

/* The same for what comes and goes, with CYCLE_PHASES_CHANGE. The component keeps `entry` and sets its `run`. Removed, it may still
 * be called in the cycles that run just now. IecCycleFindPhases must follow. From main, also while tasks run. */
void CyclePhaseAdd(CYCLE_PHASE when, CYCLE_ENTRY *entry);
void CyclePhaseRemove(CYCLE_PHASE when, const CYCLE_ENTRY *entry);

/*
 * Puts the application into its safe state: outputs are zero, but for those that a channel takes to a device: they keep the
 * values of their variables, and the phases registered for CYCLE_SAFE_STATE have made the hardware safe. The one way there: after an exception (in the context of the task that had it, at once, and again
 * from main when all tasks have ended their cycle), at a stop, and when a start failed. No task starts another cycle by
 * then, and what those that still run have changed does not reach the outputs any more. From main or a task.
 */
void AppEnterSafeState(void);

/* ---- for IecCycle.c ---- */

/* A bit for each CYCLE_PHASE that is not empty. */
RTS_UI32 CyclePhasesGet(void);

extern CYCLE_ENTRY *cycle_phases[];

/* Calls those registered for `when`. Most phases have none, so it is inlined. */
static RTS_INLINE void CyclePhasesRun(CYCLE_PHASE when, RTS_UI32 task, const IEC_CONTEXT *context)
{
    const CYCLE_ENTRY *entry;

    for (entry = cycle_phases[when]; entry != NULL; entry = entry->next)
        entry->run(task, context);
}

/* Forgets all, as after power on. */
void CyclePhasesForget(void);

#endif
