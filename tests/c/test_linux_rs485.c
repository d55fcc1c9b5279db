/*
 * test_linux_rs485.c - SysCom on a line whose port drives the bus, and on one that hands over late: what the kernel is
 * asked, and drivers that cannot.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The linker leads the calls of the port here (--wrap): pseudo terminals have no direction.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "CmpLog.h"
#include "SysCom.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"
#include "test.h"

static struct {
    struct serial_rs485 has;   /* before it is asked */
    struct serial_rs485 asked; /* the last one */
    RTS_UI32 count;            /* how often */
    int error;                 /* it refuses with this one */
    RTS_UI32 never;            /* flags that it drops without saying so */
    struct serial_struct port; /* what it has, and is given */
    RTS_UI32 port_count;       /* how often it is given */
    int port_error;
} kernel;

static int fail(int error)
{
    errno = error;
    return -1;
}

static int set_rs485(struct serial_rs485 *rs485)
{
    kernel.asked = *rs485;
    kernel.count++;
    if (kernel.error != 0)
        return fail(kernel.error);
    rs485->flags &= ~kernel.never;
    return 0;
}

static int get_port(struct serial_struct *port)
{
    if (kernel.port_error == ENOTTY)
        return fail(ENOTTY);
    *port = kernel.port;
    return 0;
}

static int set_port(const struct serial_struct *port)
{
    kernel.port_count++;
    if (kernel.port_error != 0)
        return fail(kernel.port_error);
    kernel.port = *port;
    return 0;
}

int __real_ioctl(int file, unsigned long request, void *arg);
int __wrap_ioctl(int file, unsigned long request, void *arg);
int __wrap_ioctl(int file, unsigned long request, void *arg)
{
    if (request == TIOCSRS485)
        return set_rs485(arg);
    if (request == TIOCGSERIAL)
        return get_port(arg);
    if (request == TIOCSSERIAL)
        return set_port(arg);
    if (request != TIOCGRS485)
        return __real_ioctl(file, request, arg);
    if (kernel.error != 0)
        return fail(kernel.error);
    *(struct serial_rs485 *)arg = kernel.has;
    return 0;
}

static const SYSCOM_SETTINGS driven = {.baud = 19200, .parity = SYSCOM_PARITY_NONE, .stop_bits = 1, .rs485 = true};
static const SYSCOM_SETTINGS plain = {.baud = 19200, .parity = SYSCOM_PARITY_NONE, .stop_bits = 1};

static void begin(void)
{
    memset(&kernel, 0, sizeof kernel);
}

/* A pseudo terminal whose slave, *name, stands for the device. */
static int plug_in(const char **name)
{
    int end = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);

    CHECK(end >= 0 && grantpt(end) == 0 && unlockpt(end) == 0);
    *name = ptsname(end);
    return end;
}

/* Opens and closes a line like that. */
static RTS_RESULT try(const SYSCOM_SETTINGS *settings)
{
    const char *name;
    int end = plug_in(&name);
    RTS_UI32 line;
    RTS_RESULT result = SysComOpenPort(name, settings, &line);

    if (result == ERR_OK)
        SysComClose(line);
    close(end);
    return result;
}

static LOG_ENTRY entry;

/* Entries of the log with this text. */
static RTS_UI32 count_logged(const char *text)
{
    RTS_UI32 count = 0;

    for (RTS_UI32 handle = 1; LogGetEntry(handle, &entry) == ERR_OK; handle = entry.handle + 1)
        count += strstr(entry.text, text) != NULL;
    return count;
}

/* A name for devices that come and go. */
static const char *own_name(void)
{
    static char name[64];

    (void)snprintf(name, sizeof name, "/tmp/test_linux_rs485.%d", (int)getpid());
    (void)unlink(name);
    return name;
}

static int plug_in_as(const char *name)
{
    const char *pty;
    int end = plug_in(&pty);

    (void)unlink(name);
    CHECK_EQUAL(symlink(pty, name), 0);
    return end;
}

/* Uses the line until the kernel has been asked so often, 20 s at most. */
static void use_until_asked(RTS_UI32 line, RTS_UI32 count)
{
    RTS_I64 deadline = SysTimeGetNs() + 20000000000;
    RTS_UI8 byte;

    while (kernel.count < count && SysTimeGetNs() < deadline) {
        (void)SysComRead(line, &byte, 1);
        (void)PortWait(1);
    }
    CHECK_EQUAL(kernel.count, count);
}

/* ---- what the kernel is asked ---- */

static void rts_drives_the_bus_while_bytes_are_sent(void)
{
    begin();
    CHECK_EQUAL(try(&driven), ERR_OK);
    CHECK_EQUAL(kernel.count, 1);
    CHECK_EQUAL(kernel.asked.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
    CHECK_EQUAL(kernel.asked.delay_rts_before_send, 0);
    CHECK_EQUAL(kernel.asked.delay_rts_after_send, 0);
}

static void a_line_without_drive_is_left_as_it_is(void)
{
    begin();
    kernel.error = ENOTTY;
    CHECK_EQUAL(try(&plain), ERR_OK);
    CHECK_EQUAL(kernel.count, 0);
}

static void delays_and_termination_of_the_board_stay(void)
{
    begin();
    kernel.has.flags = SER_RS485_RTS_ON_SEND | SER_RS485_TERMINATE_BUS;
    kernel.has.delay_rts_before_send = 1;
    kernel.has.delay_rts_after_send = 2;
    CHECK_EQUAL(try(&driven), ERR_OK);
    CHECK_EQUAL(kernel.asked.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND | SER_RS485_TERMINATE_BUS);
    CHECK_EQUAL(kernel.asked.delay_rts_before_send, 1);
    CHECK_EQUAL(kernel.asked.delay_rts_after_send, 2);
}

static void a_board_whose_rts_is_low_while_it_sends_keeps_it(void)
{
    begin();
    kernel.has.flags = SER_RS485_RTS_AFTER_SEND;
    CHECK_EQUAL(try(&driven), ERR_OK);
    CHECK_EQUAL(kernel.asked.flags, SER_RS485_ENABLED | SER_RS485_RTS_AFTER_SEND);
}

static void levels_that_say_nothing_become_high_while_it_sends(void)
{
    begin();
    kernel.has.flags = SER_RS485_RTS_ON_SEND | SER_RS485_RTS_AFTER_SEND;
    CHECK_EQUAL(try(&driven), ERR_OK);
    CHECK_EQUAL(kernel.asked.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
}

static void own_bytes_are_not_heard(void)
{
    begin();
    kernel.has.flags = SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND | SER_RS485_RX_DURING_TX;
    CHECK_EQUAL(try(&driven), ERR_OK);
    CHECK_EQUAL(kernel.asked.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
}

static void hardware_that_needs_no_rts_may_say_so(void)
{
    begin();
    kernel.never = SER_RS485_RTS_ON_SEND;
    CHECK_EQUAL(try(&driven), ERR_OK);
}

static void a_device_that_comes_back_is_asked_again(void)
{
    const char *name = own_name();
    int end = plug_in_as(name);
    RTS_UI32 line;

    begin();
    CHECK_EQUAL(SysComOpenPort(name, &driven, &line), ERR_OK);
    close(end);
    end = plug_in_as(name);
    use_until_asked(line, 2);
    CHECK_EQUAL(kernel.asked.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
    CHECK_EQUAL(SysComWrite(line, (const RTS_UI8 *)"!", 1), 1);
    SysComClose(line);
    close(end);
    (void)unlink(name);
}

static void bytes_are_handed_over_at_once(void)
{
    begin();
    kernel.port = (struct serial_struct){.type = PORT_16550A, .flags = ASYNC_SKIP_TEST, .baud_base = 115200};
    CHECK_EQUAL(try(&plain), ERR_OK);
    CHECK_EQUAL(kernel.port_count, 1);
    CHECK_EQUAL(kernel.port.flags, ASYNC_SKIP_TEST | ASYNC_LOW_LATENCY);
    CHECK_EQUAL(kernel.port.type, PORT_16550A);
    CHECK_EQUAL(kernel.port.baud_base, 115200);
    CHECK_EQUAL(try(&plain), ERR_OK); /* it is so already */
    CHECK_EQUAL(kernel.port_count, 1);
}

/* ---- drivers that cannot ---- */

static void a_port_that_cannot_hand_over_at_once_is_used_all_the_same(void)
{
    static const int errors[] = {ENOTTY, EPERM, EINVAL, EIO};

    for (RTS_UI32 i = 0; i < RTS_COUNT(errors); i++) {
        begin();
        kernel.port_error = errors[i];
        CHECK_EQUAL(try(&plain), ERR_OK);
        CHECK_EQUAL(kernel.port.flags, 0);
        CHECK_EQUAL(try(&driven), ERR_OK);
    }
}

static const char why[] = "its driver cannot switch the direction of the bus (drive)";

static void check_refused(void)
{
    RTS_UI32 before = count_logged(why);

    CHECK_EQUAL(try(&driven), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(count_logged(why), before + 1);
}

static void a_driver_without_rs485_refuses_the_line(void)
{
    begin();
    kernel.error = ENOTTY;
    check_refused();
}

static void a_driver_that_does_not_take_the_flags_refuses_the_line(void)
{
    begin();
    kernel.error = EINVAL;
    check_refused();
}

static void a_driver_that_drops_the_request_without_saying_so_refuses_the_line(void)
{
    begin();
    kernel.never = SER_RS485_ENABLED;
    check_refused();
}

static void a_line_that_was_refused_is_free(void)
{
    begin();
    for (RTS_UI32 i = 0; i < 2 * PORT_MAX_BUS_LINES; i++) {
        kernel.error = ENOTTY;
        CHECK_EQUAL(try(&driven), ERR_NOT_SUPPORTED);
        kernel.error = 0;
        CHECK_EQUAL(try(&driven), ERR_OK);
    }
}

static void a_device_that_goes_away_meanwhile_is_waited_for(void)
{
    begin();
    kernel.error = EIO;
    CHECK_EQUAL(try(&driven), ERR_OK);
    CHECK_EQUAL(count_logged("is away: Input/output error"), 1);
}

static void a_device_that_comes_later_and_cannot_is_logged_once(void)
{
    const char *name = own_name();
    RTS_UI32 before = count_logged(why);
    RTS_UI32 line;
    int end;

    begin();
    CHECK_EQUAL(SysComOpenPort(name, &driven, &line), ERR_OK);
    kernel.error = ENOTTY;
    end = plug_in_as(name);
    use_until_asked(line, 1);
    CHECK_EQUAL(count_logged(why), before + 1);
    use_until_asked(line, 2);
    CHECK_EQUAL(count_logged(why), before + 1);
    SysComClose(line);
    close(end);
    (void)unlink(name);
}

static void the_line_of_tools_says_why(void)
{
    PORT_REASON reason = {"", false};
    const char *name;
    int end = plug_in(&name);

    begin();
    kernel.error = ENOTTY;
    CHECK(!PortComCheck(name, &driven, &reason));
    CHECK(strstr(reason.text, name) != NULL && strstr(reason.text, why) != NULL);
    kernel.error = 0;
    CHECK(PortComCheck(name, &driven, &reason));
    close(end);
}

int main(void)
{
    CHECK_EQUAL(SysTime_Hook(CH_INIT_SYSTEM), ERR_OK);
    CHECK_EQUAL(CmpLog_Hook(CH_INIT_SYSTEM), ERR_OK);
    RUN(rts_drives_the_bus_while_bytes_are_sent);
    RUN(a_line_without_drive_is_left_as_it_is);
    RUN(delays_and_termination_of_the_board_stay);
    RUN(a_board_whose_rts_is_low_while_it_sends_keeps_it);
    RUN(levels_that_say_nothing_become_high_while_it_sends);
    RUN(own_bytes_are_not_heard);
    RUN(hardware_that_needs_no_rts_may_say_so);
    RUN(a_device_that_comes_back_is_asked_again);
    RUN(bytes_are_handed_over_at_once);
    RUN(a_port_that_cannot_hand_over_at_once_is_used_all_the_same);
    RUN(a_driver_without_rs485_refuses_the_line);
    RUN(a_driver_that_does_not_take_the_flags_refuses_the_line);
    RUN(a_driver_that_drops_the_request_without_saying_so_refuses_the_line);
    RUN(a_line_that_was_refused_is_free);
    RUN(a_device_that_goes_away_meanwhile_is_waited_for);
    RUN(a_device_that_comes_later_and_cannot_is_logged_once);
    RUN(the_line_of_tools_says_why);
    return test_result();
}
