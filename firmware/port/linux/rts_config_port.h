/*
 * rts_config_port.h - sizes of the Linux port.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "IecEntry.h"

/* An application on a PC-class machine may be large; RAM is plenty. */
#define APP_MAX_TASKS 16
#define APP_MAX_IMPORTS 128
#define APP_DATA_SIZE (1024 * 1024)
#define APP_RETAIN_SIZE (64 * 1024)
#define APP_INPUT_SIZE 4096
#define APP_OUTPUT_SIZE 4096
#define APP_MEMORY_SIZE (64 * 1024)
#define APP_UNPACK_SIZE 65536
#define APP_AREAS_FROM_PORT 1
#define IO_MAX_CONNECTORS 256
#define IO_GPIO_GROUPS 8
#define NETSERVER_MESSAGE_SIZE 16384
#define COM_PACKET_SIZE 2048
#define CAN_PACKET_SIZE 2080
#define COMM_MAX_CLIENTS 4
#define COMM_PASSWORD 1
#define COMM_ENDPOINTS 1
#define CM_OWN_EXT_TABLES 8
#define SRV_OWN_GROUPS 8
#define CYCLE_OWN_PHASES 16
#define EVENT_MAX_CALLBACKS 64
#define SRV_OTHER_CLIENTS 1
#define SRV_NETWORKS 8
#define FORCE_MAX 128
#define OPERATION_CONTROL 1
#define ONLINE_CHANGE 1
#define IEC_LOG_BURST 32
#define IEC_EVENTS 1
#define IEC_CALLBACKS 16
#define BOOT_ON_DEMAND 1
#define SETTINGS 1
#define APP_CALLS 32
#define APP_CALL_DATA 4096
#define APP_CALL_WAIT_MS 1000
#define IEC_FILES 16
#define IEC_SOCKETS 64
#define IEC_COMS 8
#define APP_POWER_FAIL 1
#define IEC_TASK_CALLS 1
#define TASK_LOAD 1
#define SCHED_LEVEL_EVENTS 1
#define IEC_TASK_HANDLER 1
#define TRACE_BUFFER (4 * 1024 * 1024)
#define BP_MAX 128
#define IEC_LATENESS 1
#define TCP_BUFFER_SIZE 16384
#define CAN_FD 1
#define CAN_BLOCK_SIZE 0 /* the kernel has room */
#define CAN_SHARED 1
#define CANOPEN_MAX_DEVICES 127
#define CANOPEN_MAX_PDOS 1024
#define CANOPEN_MAX_CALLS 16
#define CANOPEN_CALL_SIZE 1024
#define CANOPEN_DEVICE_DATA 16384
#define CANOPEN_DEVICE_SDO 1024
#define CANOPEN_DEVICE_PDOS 32
#define CANOPEN_PROGRAM_DOWNLOAD 1
#define CAN_FILTERS 32
#define CAN_URGENT_FRAMES 64
#define CAN_MAX_RECEIVERS 16
#define CAN_RECEIVE_FRAMES 32
#define CAN_SEND_FRAMES 64
#define LOG_MAX_ENTRIES 256
#define LOG_KEEP 32
#define IO_KEEP_SIZE 8192
#define CM_VERSIONS 32
#define CHECKSUM_TABLE_ENTRIES 256

/* Less than the patience of plctool with a device that does not answer, and of what ends plcrt [us]. */
#define APP_DEFAULT_WATCHDOG_US 5000000

/* Every task is a thread of its own; their processor time is known. */
#define SCHED_EVENTS_IN_TIMERS 1
#define SCHED_FREEWHEELING_IN_TIMERS 1
#define SCHED_PROCESSOR_TIME 1

/* plcrt --event */
#define SCHED_MAX_EXTERNAL_EVENTS 16

/* What images are built for. */
#if defined(__x86_64__)
#define BOARD_TARGET_ID TARGET_ID_X86_64_LINUX
#elif defined(__aarch64__)
#define BOARD_TARGET_ID TARGET_ID_AARCH64_LINUX
#elif defined(__ARM_PCS_VFP)
#define BOARD_TARGET_ID TARGET_ID_ARMV7_LINUX
#else
#error "Give this architecture a target id in CompactDownload.h and in plctool."
#endif
#define BOARD_DEVICE_NAME "plcrt"
#ifndef BOARD_VENDOR_NAME
#define BOARD_VENDOR_NAME "Open PLC runtime"
#endif

/* The flash file [bytes]: 4 MiB for programs, as long as there was nothing else, then the files and the log that is kept. Geometry of a
 * common serial NOR flash, programmed in the units of an STM32's. */
#define FILE_STORE_FILES 32
#define FILE_STORE_SIZE (1024 * 1024 - LOG_KEEP_SIZE)
#define BOARD_FLASH_SIZE (5 * 1024 * 1024)
#define BOARD_FLASH_SECTOR_SIZE 4096
#define BOARD_FLASH_PROGRAM_SIZE 8

/* Holds the longest reason why an image was refused. */
#define LOG_TEXT_SIZE 240

/* The largest code segment that can be made executable, per slot [bytes]: a slot is less than half of the flash. */
#define PORT_CODE_SIZE (BOARD_FLASH_SIZE / 2)

/* Stack of the IEC code of a thread [bytes]. */
#define RTS_IEC_STACK_SIZE (1024 * 1024)

/* Of it this is not the program's [bytes]: the way there, and what a function without calls has below its stack pointer
 * (128 on x86-64). */
#define RTS_IEC_STACK_LOST 1024

/* Stack of a task's thread [bytes], on which the runtime runs and IEC code does not (IecStack.c); the thread sanitizer
 * needs 1 MiB. The zone below it has no memory. */
#ifndef PORT_STACK_SIZE
#define PORT_STACK_SIZE (256 * 1024)
#endif
#define PORT_STACK_GUARD (64 * 1024)

/* SCHED_FIFO priority of an IEC priority p is PORT_PRIORITY_HIGHEST - p: 80..49. Above all of them are external events,
 * main as long as tasks leave it no time otherwise, and the watchdog. */
#define PORT_PRIORITY_HIGHEST 80
#define PORT_PRIORITY_EVENTS 84
#define PORT_PRIORITY_URGENT_MAIN 86
#define PORT_PRIORITY_WATCHDOG 90

/* Main, which wakes every PORT_IDLE_MS, has no processor when it makes no pass for so long, and then has priority for
 * so long [us]: communication answers within 20 ms even when tasks take all processors. */
#define PORT_MAIN_STARVES_US 15000
#define PORT_MAIN_URGENT_US 1000000

/* How often the watchdog thread looks for cycles that do not end [us]: how much longer than its watchdog time an
 * endless loop may run. Each look costs up to 15 us of a virtual machine's processor. (A cycle that ends too late is
 * found at its end.) */
#define PORT_WATCHDOG_US 5000

/* Serial lines of field buses, besides the one of --serial. */
#define PORT_MAX_BUS_LINES 8

/* A 16550A interrupts at 8 characters, others at up to 32, or 4 characters after the last one; an FTDI adapter sends
 * what it has each 16 ms; and main may come some ms later. */
#define SYSCOM_HELD_CHARS 32
#define SYSCOM_HELD_MS 20

/* Modbus: as many connections as the field has; the others as many as a large machine has. */
#define MODBUS_MAX_CONNECTIONS 32
#define SYSSOCK_NAMES 1
#define MODBUS_MAX_CLIENTS 16
#define MODBUS_MAX_DEVICES 128
#define MODBUS_MAX_JOBS 512
#define MODBUS_MAX_CALLS 16
#define MODBUS_MAX_SERVERS 4
#define MODBUS_MAX_RANGES 512
#define MODBUS_DATA_SIZE 65536

/* plcrt --tunnel */
#define MODBUS_TUNNEL 1

/* What main may wait for at a time: lines, sockets, inputs. */
#define PORT_MAX_SOURCES 96

/* Longest sleep of the main loop with nothing to do [ms]. */
#define PORT_IDLE_MS 10

/* When the process that runs the controller dies, it is started again at once; when it dies again without having run a
 * program or lived for PORT_LIFE_MS, after PORT_RESTART_MS, twice that and so on [ms]; after so many deaths in a row plcrt
 * ends, unless the last one came from outside (SIGKILL). */
#define PORT_RESTART_MS 250
#define PORT_LIFE_MS 10000
#define PORT_MAX_FAILURES 6

/* A proven program that ran then is started again, so many times in so long [ms]; after the next death it stays stopped. */
#define PORT_PROGRAM_RESTARTS 3
#define PORT_PROGRAM_RESTARTS_MS (10 * 60 * 1000)

/* How long it may take to end when it is asked to [ms]. */
#define PORT_END_MS 9000

/* How long the flash file and the serial device are waited for at start-up [ms]: a controller whose supervisor was killed
 * ends within that. */
#define PORT_BUSY_MS 1000

/* How often a serial device that went away is tried again [ms]. */
#define PORT_REOPEN_MS 1000

#endif
