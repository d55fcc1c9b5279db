/*
 * AppReason.h - why a component denied what a service asked for (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPREASON_H
#define APPREASON_H

#include "rts_config.h"

/* Returns the words of the last denial (EVT_Deny*, AppState.h), without full stop, and forgets them; "" without one.
 * A service takes them before it acts, and again when that was refused. From main. */
#if EVENT_MAX_CALLBACKS == 0
#define AppTakeReason() ""
#else
const char *AppTakeReason(void);
#endif

#endif
