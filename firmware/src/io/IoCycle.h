/*
 * IoCycle.h - what the I/O manager does with drivers in each cycle, in the safe state, and in main.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOCYCLE_H
#define IOCYCLE_H

#include "CmpErrors.h"
#include "IoDrv.h"

/* ---- from main ---- */

/* The configuration is in force, with these drivers: registers in the cycle, the first time, and makes outputs safe.
 * ERR_NOMEMORY: CYCLE_MAX_PHASES. Unload: there is none any more. Forget: as after power on. */
RTS_RESULT IoCycleLoad(IO_DRIVER *drivers);
void IoCycleUnload(void);
void IoCycleForget(void);

#if ONLINE_CHANGE
/* Tasks go on with the tables that are loaded now. While no task runs. */
void IoCycleFollow(void);
#endif

/* What tasks do otherwise, while the application is stopped: inputs, bus cycles, variables of the program. */
void IoCycleKeepUp(void);
/* Has drivers look after their connectors. */
void IoCycleDiagnose(void);

/* ---- from main or a task that failed ---- */

/* For AppIo.h. */
void IoCycleGetKept(RTS_UI32 first, RTS_UI8 *mask, RTS_UI32 size);

#endif
