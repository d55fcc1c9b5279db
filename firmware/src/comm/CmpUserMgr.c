/*
 * CmpUserMgr.c - logins with a password, and setting it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Guessing is slowed down by channel, not by peer: a peer can take another address, but there are only so many channels.
 * On a network a stranger delays no client for longer than the pause, because one that has got a channel keeps it
 * meanwhile.
 */
#include "CmpUserMgr.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpLog.h"
#include "CmpSrv.h"
#include "Sha256.h"
#include "SysTarget.h"
#include "SysTime.h"

#if COMM_PASSWORD

RTS_STATIC_ASSERT(sizeof(((USER_VERIFIER *)0)->key) == SHA256_SIZE, a_key_is_a_digest);
RTS_STATIC_ASSERT((int)PASSWORD_PAUSE_MS < (int)CHANNEL_SETTLE_MS, a_channel_is_kept_for_the_pause);

static struct {
    bool reported; /* that there are wrong ones, since the last right one */
} users;

/* ---- the proof ---- */

const DEV_CHALLENGE *UserChallenge(COMM_CLIENT *client)
{
    DEV_CHALLENGE *challenge = &client->session.challenge;
    const USER_VERIFIER *password = AppPasswordGet();

    for (RTS_UI32 i = 0; i < sizeof(challenge->nonce); i += sizeof(RTS_UI32))
        BytesPut32(challenge->nonce + i, SysTargetRandom());
    memcpy(challenge->salt, password->salt, sizeof(challenge->salt));
    memcpy(challenge->iterations, password->iterations, sizeof(challenge->iterations));
    client->session.challenged = true;
    return challenge;
}

/* ClientProof is ClientKey XOR HMAC(StoredKey, what was said), and StoredKey is H(ClientKey). */
static bool is_right(const DEV_CHALLENGE *challenge, const DEV_PROOF *proof)
{
    const RTS_UI8 *key = AppPasswordGet()->key;
    RTS_UI8 digest[SHA256_SIZE];
    SHA256 sum;

    HmacBegin(&sum, key);
    Sha256Add(&sum, challenge, sizeof(*challenge));
    Sha256Add(&sum, proof->nonce, sizeof(proof->nonce));
    HmacEnd(&sum, key, digest);
    for (RTS_UI32 i = 0; i < SHA256_SIZE; i++)
        digest[i] ^= proof->proof[i];
    Sha256Begin(&sum);
    Sha256Add(&sum, digest, sizeof(digest));
    Sha256End(&sum, digest);
    return Sha256IsEqual(digest, key);
}

static bool is_paused(COMM_CLIENT *client)
{
    if (client->login_paused && SysTimeGetMs() - client->paused_since >= PASSWORD_PAUSE_MS)
        client->login_paused = false;
    return client->login_paused;
}

/* One line for all wrong ones in a row: they shall not push everything else out of the log. */
static void note_wrong(COMM_CLIENT *client)
{
    client->login_paused = true;
    client->paused_since = SysTimeGetMs();
    if (!users.reported)
        LogAdd(CMPID_CmpUserMgr, LOG_WARNING, ERR_NO_ACCESS_RIGHTS, "Login with a wrong password");
    users.reported = true;
}

RTS_RESULT UserCheckProof(COMM_CLIENT *client, const DEV_PROOF *proof)
{
    bool challenged = client->session.challenged;

    client->session.challenged = false;
    if (is_paused(client))
        return ERR_NOT_READY_YET;
    if (!challenged || !is_right(&client->session.challenge, proof)) {
        note_wrong(client);
        return ERR_NO_ACCESS_RIGHTS;
    }
    users.reported = false;
    return ERR_OK;
}

/* ---- setting it ---- */

/* Logins made without the password, or with the previous one, end. */
static void end_others(const COMM_CLIENT *one)
{
    COMM_CLIENT *client;

    for (RTS_UI32 i = 0; (client = ChannelGetClient(i)) != NULL; i++)
        if (client != one)
            SrvEndSession(client);
}

static RTS_RESULT set_credentials(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_USER_VERIFIER, sizeof(USER_VERIFIER), sizeof(USER_VERIFIER), &tag);

    if (result != ERR_OK)
        return result;
    result = AppPasswordSet((const USER_VERIFIER *)tag.data);
    if (result == ERR_OK) {
        end_others(request->client);
        LogAdd(CMPID_CmpUserMgr, LOG_INFO, ERR_OK, "Password %s", AppHasPassword() ? "set" : "removed");
    }
    BTagWrite16(reply, TAG_SERVICE_RESULT, result);
    return ERR_OK;
}

/* Who may replace the program has the device. */
static const SRV_SERVICE services[] = {
    {SRV_USER_SET_CREDENTIALS, RIGHT_DOWNLOAD, set_credentials},
};

RTS_RESULT CmpUserMgr_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(users);
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_USERMGR, services, RTS_COUNT(services)) : ERR_OK;
}

#endif
