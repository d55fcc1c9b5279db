/*
 * Wait.c - what main waits for between two passes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"

#include <limits.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

static struct {
    const PORT_SOURCE *source[PORT_MAX_SOURCES];
    RTS_UI32 count;
    bool more;  /* work was done in this pass */
    bool hurry; /* a component wants the next pass before the time-out of its wait */
    int hurry_ms;
} waiting;

static RTS_UI32 find(const PORT_SOURCE *source)
{
    RTS_UI32 i = 0;
    while (i < waiting.count && waiting.source[i] != source) {
        i++;
    }
    return i;
}

bool PortWaitAdd(const PORT_SOURCE *source)
{
    RTS_UI32 place = find(source);
    if (place == PORT_MAX_SOURCES) {
        return false;
    }
    waiting.source[place] = source;
    waiting.count += place == waiting.count;
    return true;
}

void PortWaitRemove(const PORT_SOURCE *source)
{
    RTS_UI32 place = find(source);
    if (place < waiting.count) {
        waiting.source[place] = waiting.source[--waiting.count];
    }
}

void PortWaitNotNow(void)
{
    waiting.more = true;
}

void SysTimeWantPass(RTS_UI32 ms)
{
    int wanted_ms = ms < INT_MAX ? (int)ms : INT_MAX;
    waiting.hurry_ms = waiting.hurry && waiting.hurry_ms < wanted_ms ? waiting.hurry_ms : wanted_ms;
    waiting.hurry = true;
}

/* ---- threads that wait for main ---- */

static int nudge = -1; /* atomic */

void PortWaitNudge(void)
{
    const uint64_t one = 1;
    int file = __atomic_load_n(&nudge, __ATOMIC_ACQUIRE);
    if (file >= 0) {
        (void)!write(file, &one, sizeof(one));
    }
}

/* What poll looks at for it, in its last place. */
static void poll_nudge(struct pollfd *polled)
{
    if (nudge < 0) {
        __atomic_store_n(&nudge, eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), __ATOMIC_RELEASE);
    }
    polled->fd = nudge;
    polled->events = POLLIN;
}

static void take_nudge(const struct pollfd *polled)
{
    uint64_t count;
    if ((polled->revents & POLLIN) != 0) {
        (void)!read(polled->fd, &count, sizeof(count));
    }
}

bool PortWait(int timeout_ms)
{
    struct pollfd polled[PORT_MAX_SOURCES + 1];
    bool more = waiting.more;
    if (waiting.hurry && (timeout_ms < 0 || waiting.hurry_ms < timeout_ms)) {
        timeout_ms = waiting.hurry_ms;
    }
    waiting.hurry = false;
    waiting.more = false;
    for (RTS_UI32 i = 0; i < waiting.count; i++) {
        polled[i].fd = waiting.source[i]->file; /* poll passes over a negative one */
        polled[i].events = waiting.source[i]->events;
    }
    poll_nudge(&polled[waiting.count]);
    if (more) {
        return true;
    }
    if (poll(polled, waiting.count + 1, timeout_ms) <= 0) {
        return false;
    }
    take_nudge(&polled[waiting.count]);
    return true;
}
