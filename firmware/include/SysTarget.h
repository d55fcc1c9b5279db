/*
 * SysTarget.h - who this device is.
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

/* From any context; constant after start. */
const SYS_TARGET *SysTargetGet(void);

/* 32 unpredictable bits for channel and session ids. From main. */
RTS_UI32 SysTargetRandom(void);

#endif
