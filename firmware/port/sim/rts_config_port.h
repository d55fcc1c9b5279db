/*
 * rts_config_port.h - sizes of the simulator: as generous as the Linux port, so that it runs the same programs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "../linux/IecEntry.h"

#define APP_MAX_TASKS 16
#define APP_MAX_IMPORTS 128
#ifndef APP_DATA_SIZE /* less for the C tests in QEMU, which takes long to clear it at each start */
#define APP_DATA_SIZE (1024 * 1024)
#endif
#define APP_RETAIN_SIZE (64 * 1024)
#define APP_INPUT_SIZE 4096
#define APP_OUTPUT_SIZE 4096
#define APP_MEMORY_SIZE (64 * 1024)
#define APP_UNPACK_SIZE 65536
#define APP_AREAS_FROM_PORT 1
#define IO_MAX_CONNECTORS 256
#define IO_SIM_TAKES_ALL 1
#define IO_GPIO_GROUPS 2
#define MODBUS_MAX_CALLS 16
#define MODBUS_LAST_WRITES_MS 0 /* its time does not go on by itself */
#define NETSERVER_MESSAGE_SIZE 16384
#define COM_PACKET_SIZE 2048
#define COMM_PASSWORD 1
#define SRV_OWN_GROUPS 8
#define SRV_OTHER_CLIENTS 1
#define FORCE_MAX 128
#define OPERATION_CONTROL 1
#ifndef ONLINE_CHANGE /* not in the C tests that fake what it needs */
#define ONLINE_CHANGE 1
#endif
#define IEC_LOG_BURST 16
#define IEC_EVENTS 1
#define IEC_CALLBACKS 16
#define BOOT_ON_DEMAND 1
#define SETTINGS 1
#define APP_CALLS 32
#define APP_CALL_DATA 2048
#define APP_CALL_WAIT_MS 1000
#define IEC_FILES 16
#define IEC_SOCKETS 64
#define IEC_COMS 8
#define APP_POWER_FAIL 1
#define APP_RETAIN_SRAM 1
#define IEC_TASK_CALLS 1
#ifndef TASK_LOAD
#define TASK_LOAD 1
#endif
#define SCHED_LEVEL_EVENTS 1
#define IEC_TASK_HANDLER 1
#ifndef TRACE_BUFFER /* less for the C tests in QEMU */
#define TRACE_BUFFER (1024 * 1024)
#endif
#ifndef BP_MAX /* none in the C tests in QEMU, which run IEC code as C */
#define BP_MAX 128
#endif
#define BP_HOLDS_TASKS 0
#define BP_ALIVE_MS 0 /* its time does not go on by itself */
#define IEC_LATENESS 1
#define CAN_FILTERS 32
#define CAN_URGENT_FRAMES 64
#define CAN_RECEIVE_FRAMES 32
#define CAN_SEND_FRAMES 64
#define LOG_MAX_ENTRIES 64
#define LOG_TEXT_SIZE 160
#define LOG_KEEP 32
#define IO_KEEP_SIZE 8192
#define CM_VERSIONS 8
#define CM_OWN_EXT_TABLES 8
#ifndef CM_LEAVES_OUT
#define CM_LEAVES_OUT 0 /* a test that lacks a component shall fail */
#endif
#define CHECKSUM_TABLE_ENTRIES 256
#define EVENT_MAX_CALLBACKS 40
#define SCHED_MAX_EXTERNAL_EVENTS 16
#define SCHED_EVENTS_IN_TIMERS 1
#define SCHED_FREEWHEELING_IN_TIMERS 1

/* All tasks run in the thread that lets time pass, one after the other; what writes a variable does it between two
 * cycles. */
#define APP_IMAGE_ALWAYS 0

/* What SimFlashConfigure starts with: geometry of a common serial NOR flash, programmed in the units of an STM32's
 * [bytes]. */
#define SIM_FLASH_SIZE (4 * 1024 * 1024)
#define SIM_FLASH_SECTOR_SIZE 4096
#define SIM_FLASH_PROGRAM_SIZE 8
#define SIM_FLASH_ERASED 0xFF

/* The store has what a test gives it; 0 before, so that the programs have all of the flash. */
#define FILE_STORE_FILES 16
#ifndef RTS_CFFI
extern unsigned SimFileStoreSize;
#endif
#define FILE_STORE_SIZE SimFileStoreSize

/* The same for the log that is kept. */
#ifndef RTS_CFFI
extern unsigned SimKeptLogSize;
#endif
#define LOG_KEEP_SIZE SimKeptLogSize

/* Stack of the IEC code [bytes]: that of the Linux port. */
#define RTS_IEC_STACK_SIZE (1024 * 1024)

/* Bytes the simulated serial line holds in each direction. */
#define SIM_COM_SIZE (64 * 1024)

/* A cycle that takes longer than this in time of the processor is aborted [ms]: virtual time stands still in an
 * endless loop. */
#define SIM_CYCLE_LIMIT_MS 2000

#endif
