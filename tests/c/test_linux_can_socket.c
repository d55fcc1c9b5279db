/*
 * test_linux_can_socket.c - frames and errors as a CAN interface of the kernel reports them, through a pair of sockets.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "CanSocket.h"
#include "test.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

static int kernel; /* its end */
static int line;
static CAN_STATE state;
static CAN_FRAME frame;

static void start(void)
{
    int ends[2];

    CHECK_EQUAL(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0);
    kernel = ends[0];
    line = ends[1];
    memset(&state, 0, sizeof(state));
    memset(&frame, 0, sizeof(frame));
}

static void end(void)
{
    close(kernel);
    close(line);
}

/* An error frame with these classes, details of the controller and counters. */
static void report(RTS_UI32 classes, RTS_UI8 controller, RTS_UI8 sent, RTS_UI8 received)
{
    struct can_frame error = {.can_id = CAN_ERR_FLAG | classes, .can_dlc = CAN_ERR_DLC};

    error.data[1] = controller;
    error.data[6] = sent;
    error.data[7] = received;
    CHECK_EQUAL(write(kernel, &error, CAN_MTU), CAN_MTU);
    CHECK_EQUAL(CanSocketReceive(line, &frame, &state), ERR_NOTHING_TO_DO);
}

static void the_state_of_the_bus_is_what_the_kernel_says_last(void)
{
    start();
    report(CAN_ERR_CRTL | CAN_ERR_CNT, CAN_ERR_CRTL_TX_WARNING, 100, 3);
    CHECK(state.bus == CAN_BUS_WARNING && state.tx_errors == 100 && state.rx_errors == 3);
    report(CAN_ERR_CRTL | CAN_ERR_CNT, CAN_ERR_CRTL_RX_PASSIVE, 0, 130);
    CHECK(state.bus == CAN_BUS_PASSIVE && state.tx_errors == 0 && state.rx_errors == 130);
    report(CAN_ERR_BUSOFF, 0, 7, 7);
    CHECK(state.bus == CAN_BUS_OFF && state.tx_errors == 0 && state.rx_errors == 130);
    report(CAN_ERR_RESTARTED, 0, 0, 0);
    CHECK_EQUAL(state.bus, CAN_BUS_ACTIVE);
    report(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, 0, 0);
    report(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, 0, 0);
    CHECK_EQUAL(state.bus, CAN_BUS_ACTIVE);
    end();
}

static void what_the_controller_lost_is_counted(void)
{
    start();
    report(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW, 0, 0);
    report(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW, 0, 0);
    CHECK_EQUAL(state.lost, 2);
    end();
}

static void a_frame_after_errors_arrives(void)
{
    struct can_frame error = {.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF, .can_dlc = CAN_ERR_DLC};
    struct can_frame data = {.can_id = CAN_EFF_FLAG | 0x1F400102, .can_dlc = 3, .data = {1, 2, 3}};

    start();
    CHECK_EQUAL(write(kernel, &error, CAN_MTU), CAN_MTU);
    CHECK_EQUAL(write(kernel, &data, CAN_MTU), CAN_MTU);
    CHECK_EQUAL(CanSocketReceive(line, &frame, &state), ERR_OK);
    CHECK(frame.id == 0x1F400102 && frame.flags == CAN_FLAG_EXTENDED && frame.size == 3);
    CHECK(memcmp(frame.data, data.data, 3) == 0 && state.bus == CAN_BUS_OFF);
    end();
}

static void what_is_sent_comes_back_the_same(void)
{
    static const CAN_FRAME sent[] = {
        {.id = 0x7FF, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}},
        {.id = 0x1FFFFFFF, .flags = CAN_FLAG_EXTENDED},
        {.id = 5, .flags = CAN_FLAG_REMOTE},
        {.id = 0x1F400102, .flags = CAN_FLAG_EXTENDED | CAN_FLAG_FD, .size = 64, .data = {9}},
        {.id = 1, .flags = CAN_FLAG_FD | CAN_FLAG_FAST, .size = 12, .data = {7}},
    };

    start();
    for (RTS_UI32 i = 0; i < RTS_COUNT(sent); i++) {
        CHECK_EQUAL(CanSocketSend(kernel, &sent[i]), ERR_OK);
        CHECK_EQUAL(CanSocketReceive(line, &frame, &state), ERR_OK);
        CHECK(frame.id == sent[i].id && frame.flags == sent[i].flags && frame.size == sent[i].size);
        CHECK_EQUAL(memcmp(frame.data, sent[i].data, sent[i].size), 0);
    }
    end();
}

static void what_is_no_frame_is_an_error_of_the_device(void)
{
    start();
    CHECK_EQUAL(CanSocketReceive(line, &frame, &state), ERR_NOTHING_TO_DO);
    CHECK_EQUAL(write(kernel, "1234567", 7), 7);
    CHECK_EQUAL(CanSocketReceive(line, &frame, &state), ERR_DEVICE);
    close(kernel);
    CHECK_EQUAL(CanSocketReceive(line, &frame, &state), ERR_DEVICE);
    close(line);
}

int main(void)
{
    RUN(the_state_of_the_bus_is_what_the_kernel_says_last);
    RUN(what_the_controller_lost_is_counted);
    RUN(a_frame_after_errors_arrives);
    RUN(what_is_sent_comes_back_the_same);
    RUN(what_is_no_frame_is_an_error_of_the_device);
    return test_result();
}
