/*
 * SysTarget.h - the identity of this device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SYSTARGET_H
#define SYSTARGET_H

#include "CmpStd.h"

typedef struct {
    RTS_UI32 type;    /* TARGET_TYPE_* */
    RTS_UI32 id;      /* vendor << 16 | device: images for another id are refused */
    RTS_UI32 version; /* bytes: major.minor.patch.revision from the highest */
    const char *device_name;
    const char *vendor_name;
    const char *node_name;
    const char *serial_number;
} SYS_TARGET;

/* Bytes of a stack; `unused` have never been used since the start. Size 0: not known. */
typedef struct {
    RTS_UI32 size;
    RTS_UI32 unused;
} SYS_STACK;

/* From any context; constant after start. */
const SYS_TARGET *SysTargetGet(void);

/* 32 unpredictable bits for channel and session ids. From main. */
RTS_UI32 SysTargetRandom(void);

/* Whether they come from a generator of the hardware or the system. False: a start that is the same to the cycle gives the
 * same ones, which the log says of a device on a network or bus, or with a password. From main. */
bool SysTargetHasGenerator(void);

/* Whether this device is the board of that name, which is what plctool calls it: `name` of device.toml, or of --board. A
 * program with inputs and outputs of another board is refused, since what has the same name there may be another pin. From
 * main. */
bool SysTargetIsBoard(const char *name);

/* The stack of main. From main, on request: may take a while. */
SYS_STACK SysTargetGetStack(void);

#endif
