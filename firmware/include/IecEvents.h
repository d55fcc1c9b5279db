/*
 * IecEvents.h - functions of the program that events call.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An application may have a function for each event of AppEventIds.h (IEC function table, CompactDownload.h). It runs in
 * main, watched as initialisation code is, while the application has its values and no exception. What it answers to an
 * EVT_Deny* and to EVT_PrepareDownload counts as that of a component. External functions for it:
 *
 *   event_answer(BOOL):BOOL     TRUE denies
 *   event_reason(LWORD, ...)    words for the denial, IEC_REASON_WORDS * 8 characters at most
 *
 * Functions in the table under IEC_CALLBACK and a number are called on the events that the program registers them for:
 *
 *   event_register(UDINT event, UDINT function, BOOL on):BOOL    until the variables of the program end
 *   event_current():UDINT                                        the event that calls
 */
#ifndef IECEVENTS_H
#define IECEVENTS_H

#include "CmpItf.h"
#include "rts_config.h"

enum { IEC_REASON_WORDS = 8 };

RTS_RESULT IecEvents_Hook(CMP_HOOK hook);

#endif
