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
 * A worker that dies is started again, with SysStartGet() telling of what it died, and its program too, unless the program
 * was what died, or that was so often. The caller has opened what all
 * workers share. SIGTERM and SIGINT end the worker in order, a second one at once; the worker ends with its supervisor,
 * whatever ends that. The worker gets SIGTERM, and may be sent it directly.
 */
int PortSupervise(int (*work)(void));

/* For the worker: it is up, and serves its line. True the first time in the life of plcrt; always without supervisor. */
bool PortIsUp(void);

/* For the worker, in each pass of main: whether the application runs. One that does not is not started after a death. */
void PortNoteRunning(bool running);

/* For the worker: which start of a program after a death this is, within PORT_PROGRAM_RESTARTS_MS; 0: it did not run, or
 * was what died; above PORT_PROGRAM_RESTARTS: it is not started any more. */
unsigned PortProgramRestart(void);

/* For the worker: how many workers before it have died. */
unsigned PortDeaths(void);

/* ---- SysStart.c ---- */

/* Sets why the runtime starts; `start` stays. */
void PortSetStart(const SYS_START *start);

#endif
