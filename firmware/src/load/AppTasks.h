/*
 * AppTasks.h - checks the blobs of an image: tasks, kept variables.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPTASKS_H
#define APPTASKS_H

#include "AppChecks.h"

/* A check of AppLoader.c. */
RTS_RESULT LoaderCheckBlobs(LOADER *l);

/* One more, after it: the events of tasks, unless drivers may have them. */
RTS_RESULT LoaderCheckEvents(LOADER *l);

/* Whether the external event is there that a task waits for. */
RTS_RESULT AppTasksCheckEvent(const CDL_TASK *task, APP_REFUSAL *refusal);

#endif
