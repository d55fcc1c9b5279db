/*
 * AppState.h - the states of the application; the events it posts are in AppEventIds.h (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPSTATE_H
#define APPSTATE_H

#include "AppEventIds.h"
#include "CmpStd.h"

/* Application states (codesys-v3-protocol 4.6). An exception is AS_STOP with OS_EXCEPTION set in the operating
 * state. */
enum { AS_NONE = 0, AS_RUN = 1, AS_STOP = 2, AS_HALT_ON_BP = 3, AS_SINGLE_CYCLE = 5 };

/* AS_*. From any context. */
RTS_UI32 AppGetState(void);

#endif
