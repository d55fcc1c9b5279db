/*
 * IoDrvSysfs.h - driver of analog inputs and outputs, and of PWM, that the Linux kernel has as files: its parameters
 * (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A connector of it (CT_MASTER, driver "IoDrvSysfs") is one device: an IIO device or a PWM chip. It has up to
 * IO_SYSFS_CHANNELS channels, numbered from 0. Channel n is the 32 bits of parameter SYSFS_VALUE + n; it has the
 * parameters SYSFS_CHANNEL + n and, as needed, SYSFS_OPTIONS + n and SYSFS_PERIOD + n.
 */
#ifndef IODRVSYSFS_H
#define IODRVSYSFS_H

#include "CmpStd.h"

enum {
    SYSFS_DEVICE = 1,       /* a text: name of an IIO device ("ads1115"), its folder ("iio:device0"), "pwmchip0" */
    SYSFS_KIND = 2,         /* SYSFS_IIO or SYSFS_PWM */
    SYSFS_EVERY = 3,        /* ms from one reading to the next, and at most from a lost device to the next try */
    SYSFS_CHANNEL = 0x1000, /* a text: IIO "in_voltage0", "out_voltage1"; PWM "pwm0" */
    SYSFS_OPTIONS = 0x2000, /* SYSFS_OPTION_* */
    SYSFS_PERIOD = 0x3000,  /* PWM: ns */
    SYSFS_VALUE = 0x4000,
    IO_SYSFS_CHANNELS = 32, /* of one connector */
};

enum { SYSFS_IIO = 1, SYSFS_PWM = 2 };

enum {
    SYSFS_OPTION_OUT = 0x01,  /* an output */
    SYSFS_OPTION_REAL = 0x02, /* IIO: a REAL in the kernel's unit, (raw + offset) * scale; without it the raw number, a
                               * DINT. PWM is always a REAL: percent of the period. */
};

#ifndef RTS_CFFI
#include "CmpItf.h"
RTS_RESULT IoDrvSysfs_Hook(CMP_HOOK hook);
#endif

#endif
