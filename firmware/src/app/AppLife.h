/*
 * AppLife.h - the loaded application: load, start, stop, exceptions.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpAppEmbedded.c is the component, AppDownload.c puts another application in its place, AppBoot.c loads what is in
 * flash; all of them call the life, which calls none of them. All from main.
 */
#ifndef APPLIFE_H
#define APPLIFE_H

#include "../load/AppLoaded.h"
#include "AppRefusal.h"
#include "AppState.h"
#include "CmpErrors.h"
#include "SettingValues.h"

/* Slot of the loaded application, SLOT_NONE without one. */
RTS_UI32 AppGetSlot(void);
bool AppHasException(void);

/* Whether its last cycle was aborted for a stop. That says nothing against the program, but it starts from a reset
 * only. */
bool AppWasBrokenOff(void);

/* False while it waits for its initial values. */
bool AppIsInitialised(void);

/* What the loader knows about it, all zero without one, and what each of its tasks starts from. */
const APP_IMAGE *AppGetImage(void);
const IEC_CONTEXT *AppGetContext(void);

/* Makes the code of a checked image executable and returns where; NULL when the port cannot. */
const RTS_UI8 *AppMapCode(const APP_IMAGE *image);

/* Takes over a checked image with its code mapped at `code`, when nothing is loaded. Retain variables come from a
 * record up to number `retain_until`. The application is in AS_STOP then, and nothing of it was called. An error comes
 * with its sentence: the flash cannot be read, or a driver refuses the I/O configuration. */
RTS_RESULT AppLoad(const APP_IMAGE *image, const RTS_UI8 *code, RTS_UI32 retain_until, APP_REFUSAL *refusal);
void AppUnload(void);

/* Gives the loaded application its initial values and its tasks; it is in AS_STOP then, perhaps with an exception. It
 * is given up when its tasks cannot be created: ERR_NOMEMORY. */
RTS_RESULT AppInitialise(void);

/* The same for one that has them, after its own code for the end. Cold: also for its retain variables. */
RTS_RESULT AppReinitialise(bool cold);

#if ONLINE_CHANGE
/* The records of the tasks of the loaded application, and its imports. */
const APP_TABLES *AppGetTables(void);

/* The tasks that the loaded application has at the same index, alike but for where their code is: a bit each. */
RTS_UI32 AppFindKeptTasks(const APP_IMAGE *image, const APP_TABLES *tables);

/* A checked image with its code mapped at `code` takes the place of the loaded one, with the same areas. No task is in its
 * cycle. */
void AppExchange(const APP_IMAGE *image, const RTS_UI8 *code, const APP_TABLES *tables);

/* Runs the code at an offset with the context of the application, like an initialisation; false when it failed, with the
 * exception in *code. */
bool AppRunInit(RTS_UI32 offset, RTS_UI32 *exception);

/* The loaded application is another one since now: it has to prove itself. */
void AppBeginProof(void);
#endif

/* Starts the loaded application, initialised before if it was not yet. ERR_EXCEPTION: that failed. */
RTS_RESULT AppStart(void);

/* As AppStart for one cycle of each task (IecTaskRunOnce), after which it is stopped. ERR_EXCEPTION: or that failed. */
RTS_RESULT AppRunOnce(void);

/* Stops the tasks; true when they ran. */
bool AppStopTasks(void);

/* Completes what AppHandleException has begun. */
void AppHandlePendingException(void);

#if EVENT_MAX_CALLBACKS > 0
/* Posts an event about the loaded application. */
void AppPostEvent(RTS_UI32 event);

/* Asks EVT_DenyStop while the application runs. Returns the answer. */
RTS_RESULT AppAskStop(void);

/* Gives the loaded application its initial values if it waits for them, and asks whether it may start: EVT_DenyStart or
 * EVT_DenyStartBootproject. ERR_EXCEPTION: the initial values failed. */
RTS_RESULT AppAskStart(RTS_UI32 event);

/* AppStart, unless EVT_DenyStart is denied. */
RTS_RESULT AppStartIfAllowed(void);
#else
#define AppPostEvent(event) ((void)0)
#define AppAskStop() ((RTS_RESULT)ERR_OK)
#define AppAskStart(event) ((RTS_RESULT)ERR_OK)
#define AppStartIfAllowed() AppStart()
#endif

/* With Bootproject.Start=clean: notes in flash that the active application, which has proven itself, ended by an exception or
 * crash. It runs on request only. False: it goes by the usual rules. */
#if SETTINGS
bool AppEndUnclean(const char *text);
#else
#define AppEndUnclean(text) false
#endif

/* An application that has run for APP_PROVE_US, and is in no long cycle, has proven itself. In each pass of main. */
void AppCheckProof(void);

/* The state as after power on, without an application. */
void AppForget(void);

#endif
