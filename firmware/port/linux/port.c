/*
 * port.c - what several parts of the Linux port need: how it says why something failed, names of one device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _DEFAULT_SOURCE /* lstat */
#include "port.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

void PortReason(PORT_REASON *reason, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reason->text, sizeof(reason->text), format, arguments);
    va_end(arguments);
    reason->busy = false;
}

bool PortMayCome(int error, const char *path)
{
    static const char devices[] = "/dev/";
    struct stat info;
    bool missing = error == ENOENT || error == ENODEV || error == ENXIO;
    bool named = strncmp(path, devices, sizeof(devices) - 1) == 0 || (lstat(path, &info) == 0 && S_ISLNK(info.st_mode));
    return missing && named;
}

bool PortIsDevice(int file, const char *path)
{
    struct stat opened;
    struct stat named;
    return fstat(file, &opened) == 0 && stat(path, &named) == 0 && S_ISCHR(named.st_mode) &&
           opened.st_rdev == named.st_rdev;
}
