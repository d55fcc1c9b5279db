/*
 * AppPassword.h - the password of the device, in flash beside what is known of its programs.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It is a part of each commit record (AppRecord.h), so a power cut leaves the previous one or the new one, and it stays
 * when programs come and go. Each half of their log has it, so a lost sector leaves it. If no record can be read, there
 * is a password that nothing matches. CmpUserMgr.h is what checks and sets it. With COMM_PASSWORD only. All from main.
 */
#ifndef APPPASSWORD_H
#define APPPASSWORD_H

#include "CmpErrors.h"
#include "CmpPackets.h"
#include "CmpStd.h"
#include "rts_config.h"

#if COMM_PASSWORD

/* From CH_INIT_TASKS on. */
bool AppHasPassword(void);
const USER_VERIFIER *AppPasswordGet(void);

/* `verifier` without iterations removes it. ERR_PARAMETER: no tool can have made it; ERR_DEVICE flash fault; the previous one
 * stays. */
RTS_RESULT AppPasswordSet(const USER_VERIFIER *verifier);

/* Removes it in a runtime that has not started: CH_INIT_SYSTEM2 has run, and no other hook after it. What cannot be read
 * of the commit log is given up. ERR_DEVICE flash fault; ERR_NO_OBJECT there is none. */
RTS_RESULT AppPasswordReset(void);

#else

static inline bool AppHasPassword(void)
{
    return false;
}

#endif

#endif
