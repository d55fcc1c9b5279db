/*
 * rts_config_size.h - sizes of the full configuration: all components, two serial lines, room for large applications.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#define RTS_CONFIG_NAME "full"
#define APP_CRASH_TEXT_SIZE 1
#define APP_MAX_TASKS 4
#define APP_MAX_IMPORTS 64
#define APP_DATA_SIZE 16384
#ifndef APP_MAX_CODE_SIZE
#define APP_MAX_CODE_SIZE 8192 /* CodeInRam.c; 0 with CodeInPlace.c */
#endif
#define APP_RETAIN_SIZE 2048
#define APP_MEMORY_SIZE 1024
#define APP_UNPACK_SIZE 8192
#define IO_MAX_CONNECTORS 8
#define RTS_MAIN_STACK_SIZE 3584 /* a driver refuses its configuration, and what ran before is loaded again */
#define RTS_IEC_STACK_SIZE 2048
#define NETSERVER_MESSAGE_SIZE 2048
#define COM_PACKET_SIZE 708 /* three of them are a message */
#define COMM_PASSWORD 1
#define SRV_OWN_GROUPS 4
#define SRV_OTHER_CLIENTS 1
#ifndef FORCE_MAX
#define FORCE_MAX 16
#endif
#define OPERATION_CONTROL 1
#ifndef ONLINE_CHANGE
#define ONLINE_CHANGE 1
#endif
#define IEC_LOG_BURST 8
#ifndef IEC_TASK_CALLS
#define IEC_TASK_CALLS 1
#endif
#ifndef TASK_LOAD
#define TASK_LOAD 1
#endif
#ifndef SCHED_LEVEL_EVENTS
#define SCHED_LEVEL_EVENTS 1
#endif
#ifndef IEC_TASK_HANDLER
#define IEC_TASK_HANDLER 1
#endif
#ifndef RTS_STRUCTURED_EXCEPTION_HANDLING
#define RTS_STRUCTURED_EXCEPTION_HANDLING 1
#endif
#ifndef BOOT_ON_DEMAND
#define BOOT_ON_DEMAND 1
#endif
#ifndef IEC_EVENTS
#define IEC_EVENTS 1
#endif
#ifndef SETTINGS
#define SETTINGS 1
#endif
#ifndef APP_CALLS
#define APP_CALLS 4
#endif
#ifndef IEC_FILES
#define IEC_FILES 4
#endif
#ifndef TRACE_BUFFER
#define TRACE_BUFFER 4096
#endif
#ifndef BP_MAX
#define BP_MAX 16
#endif
#define BP_TRAPS (BP_MAX * 16)
#define FILE_STORE_FILES 8
#define FILE_STORE_SIZE (BOARD_FLASH_SIZE / 4 - LOG_KEEP_SIZE)
#ifndef COMM_MAX_CLIENTS
#define COMM_MAX_CLIENTS 2
#endif
#define CM_OWN_EXT_TABLES 2
#define CYCLE_OWN_PHASES 6
#define EVENT_MAX_CALLBACKS (14 + (APP_CALLS > 0) + (IEC_FILES > 0) + IEC_TASK_HANDLER)
#define COM_MAX_LINES 2
#define LOG_MAX_ENTRIES 32
#ifndef CM_VERSIONS
#define CM_VERSIONS 4
#endif
#ifndef LOG_KEEP
#define LOG_KEEP 32
#endif
#define CHECKSUM_TABLE_ENTRIES 256

#define BOARD_UART_COUNT 2
#define BOARD_UART_RX_SIZE 1024
#define BOARD_UART_TX_SIZE 256

#endif
