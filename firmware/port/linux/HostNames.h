/*
 * HostNames.h - looks up names of hosts while main does other things.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The C library waits for name servers for many seconds, so each question has a thread of its own. All from main.
 */
#ifndef HOSTNAMES_H
#define HOSTNAMES_H

#include "CmpErrors.h"
#include "CmpStd.h"

#include <netinet/in.h>

enum { HOST_MAX_ADDRESSES = 8 };

/* The addresses of a host, in the order in which the system would try them. */
typedef struct {
    struct sockaddr_in6 address[HOST_MAX_ADDRESSES]; /* has room for a sockaddr_in, by sin6_family */
    RTS_UI32 count;
} HOST_ADDRESSES;

/* Begins to look up a name, or an address in words; returns the number of the question, -1 if there is no room or no
 * thread. Connections go to `port`. */
int HostNameAsk(const char *host, RTS_UI16 port);

/* ERR_PENDING: not known yet. All else ends the question: ERR_OK, ERR_NO_OBJECT (no host has this name), ERR_TIMEOUT (no
 * name server replies). */
RTS_RESULT HostNameGet(int question, HOST_ADDRESSES *found);

/* The answer is not wanted any more. */
void HostNameForget(int question);

#endif
