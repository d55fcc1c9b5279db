/*
 * CmpForce.h - forced variables: a list of places that keep their value whatever the program and the devices write
 * (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 3.3.2. Each task writes all values before its code, into what it sees, and after it, into what it leaves: a
 * forced input is the same for the whole cycle, a forced output is what the devices get. What another task writes in
 * between is set back at the next of these moments. The outputs of the safe state are not forced.
 *
 * The list is in RAM. It ends when the variables do (EVT_PrepareExit: reset, download), not with the tool that made it.
 * While it is empty, no phase is registered and a cycle costs what it costs without this component.
 *
 * FORCE_MAX values. Without, this component is not there, and all of it is left out.
 */
#ifndef CMPFORCE_H
#define CMPFORCE_H

#include "AppAddress.h"
#include "CmpErrors.h"
#include "CmpStd.h"
#ifndef RTS_CFFI
#include "CmpItf.h"
#include "rts_config.h"
#endif

/* Laid out as a MON2_FORCED. */
typedef struct {
    APP_PLACE place;
    RTS_UI32 value[2]; /* in its first `place.size` bytes */
} FORCED_VALUE;

/* Checks whether a place can be forced now, on an application that is loaded. MONITORING_ERR_UNSUPPORTED_DATATYPE: its
 * size, or bits of more than a byte; MONITORING_ERR_OPERATION_DENIED: code and constants; MONITORING_ERR_FORCE_FAILED: no
 * room after the *added ones that were checked before, which it counts; or as AppPlaceFind. From main. */
MON_RESULT ForceCheck(const APP_PLACE *place, RTS_UI32 *added);

/* Forces a checked place, at once and in each cycle; in place of the value that it has been forced to, as the last one:
 * where two overlap, the last one holds. MONITORING_ERR_FORCE_FAILED above FORCE_MAX. From main. */
MON_RESULT ForceSet(const FORCED_VALUE *value);

/* Ends it for one place, if it is forced, or for all. The variable keeps the value until it is written. From main. */
void ForceEnd(const APP_PLACE *place);
void ForceEndAll(void);

/* NULL after the last one, in the order in which they were forced. From main; valid until the list changes. */
const FORCED_VALUE *ForceGet(RTS_UI32 index);

#if !defined(RTS_CFFI) && FORCE_MAX == 0
#define ForceGetCount() 0u
#else
/* How many there are. From main. */
RTS_UI32 ForceGetCount(void);
#endif

/* FORCE_MAX. */
RTS_UI32 ForceGetRoom(void);

/* Differs after each change of the list. From main. */
RTS_UI32 ForceGetSerial(void);

#ifndef RTS_CFFI
RTS_RESULT CmpForce_Hook(CMP_HOOK hook);
#endif

#endif
