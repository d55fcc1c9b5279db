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

#endif
