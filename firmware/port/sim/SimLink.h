/*
 * SimLink.h - the in-process block driver: router packets go in and out by function calls (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called from the thread that runs the runtime. A packet is handled within SimLinkSend; the answers wait in a queue.
 */
#ifndef SIMLINK_H
#define SIMLINK_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* Answers that wait at most; enough for the largest message. More stay in the runtime until its next CH_COMM_CYCLE. */
enum { SIM_LINK_PACKETS = 64 };

/* Hands one router packet to the runtime. ERR_NET_MSGSIZE when it is longer than BLK_MAX_SIZE, SIM_POWER_CUT when a
 * planned power cut hit the runtime while it handled the packet. */
RTS_RESULT SimLinkSend(const RTS_UI8 *packet, RTS_UI32 size);

/* Takes one packet the runtime sent; returns its size, 0 when there is none. One longer than `capacity` is lost. */
RTS_UI32 SimLinkReceive(RTS_UI8 *packet, RTS_UI32 capacity);

/* Forgets all packets, as pulling the plug does. */
void SimLinkReset(void);

#endif
