/*
 * NewFile.h - files that others read, each whole or not at all: written beside their place, and then renamed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef NEWFILE_H
#define NEWFILE_H

#include "CmpStd.h"

#include <sys/types.h>

/* Bytes that the name of the temporary file has more than `path`, with NUL. */
enum { NEW_FILE_EXTRA = 8 };

/* Creates the temporary file of `path` with these rights. Returns its descriptor, -1 with errno. */
int NewFileOpen(const char *path, mode_t mode);

/* Closes the descriptor. Renames the file to `path` if `error` is 0, else removes it. Returns errno, 0 if it is there. */
int NewFileEnd(int file, const char *path, int error);

/* Writes all of it. Returns errno, 0 when it is done. */
int NewFileWrite(int file, const void *data, size_t size);

#endif
