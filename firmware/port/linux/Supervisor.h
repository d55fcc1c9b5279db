/*
 * Supervisor.h - plcrt as two processes: one that runs the controller, and one that starts it again when it dies.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SUPERVISOR_H
#define SUPERVISOR_H

#include "SysStart.h"

/*
 * Runs `work` in a child process, the worker, and returns the exit status of plcrt: what `work` returned in the end.
 * A worker that dies is started again, with SysStartGet() telling of what it died. The caller has opened what all
 * workers share. SIGTERM and SIGINT end the worker in order, a second one at once; the worker ends with its supervisor,
 * whatever ends that. The worker gets SIGTERM, and may be sent it directly.
 */
int PortSupervise(int (*work)(void));

/* For the worker: it is up, and serves its line. True the first time in the life of plcrt; always without supervisor. */
bool PortIsUp(void);

/* ---- SysStart.c ---- */

/* Sets why the runtime starts; `start` stays. */
void PortSetStart(const SYS_START *start);

#endif
