/*
 * port.c - what several parts of the Linux port need: messages, reasons of failures, names of one device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _DEFAULT_SOURCE /* lstat */
#include "port.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MESSAGE_SIZE = 1024 }; /* the longest line, with the NUL */

void PortReason(PORT_REASON *reason, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reason->text, sizeof(reason->text), format, arguments);
    va_end(arguments);
    reason->busy = false;
}

static bool find_journal(void)
{
    struct stat info;
    unsigned long long device;
    unsigned long long inode;
    const char *stream = getenv("JOURNAL_STREAM");
    return stream != NULL && sscanf(stream, "%llu:%llu", &device, &inode) == 2 && fstat(STDERR_FILENO, &info) == 0 &&
           info.st_dev == device && info.st_ino == inode;
}

bool PortIsJournal(void)
{
    static enum { NOT_KNOWN, IS, IS_NOT } journal;
    if (journal == NOT_KNOWN) {
        journal = find_journal() ? IS : IS_NOT;
    }
    return journal == IS;
}

void PortPrint(PORT_LEVEL level, const char *format, ...)
{
    char line[MESSAGE_SIZE];
    va_list arguments;
    int head = PortIsJournal() ? snprintf(line, sizeof(line), "<%d>", level) : snprintf(line, sizeof(line), "plcrt: ");
    va_start(arguments, format);
    vsnprintf(line + head, sizeof(line) - (size_t)head - 1, format, arguments);
    va_end(arguments);
    size_t size = strlen(line);
    for (size_t i = 0; i < size; i++) {
        line[i] = (unsigned char)line[i] < ' ' || line[i] == 0x7F ? ' ' : line[i];
    }
    line[size++] = '\n';
    (void)!write(STDERR_FILENO, line, size);
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
