/*
 * Mdns.h - messages of multicast DNS that make a device known: queries about it, and the replies. RFC 6762, RFC 6763.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A device is an instance of the service _plcrt._tcp.local, with a host name and one IPv4 address for each network. No
 * function keeps anything; CmpMdns.h says when messages are sent.
 */
#ifndef MDNS_H
#define MDNS_H

#include "CmpStd.h"

#define MDNS_SERVICE "_plcrt"

enum {
    MDNS_PORT = 5353,
    MDNS_LABEL_SIZE = 64, /* a label of a name, with NUL */
    MDNS_TEXT_SIZE = 128, /* a property "key=value", with NUL */
    MDNS_TEXTS = 4,
    MDNS_REPLY_SIZE = 1300, /* the longest reply: five records with names and properties, and a question */
    MDNS_QUERY_SIZE = 1500, /* longer ones are ignored */
};

/* 224.0.0.251 */
#define MDNS_GROUP 0xE00000FBu

/* A device as one of its networks sees it. */
typedef struct {
    char instance[MDNS_LABEL_SIZE];
    char host[MDNS_LABEL_SIZE];
    RTS_UI32 ip;
    RTS_UI16 port;
    char text[MDNS_TEXTS][MDNS_TEXT_SIZE]; /* "": none */
} MDNS_DEVICE;

typedef enum {
    MDNS_SILENCE, /* nothing is sent */
    MDNS_TO_ALL,
    MDNS_TO_SENDER, /* it asks for that, or is not a member of the group */
} MDNS_RECEIVER;

/* Reads a query and writes the reply, of `*reply_size` bytes, to `reply` (MDNS_REPLY_SIZE bytes). `port` is that of the
 * sender. What the sender knows already is left out. */
MDNS_RECEIVER MdnsReply(const MDNS_DEVICE *device, const RTS_UI8 *query, RTS_UI32 size, RTS_UI16 port, RTS_UI8 *reply,
                        RTS_UI32 *reply_size);

/* Writes the question whether another device has these names, with what this one will say of them; returns the size. */
RTS_UI32 MdnsProbe(const MDNS_DEVICE *device, RTS_UI8 *message);

/* Writes all that there is to say, which others keep; `leaves`: what they forget. Returns the size. */
RTS_UI32 MdnsAnnounce(const MDNS_DEVICE *device, bool leaves, RTS_UI8 *message);

typedef enum {
    MDNS_NO_CLASH,
    MDNS_TAKEN, /* another device has one of the names */
    MDNS_RACE,  /* another device asks for one at the same time, and has precedence */
} MDNS_CLASH;

/* Reads a message for names of the device that are another one's. `own_host`: it comes from the same machine, which may
 * have several addresses. */
MDNS_CLASH MdnsFindClash(const MDNS_DEVICE *device, const RTS_UI8 *message, RTS_UI32 size, bool own_host);

/* Copies a name as a label: cut to its size, at a whole character of UTF-8, control characters and what is not UTF-8 as '-'. With `number` above
 * 1 it is appended: "press (2)", for a host name "press-2". A host name keeps only letters, digits and '-'. */
void MdnsMakeLabel(char label[MDNS_LABEL_SIZE], const char *name, RTS_UI32 number, bool host);

#endif
