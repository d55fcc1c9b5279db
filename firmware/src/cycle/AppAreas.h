/*
 * AppAreas.h - the RAM of the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPAREAS_H
#define APPAREAS_H

#include "CmpIecAbi.h"
#include "rts_config.h"

/* Before all else. ERR_NOMEMORY. */
#if APP_AREAS_FROM_PORT
RTS_RESULT AppAreasInit(void);
#else
#define AppAreasInit() ERR_OK
#endif

/* Sets all areas to zero. */
void AppAreasClear(void);

/* Sets the outputs to zero, for AppEnterSafeState. From main or a task, outside of SysExceptTry. */
void AppAreasClearOutputs(void);

/* Where APP_AREA_DATA .. APP_AREA_MEMORY, or the copies of the tasks (AppImage.h), begins. */
enum { AREAS_COPIES = APP_AREA_CODE };
RTS_UI8 *AppAreasGet(RTS_UI32 area);

/* Enters the addresses of the RAM areas. */
void AppAreasSet(IEC_CONTEXT *context);

#endif
