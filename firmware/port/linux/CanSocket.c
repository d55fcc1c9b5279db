/*
 * CanSocket.c - SocketCAN: the CAN interfaces of the Linux kernel.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "CanSocket.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum { FILTERS = CAN_FILTERS, TOOLS_PRIORITY = 0, URGENT_PRIORITY = 6 };

/* ---- opening ---- */

static bool has_fd(int file, const char *interface)
{
    struct ifreq request;
    memset(&request, 0, sizeof(request));
    memcpy(request.ifr_name, interface, strlen(interface));
    bool known = ioctl(file, SIOCGIFMTU, &request) == 0;
    if (known && request.ifr_mtu < (int)CANFD_MTU) {
        errno = EPROTONOSUPPORT;
    }
    return known && request.ifr_mtu >= (int)CANFD_MTU;
}

static bool is_up(int file, const char *interface)
{
    struct ifreq request;
    memset(&request, 0, sizeof(request));
    memcpy(request.ifr_name, interface, strlen(interface));
    bool known = ioctl(file, SIOCGIFFLAGS, &request) == 0;
    if (known && (request.ifr_flags & IFF_UP) == 0) {
        errno = ENETDOWN;
    }
    return known && (request.ifr_flags & IFF_UP) != 0;
}

static bool set_up(int file, const char *interface, bool fd)
{
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    can_err_mask_t errors = CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_CRTL | CAN_ERR_CNT;
    int on = 1;
    return address.can_ifindex != 0 && is_up(file, interface) && (!fd || has_fd(file, interface)) &&
           (!fd || setsockopt(file, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on)) == 0) &&
           setsockopt(file, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors)) == 0 &&
           CanSocketSetFilters(file, NULL, 0) && bind(file, (struct sockaddr *)&address, sizeof(address)) == 0;
}

int CanSocketOpen(const char *interface, bool fd)
{
    int file = -1;
    errno = ENAMETOOLONG;
    if (strlen(interface) < IFNAMSIZ) {
        file = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    }
    if (file >= 0 && !set_up(file, interface, fd)) {
        int error = errno;
        close(file);
        errno = error;
        return -1;
    }
    return file;
}

bool CanSocketSetFilters(int file, const CAN_FILTER *filters, RTS_UI32 count)
{
    struct can_filter all[FILTERS];
    if (count > FILTERS) {
        return false;
    }
    for (RTS_UI32 i = 0; i < count; i++) {
        all[i].can_id = filters[i].id | (filters[i].extended ? CAN_EFF_FLAG : 0);
        all[i].can_mask = filters[i].mask | CAN_EFF_FLAG;
    }
    return setsockopt(file, SOL_CAN_RAW, CAN_RAW_FILTER, all, (socklen_t)(count * sizeof(all[0]))) == 0;
}

/* ---- frames ---- */

/* The queue of an interface (pfifo_fast) has bands: frames of 11 bits leave it before those of 29 bits. */
static void choose_band(int file, const CAN_FRAME *frame)
{
    static struct {
        int file;
        int priority;
    } last = {-1, 0};
    int priority = (frame->flags & CAN_FLAG_EXTENDED) != 0 ? TOOLS_PRIORITY : URGENT_PRIORITY;
    if (last.file != file || last.priority != priority) {
        (void)setsockopt(file, SOL_SOCKET, SO_PRIORITY, &priority, sizeof(priority));
        last.file = file;
        last.priority = priority;
    }
}

RTS_RESULT CanSocketSend(int file, const CAN_FRAME *frame)
{
    choose_band(file, frame);
    bool fd = (frame->flags & CAN_FLAG_FD) != 0;
    struct canfd_frame out = {.can_id = frame->id, .len = frame->size};
    out.can_id |= (frame->flags & CAN_FLAG_EXTENDED) != 0 ? CAN_EFF_FLAG : 0;
    out.can_id |= (frame->flags & CAN_FLAG_REMOTE) != 0 ? CAN_RTR_FLAG : 0;
    out.flags = (frame->flags & CAN_FLAG_FAST) != 0 ? CANFD_BRS : 0;
    memcpy(out.data, frame->data, frame->size);
    if (write(file, &out, fd ? CANFD_MTU : CAN_MTU) >= 0) {
        return ERR_OK;
    }
    return errno == EAGAIN || errno == ENOBUFS || errno == EINTR ? ERR_NOBUFFER : ERR_DEVICE;
}

/* An error frame of the kernel; data as in linux/can/error.h. */
static void take_error(const struct canfd_frame *in, CAN_STATE *state)
{
    RTS_UI8 controller = (in->can_id & CAN_ERR_CRTL) != 0 ? in->data[1] : 0;
    if ((in->can_id & CAN_ERR_BUSOFF) != 0) {
        state->bus = CAN_BUS_OFF;
    } else if ((in->can_id & CAN_ERR_RESTARTED) != 0 || (controller & CAN_ERR_CRTL_ACTIVE) != 0) {
        state->bus = CAN_BUS_ACTIVE;
    } else if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
        state->bus = CAN_BUS_PASSIVE;
    } else if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
        state->bus = CAN_BUS_WARNING;
    }
    state->lost += (controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
    if ((in->can_id & CAN_ERR_CNT) != 0) {
        state->tx_errors = in->data[6];
        state->rx_errors = in->data[7];
    }
}

static void take_frame(const struct canfd_frame *in, bool fd, CAN_FRAME *frame)
{
    bool extended = (in->can_id & CAN_EFF_FLAG) != 0;
    frame->id = in->can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame->flags = extended ? CAN_FLAG_EXTENDED : 0;
    frame->flags |= (in->can_id & CAN_RTR_FLAG) != 0 ? CAN_FLAG_REMOTE : 0;
    frame->flags |= fd ? CAN_FLAG_FD : 0;
    frame->flags |= fd && (in->flags & CANFD_BRS) != 0 ? CAN_FLAG_FAST : 0;
    frame->size = in->len < sizeof(frame->data) ? in->len : sizeof(frame->data);
    memcpy(frame->data, in->data, frame->size);
}

RTS_RESULT CanSocketReceive(int file, CAN_FRAME *frame, CAN_STATE *state)
{
    struct canfd_frame in;
    for (;;) {
        ssize_t size = read(file, &in, sizeof(in));
        if (size < 0) {
            return errno == EAGAIN || errno == EINTR ? ERR_NOTHING_TO_DO : ERR_DEVICE;
        }
        if (size != CAN_MTU && size != CANFD_MTU) {
            return ERR_DEVICE;
        }
        if ((in.can_id & CAN_ERR_FLAG) == 0) {
            take_frame(&in, size == CANFD_MTU, frame);
            return ERR_OK;
        }
        take_error(&in, state);
    }
}
