/*
 * AppEvents.h - tells components what happens to an application, and asks whether it may.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main. Without EVENT_MAX_CALLBACKS there are no components to ask, and no code for it.
 */
#ifndef APPEVENTS_H
#define APPEVENTS_H

#include "../load/AppLoaded.h"
#include "AppEventIds.h"
#include "CmpErrors.h"
#include "CmpEventMgr.h"
#include "rts_config.h"

#if EVENT_MAX_CALLBACKS > 0
/* Posts an event about the application of an image; `size` 0: there is none. */
void AppEventTell(RTS_UI32 event, const APP_IMAGE *image);

/* The same for a question. Returns the answer, and logs one that is not ERR_OK. */
RTS_RESULT AppEventAsk(RTS_UI32 event, const APP_IMAGE *image);

/* The same two about the boot project, which is not loaded yet. */
void AppEventTellBoot(RTS_UI32 event);
RTS_RESULT AppEventAskBoot(RTS_UI32 event);

/* True within a callback: the application cannot be started, stopped, reset or replaced. */
#define AppEventIsPosting() EventIsPosting()
#else
#define AppEventTell(event, image) ((void)0)
#define AppEventAsk(event, image) ((RTS_RESULT)ERR_OK)
#define AppEventTellBoot(event) ((void)0)
#define AppEventAskBoot(event) ((RTS_RESULT)ERR_OK)
#define AppEventIsPosting() false
#endif

#endif
