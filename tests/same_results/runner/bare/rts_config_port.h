/*
 * rts_config_port.h - sizes of the runner on a bare processor, and how compiled code is entered there.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "IecCall.h"

#define APP_MAX_TASKS 16
#define APP_MAX_IMPORTS 128
#define APP_DATA_SIZE (256 * 1024)
#define APP_RETAIN_SIZE (16 * 1024)
#define APP_INPUT_SIZE 4096
#define APP_OUTPUT_SIZE 4096
#define APP_MEMORY_SIZE (16 * 1024)
#define CM_OWN_EXT_TABLES 8
#define EVENT_MAX_CALLBACKS 16
#define IEC_LOG_BURST 16
#define IEC_EVENTS 1
#define IEC_TASK_CALLS 1
#define SCHED_LEVEL_EVENTS 1
#define SCHED_EVENTS_IN_TIMERS 1
#define SCHED_FREEWHEELING_IN_TIMERS 1
#define SIM_FLASH_SIZE (1024 * 1024)
#define SIM_FLASH_SECTOR_SIZE 4096
#define SIM_FLASH_PROGRAM_SIZE 8
#define SIM_FLASH_ERASED 0xFF

#if defined(__arm__)
#define APP_ENTRY_MODE_BIT 1
#endif

#endif
