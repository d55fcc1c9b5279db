/*
 * comm_client.h - a client in C for the tests of the communication; it talks through SimLink, or another link.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each layer can be used alone, so that tests can send what no proper client would.
 */
#ifndef COMM_CLIENT_H
#define COMM_CLIENT_H

#include "CmpBinTagUtil.h"
#include "CmpSrvNumbers.h"
#include "rts_config.h"

/* Tests send messages of several blocks. (The fuzz targets run with any size.) */
enum { TESTS_NEED_MESSAGE_SIZE = 2048 };

/* How packets go and come; `receive` returns 0 when there is none. */
typedef struct {
    void (*send)(void *instance, const RTS_UI8 *packet, RTS_UI32 size);
    RTS_UI32 (*receive)(void *instance, RTS_UI8 *packet, RTS_UI32 capacity);
    void *instance;
} CLIENT_LINK;

typedef struct {
    const CLIENT_LINK *link; /* NULL: SimLink */
    RTS_UI16 address;        /* one word */
    RTS_UI16 channel;
    RTS_UI32 limit;    /* granted buffer */
    RTS_UI32 sent;     /* number of the last block sent */
    RTS_UI32 received; /* number of the last block received in order */
    RTS_UI32 session;
    RTS_UI32 app_session;
    RTS_UI32 open_size; /* bytes of the last open response */
    RTS_UI32 packet;    /* longest that it sends, to a device that takes it; 0: BLK_MAX_SIZE, without asking */
} CLIENT;

/* Bytes of an open response of version 1.0. */
enum { CLIENT_OLD_RESPONSE = 20 };

/* ---- layer 3 ---- */

/* Of a packet; and the longest that a client sends. */
enum { CLIENT_HEADER_SIZE = 12, CLIENT_LONGEST = 4095 };

/* Bytes of a package that fit into a packet. */
RTS_UI32 client_room(const CLIENT *client);

/* Makes a packet from this client to the device; returns its size. `size`: at most client_room, as in all that
 * follow. */
RTS_UI32 client_packet(const CLIENT *client, RTS_UI8 service, const RTS_UI8 *payload, RTS_UI32 size, RTS_UI8 *packet);
/* Sends a channel package. */
void client_send_package(const CLIENT *client, const RTS_UI8 *package, RTS_UI32 size);
/* Takes the next packet for this client and returns the size of its payload (copied to `payload`, room for 512), 0
 * when there is none. *service may be NULL. */
RTS_UI32 client_take(const CLIENT *client, RTS_UI8 *service, RTS_UI8 *payload);

/* ---- layer 4 ---- */

void client_init(CLIENT *client, RTS_UI16 address);
/* Fills in version and CRC of a meta package. */
void client_seal(RTS_UI8 *package, RTS_UI32 size);
void client_send_open(const CLIENT *client, RTS_UI32 request_id, RTS_UI32 buffer);
/* Takes the open response; returns its result, -1 when there is none. */
int client_take_open(CLIENT *client);
/* Both; request id 7, buffer NETSERVER_MESSAGE_SIZE. */
bool client_open(CLIENT *client);
void client_send_close(const CLIENT *client);
/* The same, with a wrong id before it, as one does that tries ids in the client's name. */
void client_send_guess_and_close(const CLIENT *client);
/* Sends one block; flags as on the wire, first ones with length and crc of the message. */
void client_send_block(const CLIENT *client, RTS_UI32 number, RTS_UI8 flags, const RTS_UI8 *message, RTS_UI32 length,
                       RTS_UI32 offset, RTS_UI32 size);
void client_send_ack(const CLIENT *client, RTS_UI32 ack, RTS_UI8 flags);
/* Sends a whole message in blocks that fill their packets. */
void client_send_message(CLIENT *client, const RTS_UI8 *message, RTS_UI32 size);
/* Takes the blocks of a whole message and checks it; returns its size, 0 when it is not complete. */
RTS_UI32 client_take_message(CLIENT *client, RTS_UI8 *message);

/* ---- layer 7 ---- */

RTS_UI32 client_message(const CLIENT *client, RTS_UI16 group, RTS_UI16 service, const RTS_UI8 *content, RTS_UI32 size,
                        RTS_UI8 *message);

typedef struct {
    RTS_UI8 message[NETSERVER_MESSAGE_SIZE];
    RTS_UI32 size; /* 0: no reply */
    BTAG_READER tags;
    RTS_UI32 session;
} REPLY;

/* Sends a request and takes its reply; false when there was none or not the right one. */
bool client_request(CLIENT *client, RTS_UI16 group, RTS_UI16 service, const RTS_UI8 *content, RTS_UI32 size,
                    REPLY *reply);
/* The same with the content of a writer. */
bool client_call(CLIENT *client, RTS_UI16 group, RTS_UI16 service, const BTAG_WRITER *content, REPLY *reply);

/* The integer in tag `id` of the reply; 0xFFFFFFFF when there is none. */
RTS_UI32 reply_number(const REPLY *reply, RTS_UI32 id);
/* TAG_ERROR; ERR_OK when there is none. */
RTS_UI32 reply_error(const REPLY *reply);

/* Takes the sessions out of a reply to a login, to the device or the application; false when there are none. */
bool client_learn(CLIENT *client, const BTAG_READER *tags);

/* Opens, logs in, logs in to the application. */
bool client_login(CLIENT *client);
bool client_login_app(CLIENT *client);
bool client_connect(CLIENT *client);

#endif
