/*
 * CanopenSdoClient.h - reads and writes objects of one node at a time: expedited and segmented SDO.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main; time is an argument.
 */
#ifndef CANOPENSDOCLIENT_H
#define CANOPENSDOCLIENT_H

#include "Canopen.h"
#include "SysCan.h"

typedef enum {
    SDO_IDLE,
    SDO_BUSY,
    SDO_DONE,
    SDO_ABORTED, /* `abort` has the code */
    SDO_SILENT,  /* no reply in time */
} SDO_STATE;

typedef struct {
    SDO_STATE state;
    RTS_UI8 node;
    bool writes;
    bool segmented;
    RTS_UI8 toggle;
    bool has_request; /* `request` is to be sent */
    CAN_FRAME request;
    RTS_UI16 index;
    RTS_UI8 sub;
    const RTS_UI8 *out;
    RTS_UI32 size;
    RTS_UI32 done;
    RTS_UI32 abort;
    RTS_UI32 timeout_ms;
    RTS_UI32 since_ms;
    RTS_UI8 *in; /* of the owner: what is read */
    RTS_UI32 room;
} SDO_CLIENT;

/* Begin a transfer; `data` stays until it has ended. A read of more than `room` bytes ends by SDO_ABORT_MEMORY, and the
 * first ones are there. */
void SdoClientRead(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 now_ms);
void SdoClientWrite(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, const RTS_UI8 *data, RTS_UI32 size,
                    RTS_UI32 now_ms);

/* A reply (580h + node). A reply to another request is ignored, also to one that still waits to be sent; an abort of a
 * transfer in segments ends it at any time. */
void SdoClientTake(SDO_CLIENT *client, const CAN_FRAME *frame, RTS_UI32 now_ms);

/* Ends a transfer whose reply is late, by an abort. */
void SdoClientPoll(SDO_CLIENT *client, RTS_UI32 now_ms);

/* Ends a transfer before its time, by an abort; the node may reply nevertheless. False: there is none. */
bool SdoClientCancel(SDO_CLIENT *client);

/* What was read, as a number of up to 32 bits. */
RTS_UI32 SdoClientGetNumber(const SDO_CLIENT *client);

#endif
