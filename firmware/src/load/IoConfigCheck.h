/*
 * IoConfigCheck.h - checks the I/O configuration of an image, entry by entry.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOCONFIGCHECK_H
#define IOCONFIGCHECK_H

#include "AppChecks.h"

#if IO_MAX_CONNECTORS > 0
/* For AppTasks.c: reads where the configuration is, from a blob of `size` bytes. */
RTS_RESULT LoaderFindIo(LOADER *l, RTS_UI32 size);

/* A check of AppLoader.c, after those of areas and tasks. */
RTS_RESULT LoaderCheckIo(LOADER *l);
#else
#define LoaderFindIo(l, size) ((void)(size), (RTS_RESULT)ERR_OK)
#endif

#endif
