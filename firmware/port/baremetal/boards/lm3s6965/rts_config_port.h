/*
 * rts_config_port.h - the LM3S6965 board: its identity. Its sizes are those of the configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

/* The full configuration has no room for these in 64 KiB of RAM. */
#define ONLINE_CHANGE 0
#define TRACE_BUFFER 0
#define BP_MAX 0
#define BOOT_ON_DEMAND 0
#define IEC_EVENTS 0
#define SETTINGS 0
#define APP_CALLS 0
#define IEC_FILES 0
#define IEC_TASK_CALLS 0
#define TASK_LOAD 0
#define SCHED_LEVEL_EVENTS 0
#define IEC_TASK_HANDLER 0
#define CM_VERSIONS 0
#define LOG_KEEP 0
#define RTS_STRUCTURED_EXCEPTION_HANDLING 0

/* A second connection has no room in its 64 KiB. */
#define COMM_MAX_CLIENTS 1

#include "rts_config_size.h"

/* Nor have all entries of the log, beside files. */
#ifdef FILE_STORE_FILES
#undef LOG_MAX_ENTRIES
#define LOG_MAX_ENTRIES 10
#endif

#include "rts_config_cortexm.h"

#define BOARD_TARGET_ID TARGET_ID_CORTEX_M3
#define BOARD_DEVICE_NAME "LM3S6965 board"
#define BOARD_NODE_NAME "lm3s6965"

/* The EEPROM that applications and files have, bytes; the code of applications is copied from it to RAM. */
#define BOARD_FLASH_SIZE 0x10000u
#define BOARD_FLASH_SECTOR_SIZE 1024u
#ifndef APP_MAX_CODE_SIZE
#define APP_MAX_CODE_SIZE 8192
#endif

#endif
