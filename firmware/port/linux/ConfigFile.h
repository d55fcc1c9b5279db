/*
 * ConfigFile.h - plcrt --config: a file of settings, which may give all options.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main, before CMInit. docs/settings.md.
 */
#ifndef CONFIGFILE_H
#define CONFIGFILE_H

#include "CmpStd.h"

/* The largest file [bytes]. */
enum { CONFIG_FILE_SIZE = 16384 };

/* Reads and checks the file, and gives its settings to the runtime. False: it says on stderr what is wrong, with its
 * lines. */
bool ConfigFileRead(const char *path);

/* Gives the options that the file has, one by one: its name without "--", its value (NULL: it takes none), the line. False
 * after the last one. Names and values stay where they are. */
typedef struct {
    const char *option;
    char *value;
    unsigned line;
} CONFIG_OPTION;

bool ConfigFileNext(CONFIG_OPTION *next);

/* Prints all settings, as a file that can be used. */
void ConfigFileHelp(void);

#endif
