/*
 * test_linux_wait.c - main waits for all that was registered, and for nothing else.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A wait that something is to end has no limit of time: when it does not end, the test does not.
 */
#define _GNU_SOURCE
#include "port.h"
#include "rts_config.h"
#include "test.h"

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <unistd.h>

enum { FOR_EVER = -1, A_MOMENT = 1, PIPES = 3 };

static int ends[PIPES][2];
static PORT_SOURCE source[PIPES];

static void begin(void)
{
    for (int i = 0; i < PIPES; i++) {
        CHECK_EQUAL(pipe(ends[i]), 0);
        source[i] = (PORT_SOURCE){.file = ends[i][0], .events = POLLIN};
        CHECK(PortWaitAdd(&source[i]));
    }
}

static void end(void)
{
    for (int i = 0; i < PIPES; i++) {
        PortWaitRemove(&source[i]);
        close(ends[i][0]);
        close(ends[i][1]);
    }
}

static void put(int i)
{
    CHECK_EQUAL(write(ends[i][1], "x", 1), 1);
}

static void take(int i)
{
    char byte;
    CHECK_EQUAL(read(ends[i][0], &byte, 1), 1);
}

static void each_of_them_ends_the_wait(void)
{
    begin();
    for (int i = 0; i < PIPES; i++) {
        CHECK(!PortWait(A_MOMENT));
        put(i);
        CHECK(PortWait(FOR_EVER));
        take(i);
    }
    CHECK(!PortWait(A_MOMENT));
    end();
}

static void *put_later(void *pipe)
{
    put(*(const int *)pipe);
    return NULL;
}

static void a_wait_ends_while_it_goes_on(void)
{
    pthread_t thread;
    int last = PIPES - 1;
    begin();
    CHECK(pthread_create(&thread, NULL, put_later, &last) == 0);
    CHECK(PortWait(FOR_EVER));
    pthread_join(thread, NULL);
    end();
}

static void what_is_removed_or_has_no_file_does_not(void)
{
    begin();
    put(0);
    put(1);
    PortWaitRemove(&source[0]);
    source[1].file = -1;
    CHECK(!PortWait(A_MOMENT));
    put(2);
    CHECK(PortWait(FOR_EVER));
    take(2);
    source[1].file = ends[1][0]; /* it is back */
    CHECK(PortWait(FOR_EVER));
    end();
}

static void room_to_write_counts_while_it_is_asked_for(void)
{
    PORT_SOURCE writer;
    begin();
    writer = (PORT_SOURCE){.file = ends[0][1], .events = 0};
    CHECK(PortWaitAdd(&writer));
    CHECK(!PortWait(A_MOMENT));
    writer.events = POLLOUT;
    CHECK(PortWait(FOR_EVER));
    PortWaitRemove(&writer);
    end();
}

static void work_done_in_a_pass_ends_one_wait(void)
{
    begin();
    PortWaitNotNow();
    CHECK(PortWait(FOR_EVER));
    CHECK(!PortWait(A_MOMENT));
    end();
}

static void there_is_an_end_to_the_room(void)
{
    PORT_SOURCE many[PORT_MAX_SOURCES];
    begin();
    for (int i = 0; i < PORT_MAX_SOURCES; i++) {
        many[i] = (PORT_SOURCE){.file = -1};
        CHECK_EQUAL(PortWaitAdd(&many[i]), (i < PORT_MAX_SOURCES - PIPES));
    }
    CHECK(PortWaitAdd(&source[0])); /* is there */
    put(PIPES - 1);
    CHECK(PortWait(FOR_EVER));
    for (int i = 0; i < PORT_MAX_SOURCES; i++) {
        PortWaitRemove(&many[i]);
    }
    CHECK(PortWait(FOR_EVER)); /* those before them are still there */
    end();
}

int main(void)
{
    RUN(each_of_them_ends_the_wait);
    RUN(a_wait_ends_while_it_goes_on);
    RUN(what_is_removed_or_has_no_file_does_not);
    RUN(room_to_write_counts_while_it_is_asked_for);
    RUN(work_done_in_a_pass_ends_one_wait);
    RUN(there_is_an_end_to_the_room);
    return test_result();
}
