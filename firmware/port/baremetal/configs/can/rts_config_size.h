/*
 * rts_config_size.h - sizes of the configuration with CAN: a serial line and CAN, two tools at a time. On the boards here
 * CAN is SLCAN over the second UART.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#define RTS_CONFIG_NAME "can"
#define APP_CRASH_TEXT_SIZE 1
#define APP_MAX_TASKS 3
#define NETSERVER_MESSAGE_SIZE 576 /* more than that and two tools at a time do not fit into 12 KiB */
#define COMM_MAX_CLIENTS 2
#define COMM_ENDPOINTS 1
#define EVENT_MAX_CALLBACKS 0
#define SCHED_MAX_EXTERNAL_EVENTS 0
#define APP_REFUSAL_TEXT_SIZE 96
#define APP_UNPACK_SIZE 4096
#define COM_QUEUE_SIZE 540
#define COM_MAX_LINES 1
#define CAN_RX_SESSIONS 2
#define CAN_TX_SESSIONS 2
#define CAN_BLOCK_SIZE 16 /* 27 bytes each: less than BOARD_UART_RX_SIZE */
#define LOG_MAX_ENTRIES 6
#define EXCEPT_MAX_CALLS 6
#define RTS_IEC_UNPRIVILEGED 0 /* 1: 300 bytes of flash, 24 of RAM */
#define RTS_MAIN_STACK_SIZE 2336
#define LOG_TEXT_SIZE 48

#define BOARD_UART_COUNT 2
#define BOARD_UART_RX_SIZE 512
#define BOARD_UART_TX_SIZE 64

#endif
