/*
 * CmpUserMgr.h - logins with a password (CmpDevice), and setting it (group 0x0C). docs/security.md, docs/protocol.md.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * As in SCRAM-SHA-256 (RFC 5802, RFC 7677) a client proves that it knows the password and does not send it, and what the
 * device keeps is no use to log in with. All from main.
 */
#ifndef CMPUSERMGR_H
#define CMPUSERMGR_H

#include "AppPassword.h"
#include "CmpItf.h"
#include "CommClient.h"

#if COMM_PASSWORD

/* A new challenge for this client, good for one proof. */
const DEV_CHALLENGE *UserChallenge(COMM_CLIENT *client);

/* ERR_OK: it proves the password, for the challenge of this client. ERR_NO_ACCESS_RIGHTS: it does not, and this
 * channel, also for its next client, gets ERR_NOT_READY_YET for PASSWORD_PAUSE_MS. */
RTS_RESULT UserCheckProof(COMM_CLIENT *client, const DEV_PROOF *proof);

RTS_RESULT CmpUserMgr_Hook(CMP_HOOK hook);

#endif

#endif
