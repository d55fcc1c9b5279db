/*
 * SysfsFiles.c - analog values (IIO) and PWM in the files of the kernel.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysfsFiles.h"

#include <dirent.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TEXT_SIZE = 32 };

static const char *sysfs = "/sys";

void SysfsSetRoot(const char *root)
{
    sysfs = root;
}

/* ---- files ---- */

/* "" as the result of a path that is too long: there is no such file. */
static const char *join(char path[SYSFS_PATH_SIZE], const char *folder, const char *name, const char *suffix)
{
    int length = snprintf(path, SYSFS_PATH_SIZE, "%s/%s%s", folder, name, suffix);

    if (length < 0 || length >= SYSFS_PATH_SIZE)
        path[0] = '\0';
    return path;
}

static bool exists(const char *folder, const char *name, const char *suffix)
{
    char path[SYSFS_PATH_SIZE];

    return access(join(path, folder, name, suffix), F_OK) == 0;
}

/* Without the end of the line. */
static bool read_text(const char *path, char text[SYSFS_NAME_SIZE])
{
    int file = open(path, O_RDONLY | O_CLOEXEC);
    ssize_t size = file >= 0 ? read(file, text, SYSFS_NAME_SIZE - 1) : -1;

    if (file >= 0)
        (void)close(file);
    if (size < 0)
        return false;
    text[size] = '\0';
    text[strcspn(text, "\n")] = '\0';
    return true;
}

static bool write_text(const char *path, const char *text)
{
    int file = open(path, O_WRONLY | O_TRUNC | O_CLOEXEC);
    ssize_t size = (ssize_t)strlen(text);
    bool is_written = file >= 0 && write(file, text, (size_t)size) == size;

    if (file >= 0)
        (void)close(file);
    return is_written;
}

static bool read_number(const char *folder, const char *name, const char *suffix, double *number)
{
    char path[SYSFS_PATH_SIZE];
    char text[SYSFS_NAME_SIZE];
    char *end = text;

    if (!read_text(join(path, folder, name, suffix), text))
        return false;
    *number = strtod(text, &end);
    return end != text && isfinite(*number);
}

static bool write_number(const char *folder, const char *name, const char *suffix, double number)
{
    char path[SYSFS_PATH_SIZE];
    char text[TEXT_SIZE];
    int length = snprintf(text, sizeof text, "%.0f\n", number);

    return length > 0 && length < TEXT_SIZE && write_text(join(path, folder, name, suffix), text);
}

/* ---- devices ---- */

/* The folder of an IIO device that has a name; of several, that with the lowest number. */
static bool search_name(const char *base, const char *name, char folder[SYSFS_PATH_SIZE])
{
    DIR *list = opendir(base);
    struct dirent *entry;
    char device[SYSFS_NAME_SIZE];
    unsigned best = ~0u;

    while (list != NULL && (entry = readdir(list)) != NULL) {
        char path[SYSFS_PATH_SIZE];
        char text[SYSFS_NAME_SIZE];
        unsigned number;
        if (sscanf(entry->d_name, "iio:device%u", &number) != 1 || number >= best)
            continue;
        if (read_text(join(path, join(folder, base, entry->d_name, ""), "name", ""), text) && strcmp(text, name) == 0)
            best = number;
    }
    if (list != NULL)
        (void)closedir(list);
    if (best == ~0u)
        return false;
    (void)snprintf(device, sizeof device, "iio:device%u", best);
    return *join(folder, base, device, "") != '\0';
}

bool SysfsFind(const SYSFS_SETUP *setup, char folder[SYSFS_PATH_SIZE])
{
    char base[SYSFS_PATH_SIZE];

    join(base, sysfs, setup->kind == SYSFS_PWM ? "class/pwm" : "bus/iio/devices", "");
    if (exists(base, setup->device, ""))
        return *join(folder, base, setup->device, "") != '\0';
    return setup->kind == SYSFS_IIO && search_name(base, setup->device, folder);
}

/* ---- IIO ---- */

/* A factor of a channel: its own ("in_voltage0_scale"), or that of all of its type ("in_voltage_scale"). */
static double get_factor(const char *folder, const char *channel, const char *suffix, double otherwise)
{
    char type[SYSFS_NAME_SIZE];
    double factor;

    if (read_number(folder, channel, suffix, &factor))
        return factor;
    (void)snprintf(type, sizeof type, "%s", channel);
    type[strcspn(type, "0123456789")] = '\0';
    return read_number(folder, type, suffix, &factor) ? factor : otherwise;
}

/* Numbers that a DINT has not become the nearest one. */
static RTS_UI32 dint_of(double number)
{
    return (RTS_UI32)(RTS_I32)fmin(fmax(number, -2147483648.0), 2147483647.0);
}

static RTS_UI32 real_of(double number)
{
    float value = (float)number;
    RTS_UI32 bits;

    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* A value that is no number is 0. */
static double number_of(RTS_UI32 bits)
{
    float value;

    memcpy(&value, &bits, sizeof value);
    return isfinite(value) ? (double)value : 0;
}

static bool read_iio(const char *folder, const SYSFS_FILE *channel, RTS_UI32 *value)
{
    double number;

    if (!read_number(folder, channel->name, "_raw", &number))
        return false;
    if ((channel->options & SYSFS_OPTION_REAL) == 0)
        *value = dint_of(number);
    else
        *value = real_of((number + get_factor(folder, channel->name, "_offset", 0)) *
                         get_factor(folder, channel->name, "_scale", 1));
    return true;
}

static bool write_iio(const char *folder, const SYSFS_FILE *channel, RTS_UI32 value)
{
    double scale;

    if ((channel->options & SYSFS_OPTION_REAL) == 0)
        return write_number(folder, channel->name, "_raw", (RTS_I32)value);
    scale = get_factor(folder, channel->name, "_scale", 1);
    if (scale == 0)
        return false;
    return write_number(folder, channel->name, "_raw",
                        round(number_of(value) / scale - get_factor(folder, channel->name, "_offset", 0)));
}

/* ---- PWM ---- */

/* The kernel refuses a duty cycle longer than the period at any moment, so the old one goes first. */
static bool set_period(const char *pwm, RTS_UI32 period_ns)
{
    double now;

    if (!read_number(pwm, "period", "", &now))
        return false;
    if (now == period_ns)
        return true;
    if (now > 0 && !write_number(pwm, "duty_cycle", "", 0))
        return false;
    return write_number(pwm, "period", "", period_ns);
}

static bool is_exported(const char *folder, const SYSFS_FILE *channel)
{
    return exists(folder, channel->name, "") ||
           write_number(folder, "export", "", (double)strtoul(channel->name + strlen("pwm"), NULL, 10));
}

static bool write_pwm(const char *folder, const SYSFS_FILE *channel, RTS_UI32 value)
{
    double percent = fmin(fmax(number_of(value), 0), 100);
    char pwm[SYSFS_PATH_SIZE];
    double enabled;

    join(pwm, folder, channel->name, "");
    return is_exported(folder, channel) && set_period(pwm, channel->period_ns) &&
           write_number(pwm, "duty_cycle", "", round(channel->period_ns * percent / 100)) &&
           read_number(pwm, "enable", "", &enabled) && (enabled == 1 || write_number(pwm, "enable", "", 1));
}

/* ---- of either kind ---- */

const char *SysfsFindMissing(const SYSFS_SETUP *setup, const char *folder)
{
    RTS_UI32 n;

    for (n = 0; n < setup->count; n++) {
        const char *name = setup->channel[n].name;
        double count;
        bool is_there = setup->kind == SYSFS_IIO ? exists(folder, name, "_raw")
                                                 : read_number(folder, "npwm", "", &count) &&
                                                       strtoul(name + strlen("pwm"), NULL, 10) < count;
        if (!is_there)
            return name;
    }
    return NULL;
}

bool SysfsRead(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 *value)
{
    return read_iio(folder, &setup->channel[n], value);
}

bool SysfsWrite(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 value)
{
    return (setup->kind == SYSFS_PWM ? write_pwm : write_iio)(folder, &setup->channel[n], value);
}
