/*
 * SysGpio.c - digital lines by the kernel's character devices, version 2 of their interface. Contract: SysGpio.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A line is "gpiochip1:17", "17" (of gpiochip0), or has the name that the kernel knows it by (gpioinfo shows them). The
 * lines of a group that are on one chip are one request to the kernel: read, and written, by one call. The kernel queues
 * edges; main, which waits for them (PortWait), posts the events.
 */
#define _GNU_SOURCE
#include "SysGpio.h"

#include "SchedEvents.h"
#include "port.h"
#include "rts_config.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { MAX_CHIPS = 32, EVENTS_AT_ONCE = 16 };

typedef struct {
    RTS_UI32 offset; /* on its chip */
    RTS_UI64 flags;  /* GPIO_V2_LINE_FLAG_* */
    RTS_HANDLE event;
    RTS_UI8 number; /* in the group */
} LINE;

/* The lines of a group on one chip. */
typedef struct {
    RTS_UI32 chip;
    RTS_UI32 count; /* 0: not in use */
    LINE line[IO_GPIO_LINES];
    PORT_SOURCE request; /* file -1: closed */
    RTS_UI64 outputs;    /* by index */
} REQUEST;

enum { CHIPS_OF_GROUP = 4 };
static REQUEST groups[IO_GPIO_GROUPS][CHIPS_OF_GROUP];

/* ---- names ---- */

static int open_chip(RTS_UI32 chip)
{
    char path[32];
    (void)snprintf(path, sizeof(path), "/dev/gpiochip%u", (unsigned)chip);
    return open(path, O_RDWR | O_CLOEXEC);
}

/* What the kernel says of a line; false when there is none. */
static bool get_info(int file, RTS_UI32 offset, struct gpio_v2_line_info *info)
{
    memset(info, 0, sizeof(*info));
    info->offset = offset;
    return ioctl(file, GPIO_V2_GET_LINEINFO_IOCTL, info) == 0;
}

/* By number; false when `name` is none. */
static bool parse(const char *name, RTS_UI32 *chip, RTS_UI32 *offset)
{
    unsigned numbers[2] = {0, 0};
    int length = 0;
    if (sscanf(name, "gpiochip%3u:%5u%n", &numbers[0], &numbers[1], &length) != 2 &&
        sscanf(name, "%5u%n", &numbers[1], &length) != 1) {
        return false;
    }
    *chip = numbers[0];
    *offset = numbers[1];
    return name[length] == '\0';
}

/* The line of a chip that has a name. */
static bool search_chip(RTS_UI32 chip, const char *name, struct gpio_v2_line_info *info)
{
    int file = open_chip(chip);
    bool found = false;
    for (RTS_UI32 offset = 0; file >= 0 && !found && get_info(file, offset, info); offset++) {
        found = strncmp(info->name, name, sizeof(info->name)) == 0;
    }
    if (file >= 0) {
        (void)close(file);
    }
    return found;
}

static bool find_line(const char *name, RTS_UI32 *chip, struct gpio_v2_line_info *info)
{
    RTS_UI32 offset;
    if (parse(name, chip, &offset)) {
        int file = open_chip(*chip);
        bool found = file >= 0 && get_info(file, offset, info);
        if (file >= 0) {
            (void)close(file);
        }
        return found;
    }
    for (*chip = 0; *chip < MAX_CHIPS && name[0] != '\0'; ++*chip) { /* lines without name have "" */
        if (search_chip(*chip, name, info)) {
            return true;
        }
    }
    return false;
}

/* ---- open and close ---- */

static RTS_UI64 flags_of(RTS_UI32 options)
{
    static const struct {
        RTS_UI32 option;
        RTS_UI64 flag;
    } table[] = {
        {GPIO_OPTION_PULL_UP, GPIO_V2_LINE_FLAG_BIAS_PULL_UP},
        {GPIO_OPTION_PULL_DOWN, GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN},
        {GPIO_OPTION_ACTIVE_LOW, GPIO_V2_LINE_FLAG_ACTIVE_LOW},
        {GPIO_OPTION_RISING, GPIO_V2_LINE_FLAG_EDGE_RISING},
        {GPIO_OPTION_FALLING, GPIO_V2_LINE_FLAG_EDGE_FALLING},
        {GPIO_OPTION_OPEN_DRAIN, GPIO_V2_LINE_FLAG_OPEN_DRAIN},
    };
    RTS_UI64 flags = options & GPIO_OPTION_OUT ? GPIO_V2_LINE_FLAG_OUTPUT : GPIO_V2_LINE_FLAG_INPUT;
    for (RTS_UI32 i = 0; i < RTS_COUNT(table); i++) {
        flags |= options & table[i].option ? table[i].flag : 0;
    }
    return flags;
}

static REQUEST *find_request(RTS_UI32 group, RTS_UI32 chip)
{
    REQUEST *request = groups[group];
    while (request < groups[group] + CHIPS_OF_GROUP && request->count > 0 && request->chip != chip) {
        request++;
    }
    return request < groups[group] + CHIPS_OF_GROUP ? request : NULL;
}

static bool has_line(RTS_UI32 chip, RTS_UI32 offset)
{
    for (RTS_UI32 group = 0; group < IO_GPIO_GROUPS; group++) {
        const REQUEST *request = find_request(group, chip);
        for (RTS_UI32 i = 0; request != NULL && i < request->count; i++) {
            if (request->line[i].offset == offset) {
                return true;
            }
        }
    }
    return false;
}

RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *line)
{
    struct gpio_v2_line_info info;
    RTS_UI32 chip;
    if (!find_line(line->name, &chip, &info)) {
        return ERR_NO_OBJECT;
    }
    if ((info.flags & GPIO_V2_LINE_FLAG_USED) != 0 || has_line(chip, info.offset)) {
        return ERR_OPERATION_DENIED;
    }
    if ((line->options & GPIO_OPTION_OUT) != 0 && (line->options & (GPIO_OPTION_RISING | GPIO_OPTION_FALLING)) != 0) {
        return ERR_NOT_SUPPORTED;
    }
    REQUEST *request = find_request(group, chip);
    if (request == NULL) {
        return ERR_NOMEMORY;
    }
    LINE *place = &request->line[request->count];
    *place = (LINE){info.offset, flags_of(line->options), line->event, (RTS_UI8)number};
    request->outputs |= (RTS_UI64)((line->options & GPIO_OPTION_OUT) != 0) << request->count;
    request->chip = chip;
    request->request.file = -1;
    request->count++;
    return ERR_OK;
}

/* The bits of the group for those of a request, and the other way. */
static RTS_UI64 to_request(const REQUEST *request, RTS_UI32 values)
{
    RTS_UI64 bits = 0;
    for (RTS_UI32 i = 0; i < request->count; i++) {
        bits |= (RTS_UI64)(values >> request->line[i].number & 1) << i;
    }
    return bits;
}

static RTS_UI32 from_request(const REQUEST *request, RTS_UI64 bits)
{
    RTS_UI32 values = 0;
    for (RTS_UI32 i = 0; i < request->count; i++) {
        values |= (RTS_UI32)(bits >> i & 1) << request->line[i].number;
    }
    return values;
}

/* Lines with the same flags share an attribute; false when there are more kinds than the kernel takes. */
static bool add_flags(struct gpio_v2_line_config *config, RTS_UI64 flags, RTS_UI32 index)
{
    RTS_UI32 i = 0;
    while (i < config->num_attrs && config->attrs[i].attr.flags != flags) {
        i++;
    }
    if (i == GPIO_V2_LINE_NUM_ATTRS_MAX - 1) { /* one is for the values */
        return false;
    }
    config->attrs[i].attr.id = GPIO_V2_LINE_ATTR_ID_FLAGS;
    config->attrs[i].attr.flags = flags;
    config->attrs[i].mask |= 1ULL << index;
    config->num_attrs += i == config->num_attrs;
    return true;
}

static RTS_RESULT ask_kernel(REQUEST *request, int chip, RTS_UI32 outputs)
{
    struct gpio_v2_line_request ask = {.num_lines = request->count, .consumer = "plcrt"};
    for (RTS_UI32 i = 0; i < request->count; i++) {
        ask.offsets[i] = request->line[i].offset;
        if (!add_flags(&ask.config, request->line[i].flags, i)) {
            return ERR_NOT_SUPPORTED;
        }
    }
    if (request->outputs != 0) {
        struct gpio_v2_line_config_attribute *values = &ask.config.attrs[ask.config.num_attrs++];
        values->attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
        values->attr.values = to_request(request, outputs) & request->outputs;
        values->mask = request->outputs;
    }
    if (ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &ask) != 0) {
        return errno == EBUSY ? ERR_OPERATION_DENIED : errno == EINVAL ? ERR_NOT_SUPPORTED : ERR_DEVICE;
    }
    (void)fcntl(ask.fd, F_SETFL, O_NONBLOCK);
    request->request = (PORT_SOURCE){ask.fd, POLLIN};
    return ERR_OK;
}

static bool has_edges(const REQUEST *request)
{
    for (RTS_UI32 i = 0; i < request->count; i++) {
        if ((request->line[i].flags & (GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING)) != 0) {
            return true;
        }
    }
    return false;
}

static RTS_RESULT open_request(REQUEST *request, RTS_UI32 outputs)
{
    int chip = open_chip(request->chip);
    if (chip < 0) {
        return ERR_DEVICE;
    }
    RTS_RESULT result = ask_kernel(request, chip, outputs);
    (void)close(chip);
    if (result == ERR_OK && has_edges(request) && !PortWaitAdd(&request->request)) {
        return ERR_NOMEMORY; /* the caller closes */
    }
    return result;
}

RTS_RESULT SysGpioOpen(RTS_UI32 group, RTS_UI32 outputs)
{
    RTS_RESULT result = ERR_OK;
    for (RTS_UI32 i = 0; i < CHIPS_OF_GROUP && result == ERR_OK; i++) {
        if (groups[group][i].count > 0) {
            result = open_request(&groups[group][i], outputs);
        }
    }
    if (result != ERR_OK) {
        SysGpioClose(group);
    }
    return result;
}

void SysGpioClose(RTS_UI32 group)
{
    for (RTS_UI32 i = 0; i < CHIPS_OF_GROUP; i++) {
        REQUEST *request = &groups[group][i];
        if (request->count > 0 && request->request.file >= 0) {
            PortWaitRemove(&request->request);
            (void)close(request->request.file);
        }
        request->count = 0;
        request->outputs = 0;
    }
}

/* ---- edges ---- */

static void post(const REQUEST *request, const struct gpio_v2_line_event *edge)
{
    for (RTS_UI32 i = 0; i < request->count; i++) {
        if (request->line[i].offset == edge->offset) {
            (void)SchedPostExternalEvent(request->line[i].event);
        }
    }
}

/* Of a chip that has gone poll says for ever that there is something to read. */
static RTS_RESULT post_edges(const REQUEST *request)
{
    struct gpio_v2_line_event edges[EVENTS_AT_ONCE];
    ssize_t size = read(request->request.file, edges, sizeof(edges));
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) {
        return ERR_OK;
    }
    if (size <= 0) {
        PortWaitRemove(&request->request);
        return ERR_DEVICE;
    }
    for (ssize_t i = 0; i < size / (ssize_t)sizeof(edges[0]); i++) {
        post(request, &edges[i]);
    }
    if (size == (ssize_t)sizeof(edges)) {
        PortWaitNotNow();
    }
    return ERR_OK;
}

RTS_RESULT SysGpioPoll(RTS_UI32 group)
{
    RTS_RESULT result = ERR_OK;
    for (RTS_UI32 i = 0; i < CHIPS_OF_GROUP; i++) {
        if (has_edges(&groups[group][i]) && post_edges(&groups[group][i]) != ERR_OK) {
            result = ERR_DEVICE;
        }
    }
    return result;
}

/* ---- values ---- */

RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values)
{
    *values = 0;
    for (RTS_UI32 i = 0; i < CHIPS_OF_GROUP && groups[group][i].count > 0; i++) {
        const REQUEST *request = &groups[group][i];
        struct gpio_v2_line_values lines = {0, (1ULL << request->count) - 1};
        if (ioctl(request->request.file, GPIO_V2_LINE_GET_VALUES_IOCTL, &lines) != 0) {
            return ERR_DEVICE;
        }
        *values |= from_request(request, lines.bits);
    }
    return ERR_OK;
}

RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values)
{
    for (RTS_UI32 i = 0; i < CHIPS_OF_GROUP && groups[group][i].count > 0; i++) {
        const REQUEST *request = &groups[group][i];
        struct gpio_v2_line_values lines = {to_request(request, values), to_request(request, mask) & request->outputs};
        if (lines.mask != 0 && ioctl(request->request.file, GPIO_V2_LINE_SET_VALUES_IOCTL, &lines) != 0) {
            return ERR_DEVICE;
        }
    }
    return ERR_OK;
}
