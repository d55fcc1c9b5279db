/*
 * port.c - what several parts of the Linux port need: how it says why something failed, names of one device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "port.h"

#include <stdarg.h>
#include <stdio.h>
#include <sys/stat.h>

void PortReason(PORT_REASON *reason, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reason->text, sizeof(reason->text), format, arguments);
    va_end(arguments);
    reason->busy = false;
}

bool PortIsDevice(int file, const char *path)
{
    struct stat opened;
    struct stat named;
    return fstat(file, &opened) == 0 && stat(path, &named) == 0 && S_ISCHR(named.st_mode) &&
           opened.st_rdev == named.st_rdev;
}
