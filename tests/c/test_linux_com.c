/*
 * test_linux_com.c - SysCom: a pseudo terminal, and a device that goes away.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysCom.h"

#include "SysTime.h"
#include "port.h"
#include "rts_config.h"
#include "test.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

/* All values a byte can have: a line that is not raw would change or swallow some. */
static RTS_UI8 every_byte[256];

static void sleep_1ms(void)
{
    struct timespec time = {.tv_nsec = 1000000};
    nanosleep(&time, NULL);
}

/* A driver that keeps the speed it has without saying so, as many do: in place of the C library's. */
static bool speed_is_fixed;

int cfsetspeed(struct termios *settings, speed_t speed)
{
    speed_t taken = speed_is_fixed ? B9600 : speed;
    return cfsetispeed(settings, taken) == 0 ? cfsetospeed(settings, taken) : -1;
}

/* Reads from the runtime's side until there are `size` bytes, 10 s at most. */
static RTS_UI32 read_com(RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = 0;
    RTS_I64 deadline = SysTimeGetNs() + 10000000000;
    while (count < size && SysTimeGetNs() < deadline) {
        count += SysComRead(0, data + count, size - count);
        (void)PortWait(1);
    }
    return count;
}

/* The same from the client's side. */
static RTS_UI32 read_client(int client, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = 0;
    RTS_I64 deadline = SysTimeGetNs() + 10000000000;
    while (count < size && SysTimeGetNs() < deadline) {
        ssize_t now = read(client, data + count, size - count);
        count += now > 0 ? (RTS_UI32)now : 0;
        sleep_1ms();
    }
    return count;
}

static void check_round_trip(int client)
{
    RTS_UI8 back[256] = {0};
    CHECK_EQUAL(write(client, every_byte, sizeof(every_byte)), sizeof(every_byte));
    CHECK_EQUAL(read_com(back, sizeof(back)), sizeof(back));
    CHECK(memcmp(back, every_byte, sizeof(back)) == 0);
    memset(back, 0, sizeof(back));
    CHECK_EQUAL(SysComWrite(0, every_byte, sizeof(every_byte)), sizeof(every_byte));
    CHECK_EQUAL(read_client(client, back, sizeof(back)), sizeof(back));
    CHECK(memcmp(back, every_byte, sizeof(back)) == 0);
}

static void open_com(const char *path)
{
    PORT_REASON reason = {"", false};
    CHECK(PortComOpen(path, 115200, &reason));
    CHECK_EQUAL(SysComGetCount(), 1);
    CHECK_EQUAL(SysComOpen(0), ERR_OK);
}

static void close_com(void)
{
    SysComClose(0);
    PortComClose();
    CHECK_EQUAL(SysComGetCount(), 0);
}

static int open_client(const char *path)
{
    int client = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    CHECK(client >= 0);
    return client;
}

static void bytes_go_through_a_pty_unchanged(void)
{
    open_com("pty");
    int client = open_client(PortComPtyName());
    check_round_trip(client);
    close(client);
    close_com();
}

static void clients_of_a_pty_come_and_go(void)
{
    RTS_UI8 byte;
    open_com("pty");
    for (int i = 0; i < 3; i++) {
        int client = open_client(PortComPtyName());
        check_round_trip(client);
        close(client);
        CHECK_EQUAL(SysComRead(0, &byte, 1), 0);
    }
    close_com();
}

static void a_line_without_listener_never_blocks(void)
{
    RTS_UI32 sent = 0;
    RTS_UI32 taken;
    open_com("pty");
    do {
        taken = SysComWrite(0, every_byte, sizeof(every_byte));
        sent += taken;
    } while (taken > 0 && sent < 10000000);
    CHECK_EQUAL(taken, 0);
    (void)PortWait(1);
    int client = open_client(PortComPtyName());
    tcflush(client, TCIFLUSH);
    check_round_trip(client);
    close(client);
    close_com();
}

static void after_a_moved_byte_main_does_not_wait(void)
{
    open_com("pty");
    int client = open_client(PortComPtyName());
    RTS_UI8 byte;
    (void)PortWait(0); /* for what the tests before have moved */
    CHECK_EQUAL(SysComRead(0, &byte, 1), 0);
    CHECK(!PortWait(1));
    CHECK_EQUAL(SysComWrite(0, every_byte, sizeof(every_byte)), sizeof(every_byte));
    CHECK(PortWait(-1)); /* would wait for ever */
    CHECK(!PortWait(1));
    CHECK_EQUAL(write(client, "x", 1), 1);
    CHECK(PortWait(-1));
    CHECK(SysComRead(0, &byte, 1) == 1 && byte == 'x');
    CHECK(PortWait(-1));
    CHECK(!PortWait(1));
    close(client);
    close_com();
}

/* A pseudo terminal whose slave stands for a serial device, under a name of its own. Returns the other end. */
static int plug_in(const char *name)
{
    int end = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    CHECK(end >= 0 && grantpt(end) == 0 && unlockpt(end) == 0);
    unlink(name);
    CHECK_EQUAL(symlink(ptsname(end), name), 0);
    return end;
}

static void a_device_that_goes_away_is_taken_up_again(void)
{
    char folder[] = "/tmp/test_linux_com.XXXXXX";
    char name[64];
    RTS_UI8 byte;
    CHECK(mkdtemp(folder) != NULL);
    snprintf(name, sizeof(name), "%s/ttyX", folder);
    int end = plug_in(name);
    open_com(name);
    CHECK(PortComPtyName() == NULL);
    check_round_trip(end);
    close(end);
    CHECK_EQUAL(SysComRead(0, &byte, 1), 0);
    CHECK_EQUAL(SysComWrite(0, &byte, 1), 0);
    end = plug_in(name);
    RTS_I64 deadline = SysTimeGetNs() + 10000000000;
    while (SysComWrite(0, (const RTS_UI8 *)"!", 1) == 0 && SysTimeGetNs() < deadline) {
        sleep_1ms();
    }
    CHECK(read_client(end, &byte, 1) == 1 && byte == '!');
    check_round_trip(end);
    close(end);
    close_com();
    unlink(name);
    rmdir(folder);
}

static const SYSCOM_SETTINGS slow = {.baud = 1200, .parity = SYSCOM_PARITY_EVEN, .stop_bits = 2};

static const char *name_of_bus(void)
{
    static char name[64];
    snprintf(name, sizeof(name), "/tmp/test_linux_com.%d", (int)getpid());
    return name;
}

/* The settings of the slave of a pseudo terminal, through its other end. */
static struct termios settings_of(int end)
{
    struct termios found;
    CHECK_EQUAL(tcgetattr(end, &found), 0);
    return found;
}

static void a_line_of_a_field_bus_is_opened_by_name(void)
{
    const char *name = name_of_bus();
    RTS_UI8 data[4] = {0};
    RTS_UI32 line = 0;
    RTS_I64 before_ns;
    int end = plug_in(name);
    open_com("pty");
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_OK);
    CHECK(line >= SysComGetCount());
    struct termios found = settings_of(end);
    CHECK_EQUAL(cfgetospeed(&found), B1200);
    CHECK_EQUAL(SysComWrite(line, (const RTS_UI8 *)"ab", 2), 2);
    CHECK(read_client(end, data, 2) == 2 && memcmp(data, "ab", 2) == 0);
    before_ns = SysTimeGetNs();
    CHECK_EQUAL(write(end, "c", 1), 1);
    while (SysComRead(line, data, 1) == 0 && SysTimeGetNs() - before_ns < 10000000000) {
        (void)PortWait(1);
    }
    CHECK(SysComGetByteNs(line) >= before_ns && SysComGetByteNs(line) <= SysTimeGetNs());
    SysComClose(line);
    CHECK_EQUAL(SysComWrite(line, (const RTS_UI8 *)"d", 1), 0);
    close(end);
    close_com();
    unlink(name);
}

static void a_line_belongs_to_one_component(void)
{
    const char *name = name_of_bus();
    RTS_UI32 line = 0;
    RTS_UI32 other = 0;
    int end = plug_in(name);
    open_com(name);
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_DUPLICATE);
    close_com();
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_OK);
    CHECK_EQUAL(SysComOpenPort(name, &slow, &other), ERR_DUPLICATE);
    SysComClose(line);
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_OK);
    SysComClose(line);
    close(end);
    unlink(name);
}

/* A second name of the device: as udev gives it by vendor and number. */
static const char *add_link(const char *name)
{
    static char link[80];
    snprintf(link, sizeof(link), "%s.link", name);
    unlink(link);
    CHECK_EQUAL(symlink(name, link), 0);
    return link;
}

static void a_line_with_another_name_is_the_same(void)
{
    const char *name = name_of_bus();
    const char *link = add_link(name);
    RTS_UI32 line = 0;
    RTS_UI32 other = 0;
    int end = plug_in(name);
    open_com(name);
    CHECK_EQUAL(SysComOpenPort(link, &slow, &line), ERR_DUPLICATE);
    close_com();
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_OK);
    CHECK_EQUAL(SysComOpenPort(link, &slow, &other), ERR_DUPLICATE);
    SysComClose(line);
    CHECK_EQUAL(SysComOpenPort(link, &slow, &line), ERR_OK);
    SysComClose(line);
    close(end);
    unlink(name);
    unlink(link);
}

static void the_pseudo_terminal_of_the_tool_is_in_use(void)
{
    char own_name[64];
    RTS_UI32 line = 0;
    open_com("pty");
    snprintf(own_name, sizeof(own_name), "%s", PortComPtyName());
    CHECK_EQUAL(SysComOpenPort(own_name, &slow, &line), ERR_DUPLICATE);
    close_com();
}

static void a_line_that_carries_can_is_in_use(void)
{
    const PORT_CAN_OPTIONS options = {.node = 1, .base = 0x1F400000, .bit_rate = 500000};
    const char *name = name_of_bus();
    const char *link = add_link(name);
    char text[80];
    PORT_REASON reason = {"", false};
    RTS_UI32 line = 0;
    int end = plug_in(name);
    snprintf(text, sizeof(text), "slcan:%s", name);
    CHECK(PortCanOpen(text, &options, &reason));
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_DUPLICATE);
    CHECK_EQUAL(SysComOpenPort(link, &slow, &line), ERR_DUPLICATE);
    PortCanClose();
    CHECK(PortCanOpen("slcan:pty", &options, &reason));
    snprintf(text, sizeof(text), "%s", PortCanPtyName());
    CHECK_EQUAL(SysComOpenPort(text, &slow, &line), ERR_DUPLICATE);
    PortCanClose();
    close(end);
    unlink(name);
    unlink(link);
}

static void a_line_that_is_not_plugged_in_is_waited_for(void)
{
    const char *name = name_of_bus();
    RTS_UI8 byte;
    RTS_UI32 line = 0;
    unlink(name);
    CHECK_EQUAL(SysComOpenPort(name, &slow, &line), ERR_OK);
    CHECK_EQUAL(SysComRead(line, &byte, 1), 0);
    int end = plug_in(name);
    RTS_I64 deadline = SysTimeGetNs() + 10000000000;
    while (SysComWrite(line, (const RTS_UI8 *)"!", 1) == 0 && SysTimeGetNs() < deadline) {
        sleep_1ms();
    }
    CHECK(read_client(end, &byte, 1) == 1 && byte == '!');
    SysComClose(line);
    close(end);
    unlink(name);
}

static void a_line_that_cannot_run_like_that_is_refused(void)
{
    const SYSCOM_SETTINGS odd = {.baud = 12345, .parity = SYSCOM_PARITY_NONE, .stop_bits = 1};
    RTS_UI32 line = 0;
    CHECK_EQUAL(SysComOpenPort("/dev/ttyS0", &odd, &line), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(SysComOpenPort("", &slow, &line), ERR_NO_OBJECT);
}

/* What the other end has taken over (a page of a pseudo terminal) is gone; the rest never comes. */
static void what_is_discarded_does_not_arrive(void)
{
    const SYSCOM_SETTINGS settings = {19200, SYSCOM_PARITY_EVEN, 1, false};
    enum { PAGE = 4096 };
    RTS_UI8 page[PAGE] = {0};
    RTS_UI32 line, taken = 0, now, arrived = 0;
    int other = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);

    CHECK(other >= 0 && grantpt(other) == 0 && unlockpt(other) == 0);
    CHECK_EQUAL(SysComOpenPort(ptsname(other), &settings, &line), ERR_OK);
    while ((now = SysComWrite(line, page, PAGE)) != 0) {
        taken += now;
    }
    CHECK(taken > PAGE);
    SysComDiscard(line);
    for (RTS_UI32 i = 0; i < 100; i++) {
        ssize_t count = read(other, page, PAGE);
        arrived += count > 0 ? (RTS_UI32)count : 0;
        sleep_1ms();
    }
    CHECK(arrived <= PAGE);
    CHECK_EQUAL(SysComWrite(line, (const RTS_UI8 *)"new", 3), 3);
    CHECK_EQUAL(read_client(other, page, 3), 3);
    CHECK(memcmp(page, "new", 3) == 0);
    SysComClose(line);
    SysComDiscard(line);
    close(other);
}

static void what_cannot_be_opened_is_said(void)
{
    PORT_REASON reason = {"", false};
    CHECK(!PortComOpen("does-not-exist", 115200, &reason));
    CHECK(strstr(reason.text, "does-not-exist") != NULL);
    CHECK(PortComOpen("/dev/does-not-exist", 115200, &reason) && !PortComIsThere());
    PortComClose();
    CHECK(!PortComOpen("/dev/null", 115200, &reason));
    CHECK(!PortComOpen("pty", 12345, &reason));
    CHECK_EQUAL(SysComGetCount(), 0);
    CHECK_EQUAL(SysComOpen(0), ERR_DEVICE);
}

static void a_device_that_keeps_another_speed_is_refused(void)
{
    PORT_REASON reason = {"", false};
    speed_is_fixed = true;
    CHECK(!PortComOpen("pty", 115200, &reason));
    CHECK(strstr(reason.text, "115200 baud") != NULL);
    CHECK(PortComOpen("pty", 9600, &reason));
    speed_is_fixed = false;
    PortComClose();
}

static void a_device_that_another_program_uses_is_refused(void)
{
    PORT_REASON reason = {"", false};
    char name[64];
    int end = posix_openpt(O_RDWR | O_NOCTTY);
    CHECK(end >= 0 && grantpt(end) == 0 && unlockpt(end) == 0 && ptsname_r(end, name, sizeof(name)) == 0);
    int user = open(name, O_RDWR | O_NOCTTY);
    CHECK_EQUAL(flock(user, LOCK_EX | LOCK_NB), 0);
    CHECK(!PortComOpen(name, 9600, &reason));
    CHECK(strstr(reason.text, "busy") != NULL);
    close(user);
    CHECK(PortComOpen(name, 9600, &reason));
    user = open(name, O_RDWR | O_NOCTTY);
    CHECK(user < 0 || flock(user, LOCK_EX | LOCK_NB) != 0);
    close(user);
    PortComClose();
    close(end);
}

static void common_speeds_are_known(void)
{
    CHECK(PortComKnowsBaud(9600) && PortComKnowsBaud(115200) && PortComKnowsBaud(921600));
    CHECK(!PortComKnowsBaud(0) && !PortComKnowsBaud(115201));
}

static void a_line_that_does_not_exist_gives_nothing(void)
{
    RTS_UI8 byte = 0;
    open_com("pty");
    CHECK_EQUAL(SysComOpen(1), ERR_DEVICE);
    CHECK_EQUAL(SysComRead(1, &byte, 1), 0);
    CHECK_EQUAL(SysComWrite(1, &byte, 1), 0);
    close_com();
    CHECK_EQUAL(SysComRead(0, &byte, 1), 0);
}

/* A pseudo terminal with a link that only this process uses. */
static const char *link_path(void)
{
    static char path[128];
    const char *folder = getenv("TMPDIR");
    snprintf(path, sizeof(path), "pty:%s/test-linux-com-%d", folder != NULL ? folder : "/tmp", (int)getpid());
    return path;
}

static bool leads_to_a_pty(const char *link)
{
    char found[64] = "";
    return readlink(link, found, sizeof(found) - 1) > 0 && strncmp(found, "/dev/pts/", 9) == 0;
}

static void a_pty_has_the_name_of_its_link_while_it_is_open(void)
{
    const char *link = link_path() + strlen("pty:");
    open_com(link_path());
    CHECK(strcmp(PortComPtyName(), link) == 0);
    CHECK(leads_to_a_pty(link));
    int client = open_client(link);
    check_round_trip(client);
    close(client);
    close_com();
    CHECK_EQUAL(access(link, F_OK), -1);
}

static void a_link_left_by_a_killed_process_is_replaced(void)
{
    const char *link = link_path() + strlen("pty:");
    CHECK_EQUAL(symlink("/dev/pts/99999", link), 0);
    open_com(link_path());
    int client = open_client(link);
    close(client);
    close_com();
}

static void a_link_that_another_one_has_taken_is_left_to_it(void)
{
    const char *link = link_path() + strlen("pty:");
    open_com(link_path());
    CHECK_EQUAL(unlink(link), 0);
    CHECK_EQUAL(symlink("/dev/pts/99999", link), 0);
    close_com();
    CHECK(leads_to_a_pty(link));
    CHECK_EQUAL(unlink(link), 0);
}

static void no_other_file_is_replaced_by_a_link(void)
{
    PORT_REASON reason = {"", false};
    const char *path = link_path() + strlen("pty:");
    CHECK_EQUAL(symlink("/dev/null", path), 0);
    CHECK(!PortComOpen(link_path(), 9600, &reason));
    CHECK(strstr(reason.text, path) != NULL && strstr(reason.text, "name another path") != NULL);
    CHECK_EQUAL(SysComGetCount(), 0);
    CHECK_EQUAL(unlink(path), 0); /* still there */
    CHECK(!PortComOpen("pty:/does-not-exist/link", 9600, &reason));
    CHECK(strstr(reason.text, "/does-not-exist/link") != NULL);
}

int main(void)
{
    for (int i = 0; i < 256; i++) {
        every_byte[i] = (RTS_UI8)i;
    }
    CHECK_EQUAL(SysTime_Hook(CH_INIT_SYSTEM), ERR_OK);
    RUN(bytes_go_through_a_pty_unchanged);
    RUN(clients_of_a_pty_come_and_go);
    RUN(a_line_without_listener_never_blocks);
    RUN(after_a_moved_byte_main_does_not_wait);
    RUN(a_pty_has_the_name_of_its_link_while_it_is_open);
    RUN(a_link_left_by_a_killed_process_is_replaced);
    RUN(a_link_that_another_one_has_taken_is_left_to_it);
    RUN(no_other_file_is_replaced_by_a_link);
    RUN(a_device_that_goes_away_is_taken_up_again);
    RUN(a_line_of_a_field_bus_is_opened_by_name);
    RUN(a_line_belongs_to_one_component);
    RUN(a_line_with_another_name_is_the_same);
    RUN(the_pseudo_terminal_of_the_tool_is_in_use);
    RUN(a_line_that_carries_can_is_in_use);
    RUN(a_line_that_is_not_plugged_in_is_waited_for);
    RUN(a_line_that_cannot_run_like_that_is_refused);
    RUN(what_is_discarded_does_not_arrive);
    RUN(what_cannot_be_opened_is_said);
    RUN(a_device_that_keeps_another_speed_is_refused);
    RUN(a_device_that_another_program_uses_is_refused);
    RUN(common_speeds_are_known);
    RUN(a_line_that_does_not_exist_gives_nothing);
    return test_result();
}
