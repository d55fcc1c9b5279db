/*
 * IecTaskHandler.h - a function of the program that decides what follows an exception of a task. Manual 3.13.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The application may have a function for EVT_TaskException. It runs in the context of the task that failed, watched as its
 * cycles are. What it answers by this external function, called with the number of its task (IEC_CONTEXT.task):
 *
 *   task_answer(UDINT task, BOOL goes_on):BOOL    TRUE: the program goes on; the cycle is lost
 */
#ifndef IECTASKHANDLER_H
#define IECTASKHANDLER_H

#include "CmpItf.h"
#include "rts_config.h"

RTS_RESULT IecTaskHandler_Hook(CMP_HOOK hook);

#endif
