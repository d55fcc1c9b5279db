/*
 * password_client.c - what a client that knows the password sends.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "password_client.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpErrors.h"
#include "Sha256.h"

enum { ITERATIONS = 5000, NO_RESULT = 0xFFFF };

static const RTS_UI8 client_nonce[16] = "nonce of client";

static void stored_key(CLIENT_KEY key, RTS_UI8 *stored)
{
    SHA256 sum;

    Sha256Begin(&sum);
    Sha256Add(&sum, key, SHA256_SIZE);
    Sha256End(&sum, stored);
}

USER_VERIFIER password_verifier(CLIENT_KEY key)
{
    USER_VERIFIER verifier;

    memset(&verifier, 0, sizeof(verifier));
    if (key != NULL) {
        stored_key(key, verifier.key);
        memcpy(verifier.salt, "salt of a device", sizeof(verifier.salt));
        BytesPut32(verifier.iterations, ITERATIONS);
    }
    return verifier;
}

DEV_PROOF password_proof(CLIENT_KEY key, const DEV_CHALLENGE *challenge)
{
    RTS_UI8 stored[SHA256_SIZE];
    DEV_PROOF proof;
    SHA256 sum;

    memcpy(proof.nonce, client_nonce, sizeof(proof.nonce));
    stored_key(key, stored);
    HmacBegin(&sum, stored);
    Sha256Add(&sum, challenge, sizeof(*challenge));
    Sha256Add(&sum, proof.nonce, sizeof(proof.nonce));
    HmacEnd(&sum, stored, proof.proof);
    for (RTS_UI32 i = 0; i < SHA256_SIZE; i++)
        proof.proof[i] ^= (RTS_UI8)key[i];
    return proof;
}

/* Sends a login; its result. */
static RTS_UI32 send_login(CLIENT *client, const BTAG_WRITER *content, BTAG_READER *login, REPLY *reply)
{
    RTS_UI32 result = NO_RESULT;

    if (!client_call(client, SG_DEVICE, SRV_DEV_LOGIN, content, reply) ||
        BTagFindContainer(&reply->tags, TAG_DEV_LOGIN_REPLY, login) != ERR_OK)
        return NO_RESULT;
    return BTagFindUnsigned(login, TAG_DEV_LOGIN_RESULT, &result) == ERR_OK ? result : NO_RESULT;
}

RTS_UI32 password_ask(CLIENT *client, DEV_CHALLENGE *challenge)
{
    RTS_UI8 content[16];
    BTAG_WRITER writer;
    BTAG_READER login;
    REPLY reply;
    BTAG tag;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_CRYPT_TYPE, DEV_CRYPT_PROOF);
    RTS_UI32 result = send_login(client, &writer, &login, &reply);
    if (result == ERR_PENDING &&
        BTagFind(&login, TAG_DEV_CHALLENGE, sizeof(*challenge), sizeof(*challenge), &tag) == ERR_OK)
        memcpy(challenge, tag.data, sizeof(*challenge));
    return result;
}

RTS_UI32 password_answer(CLIENT *client, const DEV_PROOF *proof)
{
    RTS_UI8 content[80];
    BTAG_WRITER writer;
    BTAG_READER login;
    REPLY reply;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_CRYPT_TYPE, DEV_CRYPT_PROOF);
    BTagWrite(&writer, TAG_DEV_PROOF, BTAG_ALIGN_0, proof, sizeof(*proof));
    RTS_UI32 result = send_login(client, &writer, &login, &reply);
    if (result == ERR_OK && BTagFindUnsigned(&login, TAG_DEV_SESSION_ID, &client->session) != ERR_OK)
        return NO_RESULT;
    return result;
}

RTS_UI32 password_login(CLIENT *client, CLIENT_KEY key)
{
    DEV_CHALLENGE challenge;
    RTS_UI32 result = password_ask(client, &challenge);

    if (result != ERR_PENDING)
        return result;
    DEV_PROOF proof = password_proof(key, &challenge);
    return password_answer(client, &proof);
}

RTS_UI32 password_set(CLIENT *client, CLIENT_KEY key)
{
    USER_VERIFIER verifier = password_verifier(key);
    RTS_UI8 content[64];
    BTAG_WRITER writer;
    REPLY reply;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite(&writer, TAG_USER_VERIFIER, BTAG_ALIGN_0, &verifier, sizeof(verifier));
    if (!client_call(client, SG_USERMGR, SRV_USER_SET_CREDENTIALS, &writer, &reply))
        return NO_RESULT;
    return reply_error(&reply) != ERR_OK ? reply_error(&reply) : reply_number(&reply, TAG_SERVICE_RESULT);
}
