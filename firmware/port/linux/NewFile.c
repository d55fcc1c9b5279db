/*
 * NewFile.c - files that others read, each whole or not at all.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "NewFile.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

/* The user's path was refused if this does not fit. */
static const char *temporary_of(const char *path, char name[PATH_MAX])
{
    (void)snprintf(name, PATH_MAX, "%s.tmp", path);
    return name;
}

/* The temporary file is a new one, so it is neither a link of another user nor a pipe that nothing reads. */
int NewFileOpen(const char *path, mode_t mode)
{
    char name[PATH_MAX];
    (void)unlink(temporary_of(path, name));
    int file = open(name, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
    if (file >= 0 && fchmod(file, mode) != 0) {
        int error = errno;
        (void)NewFileEnd(file, path, error);
        errno = error;
        return -1;
    }
    return file;
}

int NewFileEnd(int file, const char *path, int error)
{
    char name[PATH_MAX];
    error = close(file) != 0 && error == 0 ? errno : error;
    if (error == 0 && rename(temporary_of(path, name), path) != 0) {
        error = errno;
    }
    if (error != 0) {
        (void)unlink(temporary_of(path, name));
    }
    return error;
}

int NewFileWrite(int file, const void *data, size_t size)
{
    size_t done = 0;
    while (done < size) {
        ssize_t count = write(file, (const char *)data + done, size - done);
        if (count < 0 && errno != EINTR) {
            return errno;
        }
        done += count > 0 ? (size_t)count : 0;
    }
    return 0;
}
