/*
 * test_linux_gpio.c - SysGpio on what the kernel says and is asked: names, taken lines, flags, values, edges.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The linker leads the calls of the port here (--wrap). There are two chips with four lines each; those of the second one
 * have names, "L0" to "L3".
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "CmpChecksum.h"
#include "SchedEvents.h"
#include "SysGpio.h"
#include "port.h"
#include "test.h"

enum { CHIPS = 2, LINES = 4, FILES = 64, NO_CHIP = 0, CHIP = 1, REQUEST = 1 + CHIPS };

static struct {
    RTS_UI8 file[FILES]; /* what a file is: CHIP + number, REQUEST + number */
    bool is_used;        /* line 3 of both chips is another's */
    bool is_taken;       /* another process takes what is asked for just before */
    bool is_gone;
    struct gpio_v2_line_request asked[CHIPS];
    struct gpio_v2_line_values written[CHIPS];
    RTS_UI64 levels[CHIPS];
    int edges; /* where they are written to */
    int error; /* that reading edges ends with */
} kernel;

static int new_file(int file, RTS_UI32 what)
{
    kernel.file[file] = (RTS_UI8)what;
    return file;
}

int __real_open64(const char *path, int flags, ...);
int __wrap_open64(const char *path, int flags, ...);
int __wrap_open64(const char *path, int flags, ...)
{
    unsigned chip;

    if (sscanf(path, "/dev/gpiochip%u", &chip) != 1)
        return __real_open64(path, flags);
    if (chip < CHIPS && !kernel.is_gone)
        return new_file(__real_open64("/dev/null", flags), CHIP + chip);
    errno = ENOENT;
    return -1;
}

static int fail(int error)
{
    errno = error;
    return -1;
}

static int get_info(RTS_UI32 chip, struct gpio_v2_line_info *info)
{
    if (info->offset >= LINES)
        return fail(EINVAL);
    if (chip == 1)
        (void)snprintf(info->name, sizeof info->name, "L%u", info->offset);
    info->flags = info->offset == 3 && kernel.is_used ? GPIO_V2_LINE_FLAG_USED : 0;
    return 0;
}

/* Attributes that are not counted; the kernel of Debian 12 looks at them. */
static bool are_unused_zero(const struct gpio_v2_line_config *config)
{
    static const struct gpio_v2_line_config_attribute zero;
    RTS_UI32 i = config->num_attrs;

    while (i < GPIO_V2_LINE_NUM_ATTRS_MAX && memcmp(&config->attrs[i], &zero, sizeof zero) == 0)
        i++;
    return i == GPIO_V2_LINE_NUM_ATTRS_MAX;
}

static int get_lines(RTS_UI32 chip, struct gpio_v2_line_request *ask)
{
    int ends[2];

    if (kernel.is_taken)
        return fail(EBUSY);
    if (!are_unused_zero(&ask->config))
        return fail(EINVAL);
    kernel.asked[chip] = *ask;
    if (pipe(ends) != 0)
        return fail(EMFILE);
    kernel.edges = ends[1];
    ask->fd = new_file(ends[0], REQUEST + chip);
    return 0;
}

int __wrap_ioctl(int file, unsigned long request, void *arg);
int __wrap_ioctl(int file, unsigned long request, void *arg)
{
    RTS_UI32 chip = (kernel.file[file] - CHIP) % CHIPS;

    if (kernel.is_gone)
        return fail(ENODEV);
    switch (request) {
    case GPIO_V2_GET_LINEINFO_IOCTL:
        return get_info(chip, arg);
    case GPIO_V2_GET_LINE_IOCTL:
        return get_lines(chip, arg);
    case GPIO_V2_LINE_GET_VALUES_IOCTL:
        ((struct gpio_v2_line_values *)arg)->bits = kernel.levels[chip];
        return 0;
    case GPIO_V2_LINE_SET_VALUES_IOCTL:
        kernel.written[chip] = *(struct gpio_v2_line_values *)arg;
        return 0;
    default:
        return fail(ENOTTY);
    }
}

/* Of lines of a chip that has gone: poll says that there is something, read what. */
ssize_t __real_read(int file, void *to, size_t size);
ssize_t __wrap_read(int file, void *to, size_t size);
ssize_t __wrap_read(int file, void *to, size_t size)
{
    if (kernel.error != 0 && file >= 0 && file < FILES && kernel.file[file] >= REQUEST)
        return fail(kernel.error);
    return __real_read(file, to, size);
}

static void pull(void)
{
    kernel.is_gone = true;
    kernel.error = ENODEV;
    (void)close(kernel.edges);
}

static RTS_RESULT add(RTS_UI32 number, const char *name, RTS_UI32 options)
{
    SYS_GPIO_LINE line = {name, options, RTS_INVALID_HANDLE};

    return SysGpioAdd(0, number, &line);
}

static void begin(void)
{
    SysGpioClose(0);
    memset(&kernel, 0, sizeof kernel);
}

static void lines_have_numbers_and_names(void)
{
    begin();
    CHECK_EQUAL(add(0, "2", 0), ERR_OK);
    CHECK_EQUAL(add(1, "gpiochip1:0", 0), ERR_OK);
    CHECK_EQUAL(add(2, "L2", 0), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    CHECK_EQUAL(kernel.asked[0].num_lines, 1);
    CHECK_EQUAL(kernel.asked[0].offsets[0], 2);
    CHECK_EQUAL(kernel.asked[1].num_lines, 2);
    CHECK(kernel.asked[1].offsets[0] == 0 && kernel.asked[1].offsets[1] == 2);
    CHECK(strcmp(kernel.asked[1].consumer, "plcrt") == 0);
}

static void lines_that_are_not_there(void)
{
    begin();
    CHECK_EQUAL(add(0, "4", 0), ERR_NO_OBJECT);
    CHECK_EQUAL(add(0, "gpiochip2:0", 0), ERR_NO_OBJECT);
    CHECK_EQUAL(add(0, "gpiochip0:x", 0), ERR_NO_OBJECT);
    CHECK_EQUAL(add(0, "L4", 0), ERR_NO_OBJECT);
    CHECK_EQUAL(add(0, "", 0), ERR_NO_OBJECT);
}

static void lines_that_are_taken(void)
{
    begin();
    kernel.is_used = true;
    CHECK_EQUAL(add(0, "L3", 0), ERR_OPERATION_DENIED);
    CHECK_EQUAL(add(0, "L1", 0), ERR_OK);
    CHECK_EQUAL(add(1, "gpiochip1:1", 0), ERR_OPERATION_DENIED); /* the same line */
    kernel.is_taken = true;
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OPERATION_DENIED);
}

/* The flags that the kernel was asked to give a line. */
static RTS_UI64 flags_of(RTS_UI32 chip, RTS_UI32 index)
{
    const struct gpio_v2_line_config *config = &kernel.asked[chip].config;
    RTS_UI32 i;

    for (i = 0; i < config->num_attrs; i++) {
        if (config->attrs[i].attr.id == GPIO_V2_LINE_ATTR_ID_FLAGS && (config->attrs[i].mask >> index & 1) != 0)
            return config->attrs[i].attr.flags;
    }
    return 0;
}

static void options_become_flags(void)
{
    begin();
    CHECK_EQUAL(add(0, "0", GPIO_OPTION_PULL_UP | GPIO_OPTION_ACTIVE_LOW), ERR_OK);
    CHECK_EQUAL(add(1, "1", GPIO_OPTION_OUT | GPIO_OPTION_OPEN_DRAIN), ERR_OK);
    CHECK_EQUAL(add(2, "2", GPIO_OPTION_RISING | GPIO_OPTION_FALLING), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 2), ERR_OK);
    CHECK_EQUAL(flags_of(0, 0),
                GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_BIAS_PULL_UP | GPIO_V2_LINE_FLAG_ACTIVE_LOW);
    CHECK_EQUAL(flags_of(0, 1), GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_OPEN_DRAIN);
    CHECK_EQUAL(flags_of(0, 2),
                GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING);
    /* outputs get their value with the request, so there is no pulse */
    CHECK_EQUAL(kernel.asked[0].config.attrs[3].attr.id, GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES);
    CHECK(kernel.asked[0].config.attrs[3].attr.values == 2 && kernel.asked[0].config.attrs[3].mask == 2);
}

static void values_are_those_of_the_numbers(void)
{
    RTS_UI32 values = 0;

    begin();
    CHECK_EQUAL(add(7, "1", 0), ERR_OK);
    CHECK_EQUAL(add(3, "L0", GPIO_OPTION_OUT), ERR_OK);
    CHECK_EQUAL(add(31, "L1", GPIO_OPTION_OUT), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    kernel.levels[0] = 1; /* by the order of adding */
    kernel.levels[1] = 2;
    CHECK_EQUAL(SysGpioRead(0, &values), ERR_OK);
    CHECK_EQUAL(values, 0x80000080u);
    CHECK_EQUAL(SysGpioWrite(0, 0xFFFFFFFF, 0x00000008), ERR_OK);
    CHECK(kernel.written[1].bits == 1 && kernel.written[1].mask == 3);
    CHECK_EQUAL(kernel.written[0].mask, 0); /* an input */
}

static void a_chip_that_has_gone(void)
{
    RTS_UI32 values;

    begin();
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_OUT), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    kernel.is_gone = true;
    CHECK_EQUAL(SysGpioRead(0, &values), ERR_DEVICE);
    CHECK_EQUAL(SysGpioWrite(0, 1, 1), ERR_DEVICE);
    SysGpioClose(0);
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_OUT), ERR_NO_OBJECT);
    kernel.is_gone = false;
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_OUT), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 1), ERR_OK);
}

static void edges_are_taken_from_the_kernel(void)
{
    struct gpio_v2_line_event edge = {.offset = 1, .id = GPIO_V2_LINE_EVENT_RISING_EDGE};
    char byte;
    int i;

    begin();
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_RISING), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    CHECK_EQUAL(SysGpioPoll(0), ERR_OK); /* nothing there: it does not wait */
    for (i = 0; i < 20; i++)
        CHECK_EQUAL(write(kernel.edges, &edge, sizeof edge), (long)sizeof edge);
    CHECK_EQUAL(SysGpioPoll(0), ERR_OK);
    CHECK_EQUAL(SysGpioPoll(0), ERR_OK);
    CHECK(PortWait(0)); /* that was as many as are taken at once */
    (void)close(kernel.edges);
    for (i = 0; i < FILES && kernel.file[i] != REQUEST; i++) {
    }
    CHECK_EQUAL(read(i, &byte, 1), 0); /* all are taken */
}

static void a_chip_with_edges_that_has_gone_keeps_main_no_more_busy(void)
{
    const struct gpio_v2_line_event edge = {.offset = 1, .id = GPIO_V2_LINE_EVENT_RISING_EDGE};

    begin();
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_RISING), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    CHECK(!PortWait(0));
    pull();
    CHECK(PortWait(0));
    CHECK_EQUAL(SysGpioPoll(0), ERR_DEVICE);
    CHECK(!PortWait(0));
    SysGpioClose(0);
    kernel.is_gone = false;
    kernel.error = 0;
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_RISING), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    CHECK_EQUAL(write(kernel.edges, &edge, sizeof edge), (long)sizeof edge);
    CHECK(PortWait(0));
    CHECK_EQUAL(SysGpioPoll(0), ERR_OK);
    CHECK(!PortWait(0));
}

static void what_may_pass_is_no_lost_chip(void)
{
    static const int errors[] = {EAGAIN, EINTR};
    RTS_UI32 i;

    begin();
    CHECK_EQUAL(add(0, "1", GPIO_OPTION_RISING), ERR_OK);
    CHECK_EQUAL(SysGpioOpen(0, 0), ERR_OK);
    for (i = 0; i < RTS_COUNT(errors); i++) {
        kernel.error = errors[i];
        CHECK_EQUAL(SysGpioPoll(0), ERR_OK);
    }
}

int main(void)
{
    RUN(lines_have_numbers_and_names);
    RUN(lines_that_are_not_there);
    RUN(lines_that_are_taken);
    RUN(options_become_flags);
    RUN(values_are_those_of_the_numbers);
    RUN(a_chip_that_has_gone);
    RUN(edges_are_taken_from_the_kernel);
    RUN(a_chip_with_edges_that_has_gone_keeps_main_no_more_busy);
    RUN(what_may_pass_is_no_lost_chip);
    return test_result();
}
