/*
 * rts_config_size.h - sizes of the configuration with CANopen: a serial line and CAN, which tools and CANopen share. On the
 * boards here CAN is SLCAN over the second UART.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#ifndef RTS_CONFIG_NAME /* that of the configuration with a manager has all of this */
#define RTS_CONFIG_NAME "canopen"
#define SCHED_MAX_EXTERNAL_EVENTS 0
#define IO_MAX_CONNECTORS 4
#endif
#define APP_CRASH_TEXT_SIZE 1
#define APP_MAX_TASKS 3
#define NETSERVER_MESSAGE_SIZE 576
#define COMM_MAX_CLIENTS 2
#define COMM_ENDPOINTS 1
#define EVENT_MAX_CALLBACKS 0
#define APP_REFUSAL_TEXT_SIZE 96
#define APP_UNPACK_SIZE 4096
#define COM_QUEUE_SIZE 540
#define COM_MAX_LINES 1
#define CAN_RX_SESSIONS 2
#define CAN_TX_SESSIONS 2
#define CAN_BLOCK_SIZE 16 /* 27 bytes each: less than BOARD_UART_RX_SIZE */
#define CAN_SHARED 1
#define CANOPEN_DEVICE_DATA 256
#define CANOPEN_DEVICE_SDO 128
#define CANOPEN_DEVICE_PDOS 4
#define LOG_MAX_ENTRIES 6
#define EXCEPT_MAX_CALLS 6
#define RTS_IEC_UNPRIVILEGED 0 /* 1: 300 bytes of flash, 24 of RAM */
#define RTS_MAIN_STACK_SIZE 2848
#define LOG_TEXT_SIZE 48
#define CYCLE_OWN_PHASES 1
#define APP_INPUT_SIZE 512
#define APP_OUTPUT_SIZE 256

/* What 1010h and LSS store: two files, and one that is written. */
#define FILE_STORE_FILES 4
#define FILE_STORE_SIZE (6u * BOARD_FLASH_SECTOR_SIZE)

#define BOARD_UART_COUNT 2
#define BOARD_UART_RX_SIZE 512
#define BOARD_UART_TX_SIZE 256

#endif
