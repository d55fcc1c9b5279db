/*
 * channel_fixture.h - a client with an open channel, and what a test expects of its next package.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CHANNEL_FIXTURE_H
#define CHANNEL_FIXTURE_H

#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpChecksum.h"
#include "CmpSrv.h"
#include "SimLink.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { FIRST = CHANNEL_FLAG_TO_SERVER | CHANNEL_FLAG_FIRST, NEXT = CHANNEL_FLAG_TO_SERVER };

RTS_STATIC_ASSERT(NETSERVER_MESSAGE_SIZE >= TESTS_NEED_MESSAGE_SIZE, tests_have_room);

extern CLIENT client;
extern RTS_UI8 message[NETSERVER_MESSAGE_SIZE + 512];
extern RTS_UI8 reply[NETSERVER_MESSAGE_SIZE];
extern RTS_UI8 package[BLK_MAX_SIZE];

const CHANNEL_COUNTERS *counters(void);

/* Fills the driver's queue with acknowledgements of block 1 of the message. */
void fill_driver(RTS_UI32 size);
void setup(void);

/* An echo request with `data` bytes that wants as many back; returns its size. */
RTS_UI32 echo_message(RTS_UI32 data);

/* The next package is this one for our channel. */
RTS_UI32 take(RTS_UI8 type);
bool is_silent(void);
bool is_ack(RTS_UI32 number, RTS_UI8 flags);
bool is_close(RTS_UI16 error);
bool is_block(RTS_UI32 number);
bool works(CLIENT *who);

#endif
