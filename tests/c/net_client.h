/*
 * net_client.h - the other end of the device's sockets, for the tests of the drivers of networks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Sockets are real, on an address of loopback that is this process's own; time passes when a test lets it. What waits
 * for the network lets the device run until it is there.
 */
#ifndef NET_CLIENT_H
#define NET_CLIENT_H

#include "SysSocket.h"
#include "comm_client.h"

/* Starts the device at TCP port `tcp` and UDP `udp`, each "" for none, with "@" for our address. */
void net_start(const char *tcp, const char *udp);
void net_end(void);

/* Our own address of loopback, "127.x.y.z". */
const char *net_own(void);
/* Where the device is. */
SOCKADDRESS net_device(SYSSOCK_PURPOSE purpose);
/* Address and port of a socket's own end. */
SOCKADDRESS net_name(int file);

/* A connection to the device, which need not have noticed yet. */
int net_dial(void);
/* A UDP socket of ours at a port; 0: any. */
int net_udp(RTS_UI16 port);
void net_send_to(int file, SOCKADDRESS to, const void *data, RTS_UI32 size);

void net_write(int file, const void *data, RTS_UI32 size);
/* Lets the device run until so many bytes are there; false when the connection ends before, or for ever nothing comes.
 */
bool net_read(int file, void *data, RTS_UI32 size);
/* The next datagram; 0 when there is none after the device has run. */
RTS_UI32 net_datagram(int file, RTS_UI8 *data, RTS_UI32 capacity);
/* Lets the device run until the connection has ended. */
bool net_is_closed(int file);
/* Whether it is still open, after the device has run. */
bool net_is_open(int file);
/* Whether there is something to read, or the end, after the device has run. */
bool net_has_arrived(int file);
/* Ends a connection with a reset. */
void net_reset(int file);
/* Lets the device run until all that has arrived is handled. */
void net_settle(void);

/* The frame around a packet; returns its size. */
RTS_UI32 net_frame(const RTS_UI8 *packet, RTS_UI32 size, RTS_UI8 *frame);
/* The next packet in a frame; 0 when the connection ends. */
RTS_UI32 net_read_packet(int file, RTS_UI8 *packet);

/* A client over a connection; its address is a word. `link` stays. */
void net_client(CLIENT *client, CLIENT_LINK *link, int *file);

#endif
