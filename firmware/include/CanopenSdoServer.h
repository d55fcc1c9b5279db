/*
 * CanopenSdoServer.h - the SDO server of a CANopen device: expedited, segmented and block transfer.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main; time is an argument. One client at a time: a request that begins a transfer ends the previous one.
 */
#ifndef CANOPENSDOSERVER_H
#define CANOPENSDOSERVER_H

#include "CanopenDict.h"

enum { SDO_SERVER_MS = 3000 }; /* without a request a transfer ends, by an abort */

/* A request (600h + node). */
void SdoServerTake(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 now_ms);

/* Sends what waits, and ends a transfer whose client is silent. */
void SdoServerPoll(CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

/* Ends a transfer without a word: the device leaves the state in which it serves. */
void SdoServerReset(CANOPEN_SLAVE *slave);

/* Returns the time until the next call is due [ms], for a reply that waits or a time-out; UINT32_MAX: none. */
RTS_UI32 SdoServerGetWaitMs(const CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

#endif
