/*
 * CanopenSdoClient.h - reads and writes objects of one node at a time: expedited, segmented and block SDO.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main; time is an argument.
 * With CANOPEN_SDO_BLOCK, values of SDO_BLOCK_FROM bytes and more are transferred in blocks. A read begins as a normal
 * one. It is aborted and begun again in blocks once the node has reported a size that is worth it, so devices without
 * block transfer never see a request for it with small objects. A node that refuses blocks gets and gives segments.
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

enum {
    SDO_AGAIN_MS = 10,    /* after a frame that could not be sent */
    SDO_BLOCK_FROM = 128, /* bytes */
    SDO_READ_BLOCK = 32,  /* segments that a node sends without an acknowledgement: few, as they wait for main */
};

/* Sends a frame of `owner`. Returns false if there is no room now. */
typedef bool (*PF_CANOPEN_SEND)(void *owner, const CAN_FRAME *frame);

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
#if CANOPEN_SDO_BLOCK
    RTS_UI8 phase;      /* of a transfer in blocks, 0: in none */
    RTS_UI8 block;      /* segments in a block */
    RTS_UI8 sequence;   /* segments of this block that were sent, or have come in order */
    RTS_UI8 stuck;      /* blocks in a row of which no segment has arrived */
    bool has_crc;       /* the node checks, or sends, a CRC */
    bool without_block; /* the node has refused blocks in this transfer */
    RTS_UI8 burst;      /* of the owner: segments that are sent in a millisecond, 0: any number */
    RTS_UI8 burst_left;
    RTS_UI32 burst_ms;
    RTS_UI32 block_start; /* `done` where this block begins */
#endif
} SDO_CLIENT;

/* Begin a transfer; `data` stays until it has ended. A read of more than `room` bytes ends by SDO_ABORT_MEMORY, and the
 * first ones are there. */
void SdoClientRead(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 now_ms);
void SdoClientWrite(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, const RTS_UI8 *data, RTS_UI32 size,
                    RTS_UI32 now_ms);

/* A reply (580h + node). A reply to another request is ignored, also to one that still waits to be sent; an abort of a
 * transfer in segments ends it at any time. */
void SdoClientTake(SDO_CLIENT *client, const CAN_FRAME *frame, RTS_UI32 now_ms);

/* Sends the frames that wait, of a block as many segments as `burst` allows. False: some still wait, call it again after
 * SdoClientGetAgainMs(). */
bool SdoClientSend(SDO_CLIENT *client, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms);

static inline RTS_UI32 SdoClientGetAgainMs(const SDO_CLIENT *client)
{
#if CANOPEN_SDO_BLOCK
    return client->phase != 0 ? 1 : SDO_AGAIN_MS;
#else
    RTS_UNUSED(client);
    return SDO_AGAIN_MS;
#endif
}

/* Ends a transfer whose reply is late, by an abort. */
void SdoClientPoll(SDO_CLIENT *client, RTS_UI32 now_ms);

/* Ends a transfer before its time, by an abort; the node may reply nevertheless. False: there is none. */
bool SdoClientCancel(SDO_CLIENT *client);

/* What was read, as a number of up to 32 bits. */
RTS_UI32 SdoClientGetNumber(const SDO_CLIENT *client);

#endif
