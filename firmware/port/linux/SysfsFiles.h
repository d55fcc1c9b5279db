/*
 * SysfsFiles.h - analog values (IIO) and PWM in the files of the kernel, for IoDrvSysfs.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A file may take as long as a conversion or a time-out of its bus, so only the thread of a device reads and writes
 * values. But for the root nothing is kept here.
 */
#ifndef SYSFSFILES_H
#define SYSFSFILES_H

#include "IoDrvSysfs.h"

enum { SYSFS_NAME_SIZE = 64, SYSFS_PATH_SIZE = 256 };

/* A channel: `name` is that of its file without "_raw" (IIO), or of its folder (PWM); `options` SYSFS_OPTION_*. */
typedef struct {
    char name[SYSFS_NAME_SIZE];
    RTS_UI32 options;
    RTS_UI32 period_ns;
} SYSFS_FILE;

/* A device: its folder in sysfs or its name; `kind` SYSFS_IIO or SYSFS_PWM. */
typedef struct {
    char device[SYSFS_NAME_SIZE];
    RTS_UI32 kind;
    RTS_UI32 every_ms;
    RTS_UI32 count;
    SYSFS_FILE channel[IO_SYSFS_CHANNELS];
} SYSFS_SETUP;

/* Where the kernel's files are, "/sys" unless said otherwise; `root` is kept. For tests, before CH_INIT2. */
void SysfsSetRoot(const char *root);

/* Where a device is now; false: it is not there. */
bool SysfsFind(const SYSFS_SETUP *setup, char folder[SYSFS_PATH_SIZE]);

/* The channel that the device in this folder has not; NULL: it has all. */
const char *SysfsFindMissing(const SYSFS_SETUP *setup, const char *folder);

/* A channel's value: a REAL in the kernel's unit with SYSFS_OPTION_REAL, or else a DINT as the file has it; of PWM a REAL,
 * the duty cycle [%]. False: the device did not do it. */
bool SysfsRead(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 *value);
bool SysfsWrite(const SYSFS_SETUP *setup, RTS_UI32 n, const char *folder, RTS_UI32 value);

#endif
