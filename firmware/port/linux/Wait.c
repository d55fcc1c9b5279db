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

bool PortWait(int timeout_ms)
{
    struct pollfd polled[PORT_MAX_SOURCES];
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
    return more || poll(polled, waiting.count, timeout_ms) > 0;
}
