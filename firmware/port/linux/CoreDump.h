/*
 * CoreDump.h - a file with what is in memory when the program stops with an exception (plcrt --dump). Manual 3.16.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef COREDUMP_H
#define COREDUMP_H

/* Where the file is written; a newer one replaces it. NULL: nowhere. `path` stays. */
void CoreDumpSet(const char *path);

/* From now on exceptions are dumped; one that the program had before was in an earlier run. From main, after CMInit. */
void CoreDumpBegin(void);

#endif
