/*
 * CoreDump.h - a file with what is in memory when the program stops with an exception (plcrt --dump). Manual 3.16.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef COREDUMP_H
#define COREDUMP_H

/* Sets the file of dumps, which a newer dump replaces; NULL: none. `path` must stay valid. */
void CoreDumpSet(const char *path);

/* From now on exceptions are dumped; one that the program had before was in an earlier run. From main, after CMInit. */
void CoreDumpBegin(void);

#endif
