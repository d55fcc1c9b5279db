/*
 * wired_gpio.c - a GPIO chip of the Linux kernel whose lines are wired to each other, for a process that preloads this.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It is /dev/gpiochip0 with lines "L0" to "L15". WIRES in the environment says which input follows which output, and
 * after how many ms: "0>8 1>9:30"; an input without wire is low.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { LINES = 16, FILES = 1024, CHIP = 1, REQUESTS = 2, MAX_REQUESTS = 8 };

static struct {
    unsigned char file[FILES]; /* what a file is: CHIP, or REQUESTS + number */
    struct gpio_v2_line_request request[MAX_REQUESTS];
    unsigned requests;
    bool is_high[LINES];
    double since_ms[LINES];
} chip;

static double now_ms(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec / 1e6;
}

static void set_line(unsigned line, bool high)
{
    if (chip.is_high[line] == high)
        return;
    chip.is_high[line] = high;
    chip.since_ms[line] = now_ms();
}

/* The level at an input: that of the output, as it was before the delay. */
static bool level_of(unsigned line)
{
    const char *wires = getenv("WIRES");
    int length;
    unsigned from;
    unsigned to;

    for (; wires != NULL && sscanf(wires, " %u>%u%n", &from, &to, &length) == 2; wires += length) {
        unsigned delay_ms = 0;
        int more = 0;
        if (sscanf(wires + length, ":%u%n", &delay_ms, &more) == 1)
            length += more;
        if (to == line && from < LINES)
            return chip.is_high[from] != (now_ms() - chip.since_ms[from] < delay_ms);
    }
    return chip.is_high[line];
}

/* ---- what the kernel does ---- */

static int get_info(struct gpio_v2_line_info *info)
{
    if (info->offset >= LINES) {
        errno = EINVAL;
        return -1;
    }
    (void)snprintf(info->name, sizeof info->name, "L%u", info->offset);
    info->flags = 0;
    return 0;
}

static int get_lines(struct gpio_v2_line_request *ask)
{
    unsigned number = chip.requests++ % MAX_REQUESTS;

    ask->fd = open("/dev/null", O_RDWR | O_CLOEXEC);
    if (ask->fd < 0 || ask->fd >= FILES)
        return -1;
    chip.file[ask->fd] = (unsigned char)(REQUESTS + number);
    chip.request[number] = *ask;
    return 0;
}

static int get_values(const struct gpio_v2_line_request *request, struct gpio_v2_line_values *values)
{
    values->bits = 0;
    for (unsigned i = 0; i < request->num_lines; i++)
        values->bits |= (unsigned long long)level_of(request->offsets[i]) << i;
    return 0;
}

static int set_values(const struct gpio_v2_line_request *request, const struct gpio_v2_line_values *values)
{
    for (unsigned i = 0; i < request->num_lines; i++) {
        if ((values->mask >> i & 1) != 0)
            set_line(request->offsets[i], (values->bits >> i & 1) != 0);
    }
    return 0;
}

/* ---- what takes the place of the C library's ---- */

int open64(const char *path, int flags, ...)
{
    int (*real)(const char *, int, ...);
    mode_t mode = 0;
    int file;
    va_list arguments;

    *(void **)&real = dlsym(RTLD_NEXT, "open64");
    va_start(arguments, flags);
    if ((flags & O_CREAT) != 0)
        mode = va_arg(arguments, mode_t);
    va_end(arguments);
    if (strcmp(path, "/dev/gpiochip0") != 0)
        file = real(path, flags, mode);
    else
        file = real("/dev/null", O_RDWR | O_CLOEXEC);
    if (file >= 0 && file < FILES)
        chip.file[file] = strcmp(path, "/dev/gpiochip0") == 0 ? CHIP : 0;
    return file;
}

int ioctl(int file, unsigned long request, ...)
{
    int (*real)(int, unsigned long, ...);
    unsigned what = file >= 0 && file < FILES ? chip.file[file] : 0;
    void *arg;
    va_list arguments;

    va_start(arguments, request);
    arg = va_arg(arguments, void *);
    va_end(arguments);
    if (what == CHIP && request == GPIO_V2_GET_LINEINFO_IOCTL)
        return get_info(arg);
    if (what == CHIP && request == GPIO_V2_GET_LINE_IOCTL)
        return get_lines(arg);
    if (what >= REQUESTS && request == GPIO_V2_LINE_GET_VALUES_IOCTL)
        return get_values(&chip.request[what - REQUESTS], arg);
    if (what >= REQUESTS && request == GPIO_V2_LINE_SET_VALUES_IOCTL)
        return set_values(&chip.request[what - REQUESTS], arg);
    *(void **)&real = dlsym(RTLD_NEXT, "ioctl");
    return real(file, request, arg);
}
