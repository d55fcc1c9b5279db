/*
 * rts_config_size.h - sizes of the configuration with Modbus: the standard one, and a serial line of a field bus, as client
 * or server, which is "COM2".
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#define RTS_CONFIG_NAME "modbus"
#define APP_CRASH_TEXT_SIZE 1
#define APP_MAX_TASKS 3
#define NETSERVER_MESSAGE_SIZE 576
#define EVENT_MAX_CALLBACKS 0
#define SCHED_MAX_EXTERNAL_EVENTS 0
#define APP_REFUSAL_TEXT_SIZE 96
#define COM_QUEUE_SIZE 540
#define COM_MAX_LINES 1
#define LOG_MAX_ENTRIES 6
#define EXCEPT_MAX_CALLS 6
#define RTS_IEC_UNPRIVILEGED 0 /* 1: 300 bytes of flash, 24 of RAM */
#define RTS_MAIN_STACK_SIZE 2336
#define LOG_TEXT_SIZE 48
#define CYCLE_OWN_PHASES 1
#define IO_MAX_CONNECTORS 12
#define SYSCOM_BYTE_TIMES 1
#define MODBUS_MAX_DEVICES 8
#define MODBUS_MAX_JOBS 16
#define MODBUS_MAX_CALLS 2
#define MODBUS_MAX_RANGES 8
#define MODBUS_DATA_SIZE 512

#define BOARD_UART_COUNT 2
#define BOARD_UART_RX_SIZE 256
#define BOARD_UART_TX_SIZE 64

#endif
