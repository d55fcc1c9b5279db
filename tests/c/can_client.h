/*
 * can_client.h - tools on the simulated CAN bus of the device, for comm_client.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CAN_CLIENT_H
#define CAN_CLIENT_H

#include "CmpSrvNumbers.h"
#include "IsoTp.h"
#include "SimCan.h"
#include "comm_client.h"

enum { CAN_TOOLS = 6, TOOL_PACKETS = 16, DEVICE_NODE = 5 };

typedef struct {
    RTS_UI32 node; /* of the bus */
    RTS_UI8 address;
    bool mute; /* sends no flow control */
    ISOTP_TX tx;
    ISOTP_RX rx;
    RTS_UI8 out[ISOTP_MAX_PACKET];
    RTS_UI8 in[ISOTP_MAX_PACKET];
    RTS_UI8 packet[TOOL_PACKETS][BLK_MAX_SIZE]; /* that have arrived */
    RTS_UI32 size[TOOL_PACKETS];
    RTS_UI32 first;
    RTS_UI32 count;
    RTS_UI32 failed; /* packets the device did not take */
    CLIENT_LINK link;
} CAN_TOOL;

/* The device with the number DEVICE_NODE on a new bus; `data_bit_rate` 0: classic frames only. */
void can_start(RTS_UI32 bit_rate, RTS_UI32 data_bit_rate);
void can_end(void);

/* A tool with this address, and a client that uses it. */
CAN_TOOL *can_tool(RTS_UI8 address);
void can_client(CLIENT *client, CAN_TOOL *tool);

/* A frame from a tool to `target`, as it is. */
void can_frame(const CAN_TOOL *tool, RTS_UI8 target, const void *data, RTS_UI8 size);

/* Lets time pass on the bus, in the device and in all tools. */
void can_pass(RTS_UI32 ms);

/* The same until nothing is sent any more. */
void can_settle(void);

/* The tool forgets what it was sending and receiving. */
void can_restart(CAN_TOOL *tool);

/* Begins to send a packet to the device; and takes one that has arrived, 0 when there is none. */
bool can_put(CAN_TOOL *tool, const RTS_UI8 *packet, RTS_UI32 size);
RTS_UI32 can_take(CAN_TOOL *tool, RTS_UI8 *packet, RTS_UI32 capacity);

/* Waits until what did not get through is given up, and forgets what has arrived. */
void can_drain(CAN_TOOL *tool);

#endif
