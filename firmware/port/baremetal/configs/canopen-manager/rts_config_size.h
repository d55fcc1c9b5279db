/*
 * rts_config_size.h - sizes of the configuration with a CANopen manager: those of the configuration with CANopen, nodes and
 * their PDOs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_MANAGER_H
#define RTS_CONFIG_SIZE_MANAGER_H

#define RTS_CONFIG_NAME "canopen-manager"
#define SCHED_MAX_EXTERNAL_EVENTS 2 /* of SYNC and its window */
#define CANOPEN_MAX_DEVICES 8       /* 190 bytes each */
#define CANOPEN_MAX_PDOS 32         /* 30 bytes each */
#define CANOPEN_MAX_CALLS 2         /* and one of tools, 150 bytes each */
#define CANOPEN_CALL_SIZE 64
#define IO_MAX_CONNECTORS (2 + CANOPEN_MAX_DEVICES) /* two networks: as manager and as device */

#include "../canopen/rts_config_size.h"

#endif
