/*
 * SysTimeRtc.h - the wall clock a port gives: time of day and date, which people or a network set.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It may jump, so only programs use it, for what people read. From any context but interrupts; nothing blocks. A port
 * without such a clock writes neither function: those of SysTimeRtc.c say so.
 */
#ifndef SYSTIMERTC_H
#define SYSTIMERTC_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* UTC as ns since 1970-01-01. ERR_NOT_SUPPORTED: there is no clock; ERR_NOT_READY_YET: it has not been set. */
RTS_RESULT SysTimeRtcGet(RTS_I64 *utc_ns);

/* Sets it. ERR_NOT_SUPPORTED; ERR_NO_ACCESS_RIGHTS: programs may not; ERR_PARAMETER: not a time that it can have. */
RTS_RESULT SysTimeRtcSet(RTS_I64 utc_ns);

#endif
