/*
 * CanSocket.h - SocketCAN: the CAN interfaces of the Linux kernel.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * `file` is the socket. errno says why something failed. From main.
 */
#ifndef CANSOCKET_H
#define CANSOCKET_H

#include "SysCan.h"

/* A socket that receives nothing yet; -1 if there is no such interface, it is down, or (`fd`) it has no FD. */
int CanSocketOpen(const char *interface, bool fd);
bool CanSocketSetFilters(int file, const CAN_FILTER *filters, RTS_UI32 count);

/* ERR_OK; ERR_NOBUFFER: the queue of the interface is full; ERR_DEVICE. */
RTS_RESULT CanSocketSend(int file, const CAN_FRAME *frame);

/* ERR_OK; ERR_NOTHING_TO_DO; ERR_DEVICE: the interface is away. What the kernel says about the bus goes to `state`;
 * the time of the frame is left as it is. */
RTS_RESULT CanSocketReceive(int file, CAN_FRAME *frame, CAN_STATE *state);

#endif
