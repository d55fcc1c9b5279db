/*
 * password_client.h - what a client that knows the password sends.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef PASSWORD_CLIENT_H
#define PASSWORD_CLIENT_H

#include "CmpPackets.h"
#include "comm_client.h"

/* What a client has made of a password, 32 bytes (RFC 5802: ClientKey); NULL is no password. */
typedef const char *CLIENT_KEY;

/* What the device is to keep of a password. */
USER_VERIFIER password_verifier(CLIENT_KEY key);

/* Answers a challenge. */
DEV_PROOF password_proof(CLIENT_KEY key, const DEV_CHALLENGE *challenge);

/* The two steps of a login; each returns TAG_DEV_LOGIN_RESULT, or 0xFFFF without one. The second one has client->session
 * afterwards when it is ERR_OK. */
RTS_UI32 password_ask(CLIENT *client, DEV_CHALLENGE *challenge);
RTS_UI32 password_answer(CLIENT *client, const DEV_PROOF *proof);

/* Both. */
RTS_UI32 password_login(CLIENT *client, CLIENT_KEY key);

/* Sets another password; the result of the service, or the error of its reply. */
RTS_UI32 password_set(CLIENT *client, CLIENT_KEY key);

#endif
