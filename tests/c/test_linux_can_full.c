/*
 * test_linux_can_full.c - SysCan on an interface of the kernel whose queue is full: main looks again soon, and only as
 * long as there is something to send.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The linker leads the calls of the port here (--wrap): there need not be CAN in this kernel. A wait without a limit of
 * time is one that something is to end: when it does not end, the test does not.
 */
#define _GNU_SOURCE
#include "CanSocket.h"
#include "CmpSrvNumbers.h"
#include "port.h"
#include "test.h"

#include <sys/socket.h>
#include <unistd.h>

enum { FOR_EVER = -1, A_MOMENT = 1 };

static const CAN_FRAME frame = {.id = 0x1F400102, .flags = CAN_FLAG_EXTENDED, .size = 1};
static int kernel;   /* the other end of the socket, which always has room */
static bool is_full; /* the queue of the interface */

int __wrap_CanSocketOpen(const char *interface, bool fd);
int __wrap_CanSocketOpen(const char *interface, bool fd)
{
    int ends[2];

    RTS_UNUSED(interface);
    RTS_UNUSED(fd);
    CHECK_EQUAL(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0);
    kernel = ends[0];
    return ends[1];
}

bool __wrap_CanSocketSetFilters(int file, const CAN_FILTER *filters, RTS_UI32 count);
bool __wrap_CanSocketSetFilters(int file, const CAN_FILTER *filters, RTS_UI32 count)
{
    RTS_UNUSED(file);
    RTS_UNUSED(filters);
    RTS_UNUSED(count);
    return true;
}

RTS_RESULT __real_CanSocketSend(int file, const CAN_FRAME *sent);
RTS_RESULT __wrap_CanSocketSend(int file, const CAN_FRAME *sent);
RTS_RESULT __wrap_CanSocketSend(int file, const CAN_FRAME *sent)
{
    return is_full ? (RTS_RESULT)ERR_NOBUFFER : __real_CanSocketSend(file, sent);
}

static void begin(void)
{
    const PORT_CAN_OPTIONS options = {.node = 1, .base = CAN_ID_BASE, .bit_rate = 500000};
    PORT_REASON reason;

    is_full = false;
    CHECK(PortCanOpen("can0", &options, &reason));
    CHECK_EQUAL(SysCanOpen(0, 0, 0), ERR_OK);
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_OK);
    (void)PortWait(0); /* after what was sent */
}

static void end(void)
{
    SysCanClose(0);
    PortCanClose();
    close(kernel);
}

static void a_frame_that_has_no_room_is_tried_again_soon(void)
{
    begin();
    is_full = true;
    for (int i = 0; i < 3; i++) {
        CHECK_EQUAL(SysCanSend(0, &frame), ERR_NOBUFFER);
        CHECK(!PortWait(FOR_EVER));
    }
    is_full = false;
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_OK);
    end();
}

/* The cable is cut, and the packet is given up: nothing is sent until the bus is back. */
static void a_frame_that_is_given_up_costs_nothing(void)
{
    begin();
    is_full = true;
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_NOBUFFER);
    (void)PortWait(A_MOMENT);
    for (int i = 0; i < 3; i++)
        CHECK(!PortWait(A_MOMENT));
    end();
}

int main(void)
{
    RUN(a_frame_that_has_no_room_is_tried_again_soon);
    RUN(a_frame_that_is_given_up_costs_nothing);
    return test_result();
}
