/*
 * test_linux_sysfs.c - IoDrvSysfs on a folder that looks like the kernel's: analog values, PWM, what is missing or pulled.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The threads of the driver are real, the cycles of the program are on virtual time: a test lets cycles pass until the
 * other side has done its part. The linker leads what the threads write, and the wait for their end, here (--wrap): a
 * slow device is one whose writes wait until the test lets them go on. So it does with the lock, which the simulator,
 * without other threads, does not need.
 */
#define _GNU_SOURCE
#include "../../firmware/port/linux/SysfsFiles.h"
#include "SysAtomic.h"
#include "io_driver.h"

#include <ftw.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { EVERY_MS = 1, TRIES = 5000, STATE = 16 };

static char root[] = "/tmp/test_linux_sysfs.XXXXXX";
static APP_REFUSAL refusal;

static const char *path_of(const char *name)
{
    static char path[256];

    (void)snprintf(path, sizeof path, "%s/%s", root, name);
    return path;
}

static void move(const char *from, const char *to)
{
    char path[256];

    (void)snprintf(path, sizeof path, "%s/%s", root, from);
    CHECK_EQUAL(rename(path, path_of(to)), 0);
}

/* A file that comes into being as a whole, as the kernel's are. */
static void put(const char *name, const char *text)
{
    FILE *file = fopen(path_of("new"), "w");

    CHECK(file != NULL && fputs(text, file) >= 0 && fclose(file) == 0);
    move("new", name);
}

static double get(const char *name)
{
    FILE *file = fopen(path_of(name), "r");
    double number = -1;

    if (file != NULL && fscanf(file, "%lf", &number) != 1)
        number = -1;
    if (file != NULL)
        (void)fclose(file);
    return number;
}

static void make_folder(const char *name)
{
    (void)mkdir(path_of(name), 0777);
}

#define IIO "bus/iio/devices/iio:device3/"
#define CHIP "class/pwm/pwmchip0/"

static void make_tree(void)
{
    static const char *const folders[] = {"bus", "bus/iio", "bus/iio/devices", "class", "class/pwm"};
    static bool is_made;
    RTS_UI32 i;

    if (!is_made)
        CHECK(mkdtemp(root) != NULL);
    is_made = true;
    for (i = 0; i < RTS_COUNT(folders); i++)
        make_folder(folders[i]);
    make_folder(IIO);
    make_folder(CHIP);
    make_folder(CHIP "pwm1");
    put(IIO "name", "ads1115\n");
    put(IIO "in_voltage0_raw", "100\n");
    put(IIO "in_voltage1_raw", "-7\n");
    put(IIO "in_voltage_scale", "0.125\n");
    put(IIO "in_voltage0_offset", "20\n");
    put(IIO "out_voltage0_raw", "0\n");
    put(IIO "out_voltage0_scale", "0.5\n");
    put(CHIP "npwm", "2\n");
    put(CHIP "pwm1/period", "0\n");
    put(CHIP "pwm1/duty_cycle", "0\n");
    put(CHIP "pwm1/enable", "0\n");
}

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;

RTS_UI32 __wrap_SysLockEnter(void);
RTS_UI32 __wrap_SysLockEnter(void)
{
    CHECK_EQUAL(pthread_mutex_lock(&mutex), 0);
    return 0;
}

void __wrap_SysLockLeave(RTS_UI32 before);
void __wrap_SysLockLeave(RTS_UI32 before)
{
    RTS_UNUSED(before);
    CHECK_EQUAL(pthread_mutex_unlock(&mutex), 0);
}

/* ---- a slow device ---- */

static struct {
    RTS_UI32 is_slow;
    RTS_UI32 waiting; /* writes that have begun */
    RTS_UI32 both;    /* there were two at a time */
    RTS_UI32 fails;   /* so many next writes */
} bus;

bool __real_SysfsWrite(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 value);
bool __wrap_SysfsWrite(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 value);
bool __wrap_SysfsWrite(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 value)
{
    if (SysAtomicAdd(&bus.waiting, 1) > 0)
        SysAtomicStore(&bus.both, 1);
    while (SysAtomicLoad(&bus.is_slow) != 0)
        (void)nanosleep(&(struct timespec){0, 1000000}, NULL);
    (void)SysAtomicAdd(&bus.waiting, (RTS_UI32)-1);
    if (SysAtomicLoad(&bus.fails) > 0) {
        (void)SysAtomicAdd(&bus.fails, (RTS_UI32)-1);
        return false;
    }
    return __real_SysfsWrite(setup, n, folder, value);
}

/* The runtime waits for the threads only at its end; they wait for each round. */
int __real_poll(struct pollfd *files, nfds_t count, int ms);
int __wrap_poll(struct pollfd *files, nfds_t count, int ms);
int __wrap_poll(struct pollfd *files, nfds_t count, int ms)
{
    if (gettid() == getpid())
        SysAtomicStore(&bus.is_slow, 0);
    return __real_poll(files, count, ms);
}

static RTS_UI32 bits_of(float number)
{
    RTS_UI32 bits;

    memcpy(&bits, &number, sizeof bits);
    return bits;
}

static void add_device(const char *name, const char *device, RTS_UI32 kind)
{
    io_add_connector(&io, name, "IoDrvSysfs")->state = STATE;
    io_add_text_parameter(&io, SYSFS_DEVICE, device);
    io_add_parameter(&io, SYSFS_KIND, 8, kind);
    io_add_parameter(&io, SYSFS_EVERY, 32, EVERY_MS);
}

static void begin_kernel(void)
{
    make_tree();
    begin_io();
    SysfsSetRoot(root);
    CHECK_EQUAL(IoDrvSysfs_Hook(CH_INIT2), ERR_OK);
    io_init(&io);
}

/* Analog values: in 0 (REAL) to %ID0, in 1 (DINT) to %ID4, %QD0 to out 0 (REAL); the program copies %ID0 to %QD0. */
static void begin_iio(const char *device, const char *second, RTS_UI16 on_error)
{
    begin_kernel();
    add_device("Adc", device, SYSFS_IIO);
    io_add_text_parameter(&io, SYSFS_CHANNEL + 0, "in_voltage0");
    io_add_text_parameter(&io, SYSFS_CHANNEL + 1, second);
    io_add_text_parameter(&io, SYSFS_CHANNEL + 2, "out_voltage0");
    io_add_parameter(&io, SYSFS_OPTIONS + 0, 8, SYSFS_OPTION_REAL);
    io_add_parameter(&io, SYSFS_OPTIONS + 2, 8, SYSFS_OPTION_REAL | SYSFS_OPTION_OUT);
    add_copying_task("Main", 10000, 0);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, SYSFS_VALUE + 0, 0, 0, 32)->flags = on_error;
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, SYSFS_VALUE + 1, 0, 32, 32)->flags = IO_HOLD;
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, SYSFS_VALUE + 2, 0, 0, 32)->flags = IO_ZERO;
}

/* PWM: %QD0, a copy of %ID0, which nothing drives, to an output of the chip. */
static void add_pwm(const char *output, RTS_UI16 on_stop)
{
    add_device("Heater", "pwmchip0", SYSFS_PWM);
    io_add_text_parameter(&io, SYSFS_CHANNEL + 0, output);
    io_add_parameter(&io, SYSFS_OPTIONS + 0, 8, SYSFS_OPTION_OUT | SYSFS_OPTION_REAL);
    io_add_parameter(&io, SYSFS_PERIOD + 0, 32, 1000000);
    add_copying_task("Main", 10000, 0);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, (RTS_UI16)(io.head.connectors - 1), SYSFS_VALUE + 0, 0, 0, 32)->flags =
        on_stop;
}

static void begin_pwm(const char *output)
{
    begin_kernel();
    add_pwm(output, IO_ZERO);
}

static void end_kernel(void)
{
    CHECK_EQUAL(IoDrvSysfs_Hook(CH_EXIT2), ERR_OK);
}

static bool is_ok(void)
{
    IO_DEVICE_STATE now;

    memcpy(&now, AppGetAreaAddress(APP_AREA_DATA, STATE, sizeof now), sizeof now);
    return now.ok != 0;
}

static RTS_UI32 input(RTS_UI32 at)
{
    return read_u32(APP_AREA_INPUT, at);
}

static void set_input(RTS_UI32 value)
{
    memcpy(AppGetAreaAddress(APP_AREA_INPUT, 0, sizeof value), &value, sizeof value);
}

/* Lets cycles pass until a condition holds. It need hold only once: a file that is written again is empty for a moment. */
#define AWAIT(condition)                                           \
    do {                                                           \
        int tries = TRIES;                                         \
        bool is_met;                                               \
        while (!(is_met = (condition)) && tries-- > 0) {           \
            (void)nanosleep(&(struct timespec){0, 1000000}, NULL); \
            CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);               \
        }                                                          \
        CHECK(is_met);                                             \
    } while (0)

static void numbers_have_the_unit_or_are_raw(void)
{
    begin_iio("ads1115", "in_voltage1", IO_HOLD);
    start_io();
    AWAIT(is_ok());
    AWAIT(input(0) == bits_of(15)); /* (100 + 20) * 0.125 */
    CHECK_EQUAL(input(4), (RTS_UI32)-7);
    AWAIT(get(IIO "out_voltage0_raw") == 30); /* 15 / 0.5 */
    put(IIO "in_voltage0_raw", "-20\n");
    put(IIO "in_voltage1_raw", "99999999999\n");
    AWAIT(input(0) == 0 && input(4) == 0x7FFFFFFF);
    AWAIT(get(IIO "out_voltage0_raw") == 0);
    end_kernel();
}

static void a_stop_writes_the_output(void)
{
    begin_iio("iio:device3", "in_voltage1", IO_HOLD);
    start_io();
    AWAIT(get(IIO "out_voltage0_raw") == 30);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    AWAIT(get(IIO "out_voltage0_raw") == 0);
    end_kernel();
}

static void the_end_of_the_runtime_writes_what_is_left(void)
{
    begin_iio("ads1115", "in_voltage1", IO_HOLD);
    start_io();
    AWAIT(get(IIO "out_voltage0_raw") == 30);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    end_kernel(); /* at once */
    CHECK_EQUAL(get(IIO "out_voltage0_raw"), 0);
}

static void pull(RTS_UI16 on_error, RTS_UI32 expected)
{
    begin_iio("ads1115", "in_voltage1", on_error);
    start_io();
    AWAIT(is_ok() && input(0) == bits_of(15));
    move("bus/iio/devices/iio:device3", "pulled");
    AWAIT(!is_ok());
    AWAIT(input(0) == expected);
    CHECK_EQUAL(input(4), (RTS_UI32)-7); /* held */
    /* it comes back with another number */
    move("pulled", "bus/iio/devices/iio:device12");
    AWAIT(is_ok() && input(0) == bits_of(15));
    move("bus/iio/devices/iio:device12", "bus/iio/devices/iio:device3");
    end_kernel();
}

static void a_device_that_is_pulled_is_lost_and_comes_back(void)
{
    pull(IO_ZERO, 0);
    pull(IO_HOLD, bits_of(15));
}

static void a_file_that_is_no_number_is_a_lost_device(void)
{
    begin_iio("ads1115", "in_voltage1", IO_ZERO);
    start_io();
    AWAIT(is_ok());
    put(IIO "in_voltage1_raw", "fail\n");
    AWAIT(!is_ok());
    put(IIO "in_voltage1_raw", "nan\n");
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK(!is_ok());
    put(IIO "in_voltage1_raw", "3\n");
    AWAIT(is_ok() && input(4) == 3);
    end_kernel();
}

/* A file that does not answer, such as that of a device on a slow bus: a pipe without a writer. */
static void a_file_that_hangs_stops_no_cycle(void)
{
    begin_iio("ads1115", "in_voltage1", IO_ZERO);
    start_io();
    AWAIT(is_ok());
    CHECK_EQUAL(remove(path_of(IIO "in_voltage1_raw")), 0);
    CHECK_EQUAL(mkfifo(path_of(IIO "in_voltage1_raw"), 0666), 0);
    AWAIT(!is_ok()); /* seconds of virtual time: all cycles were run */
    CHECK_EQUAL(input(0), 0);
    {
        FILE *other = fopen(path_of(IIO "in_voltage1_raw"), "w"); /* it answers */
        CHECK(other != NULL && fputs("-7\n", other) >= 0 && fclose(other) == 0);
    }
    put(IIO "in_voltage1_raw", "-7\n");
    AWAIT(is_ok());
    end_kernel();
}

static void refused(RTS_RESULT result, const char *text)
{
    emit_io(&spec, &io);
    build_image(&image, &spec);
    CHECK_EQUAL(download_part(&image, image.size, &refusal), result);
    if (strstr(refusal.text, text) == NULL)
        fprintf(stderr, "refused with: %s\n", refusal.text);
    CHECK(strstr(refusal.text, text) != NULL);
    end_kernel();
}

static void what_the_kernel_has_not_refuses_the_program(void)
{
    begin_iio("ads1015", "in_voltage1", IO_HOLD);
    refused(ERR_NO_OBJECT, "the kernel has no device ads1015");
    begin_iio("ads1115", "in_voltage7", IO_HOLD);
    refused(ERR_NO_OBJECT, "ads1115 has no channel in_voltage7");
    begin_iio("ads1115", "../name", IO_HOLD);
    refused(ERR_PARAMETER, "its description is incomplete");
    begin_pwm("pwm2");
    refused(ERR_NO_OBJECT, "pwmchip0 has no channel pwm2");
}

static void pwm_has_period_and_share(void)
{
    begin_pwm("pwm1");
    start_io();
    AWAIT(is_ok());
    AWAIT(get(CHIP "pwm1/enable") == 1);
    CHECK_EQUAL(get(CHIP "pwm1/period"), 1000000);
    CHECK_EQUAL(get(CHIP "pwm1/duty_cycle"), 0);
    set_input(bits_of(25));
    AWAIT(get(CHIP "pwm1/duty_cycle") == 250000);
    set_input(bits_of(400)); /* more than there is */
    AWAIT(get(CHIP "pwm1/duty_cycle") == 1000000);
    set_input(0x7FC00000); /* no number */
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    set_input(bits_of(50));
    AWAIT(get(CHIP "pwm1/duty_cycle") == 500000);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    end_kernel();
}

static void an_output_that_is_not_exported_yet_is(void)
{
    begin_pwm("pwm0");
    put(CHIP "export", "");
    start_io();
    AWAIT(get(CHIP "export") == 0);
    CHECK(!is_ok());
    make_folder(CHIP "pwm0"); /* what the kernel does then */
    put(CHIP "pwm0/duty_cycle", "900\n");
    put(CHIP "pwm0/enable", "0\n");
    put(CHIP "pwm0/period", "2000000\n");
    AWAIT(is_ok());
    CHECK_EQUAL(get(CHIP "pwm0/period"), 1000000);
    CHECK_EQUAL(get(CHIP "pwm0/enable"), 1);
    end_kernel();
}

/* ---- the end of a set-up ---- */

static void main_pass(void)
{
    CHECK_EQUAL(IoDrvSysfs_Hook(CH_COMM_CYCLE), ERR_OK);
}

/* A program that has one output at 50 %; the device is in the middle of writing 60 %. */
static void start_slow_write(void)
{
    memset(&bus, 0, sizeof bus);
    start_io();
    set_input(bits_of(50));
    AWAIT(get(CHIP "pwm1/duty_cycle") == 500000);
    SysAtomicStore(&bus.is_slow, 1);
    set_input(bits_of(60));
    AWAIT(SysAtomicLoad(&bus.waiting) == 1);
}

static void begin_slow_write(RTS_UI16 on_stop)
{
    begin_kernel();
    add_pwm("pwm1", on_stop);
    start_slow_write();
}

static void go_on(void)
{
    SysAtomicStore(&bus.is_slow, 0);
}

static void begin_other_program(void)
{
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    spec.areas[APP_AREA_OUTPUT] = 32;
    io_init(&io);
}

static void a_reset_to_origin_switches_an_output_off(void)
{
    begin_slow_write(IO_ZERO);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    end_kernel();
}

static void a_program_without_the_output_switches_it_off(void)
{
    APP_BYTES other;

    begin_slow_write(IO_ZERO);
    build_counter(&other, 7);
    CHECK_EQUAL(download(&other), ERR_OK);
    main_pass();
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    end_kernel();
}

static void a_program_with_another_output_of_the_device_switches_it_off(void)
{
    begin_slow_write(IO_ZERO);
    make_folder(CHIP "pwm0");
    put(CHIP "pwm0/period", "0\n");
    put(CHIP "pwm0/duty_cycle", "0\n");
    put(CHIP "pwm0/enable", "0\n");
    begin_other_program();
    add_pwm("pwm0", IO_ZERO);
    start_io();
    set_input(bits_of(25));
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    AWAIT(get(CHIP "pwm0/duty_cycle") == 250000);
    end_kernel();
}

static void an_output_that_holds_keeps_the_last_value_of_the_program(void)
{
    begin_slow_write(IO_HOLD);
    set_input(bits_of(70));
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 700000);
    end_kernel();
    CHECK_EQUAL(get(CHIP "pwm1/duty_cycle"), 700000);
}

static void a_device_gets_to_the_program_that_is_the_last_one(void)
{
    begin_slow_write(IO_HOLD);
    begin_other_program();
    add_pwm("pwm1", IO_ZERO);
    io.parameters[io.head.parameters - 1].value = 2000000; /* the period: another set-up */
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    end_kernel();
}

/* Two threads would write it in any order. The first device of the program leaves a thread free, which comes first. */
static void a_device_that_comes_back_has_its_thread_again(void)
{
    int passes;

    begin_kernel();
    add_device("Adc", "ads1115", SYSFS_IIO);
    io_add_text_parameter(&io, SYSFS_CHANNEL + 0, "in_voltage0");
    add_pwm("pwm1", IO_ZERO);
    start_slow_write();
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    begin_other_program();
    add_pwm("pwm1", IO_ZERO);
    start_io();
    set_input(bits_of(25));
    for (passes = 0; passes < 30; passes++) {
        (void)nanosleep(&(struct timespec){0, 1000000}, NULL);
        CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    }
    CHECK_EQUAL(SysAtomicLoad(&bus.both), 0);
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 250000);
    end_kernel();
    CHECK_EQUAL(get(CHIP "pwm1/duty_cycle"), 250000);
}

static void the_end_of_the_runtime_awaits_a_slow_device(void)
{
    begin_slow_write(IO_ZERO);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    end_kernel();
    CHECK_EQUAL(get(CHIP "pwm1/duty_cycle"), 0);
}

static void an_error_that_passes_leaves_no_output_on(void)
{
    begin_slow_write(IO_ZERO);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    SysAtomicStore(&bus.fails, 2);
    go_on();
    AWAIT(get(CHIP "pwm1/duty_cycle") == 0);
    end_kernel();
}

static void an_input_that_fails_keeps_no_output_on(void)
{
    begin_iio("ads1115", "in_voltage1", IO_HOLD);
    start_io();
    AWAIT(get(IIO "out_voltage0_raw") == 30);
    put(IIO "in_voltage1_raw", "fail\n");
    AWAIT(!is_ok());
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    AWAIT(get(IIO "out_voltage0_raw") == 0);
    end_kernel();
}

static int remove_entry(const char *path, const struct stat *status, int type, struct FTW *place)
{
    RTS_UNUSED(status);
    RTS_UNUSED(type);
    RTS_UNUSED(place);
    return remove(path);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(numbers_have_the_unit_or_are_raw);
    RUN(a_stop_writes_the_output);
    RUN(the_end_of_the_runtime_writes_what_is_left);
    RUN(a_device_that_is_pulled_is_lost_and_comes_back);
    RUN(a_file_that_is_no_number_is_a_lost_device);
    RUN(a_file_that_hangs_stops_no_cycle);
    RUN(what_the_kernel_has_not_refuses_the_program);
    RUN(pwm_has_period_and_share);
    RUN(an_output_that_is_not_exported_yet_is);
    RUN(a_reset_to_origin_switches_an_output_off);
    RUN(a_program_without_the_output_switches_it_off);
    RUN(a_program_with_another_output_of_the_device_switches_it_off);
    RUN(an_output_that_holds_keeps_the_last_value_of_the_program);
    RUN(a_device_gets_to_the_program_that_is_the_last_one);
    RUN(a_device_that_comes_back_has_its_thread_again);
    RUN(the_end_of_the_runtime_awaits_a_slow_device);
    RUN(an_error_that_passes_leaves_no_output_on);
    RUN(an_input_that_fails_keeps_no_output_on);
    CHECK_EQUAL(nftw(root, remove_entry, 8, FTW_DEPTH | FTW_PHYS), 0);
    return test_result();
}
