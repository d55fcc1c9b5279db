/*
 * IecLog.h - messages of the program in the log.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 3.9.2. A program calls LogAdd2 of the library (host/plctool/stdlib/log.st). It may add IEC_LOG_BURST messages at
 * once and then one in each IEC_LOG_REFILL_MS, so that a program that logs in each cycle leaves room in the ring for the
 * messages of the runtime. What is left out is counted, and the next message says how many.
 */
#ifndef IECLOG_H
#define IECLOG_H

#include "CmpItf.h"
#include "rts_config.h"

enum { IEC_LOG_WORDS = 10 }; /* of a message, 8 characters each */

RTS_RESULT IecLog_Hook(CMP_HOOK hook);

#endif
