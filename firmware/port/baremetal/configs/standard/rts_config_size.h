/*
 * rts_config_size.h - sizes of the standard configuration: three tasks, retain variables, monitoring, log. No events
 * for components in C: with some, raise the two numbers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#define RTS_CONFIG_NAME "standard"
#define APP_CRASH_TEXT_SIZE 1
#define CM_LEAVES_OUT 0
#define APP_MAX_TASKS 3
#define NETSERVER_MESSAGE_SIZE 944 /* two full blocks */
#define EVENT_MAX_CALLBACKS 0
#define SCHED_MAX_EXTERNAL_EVENTS 0
#define APP_REFUSAL_TEXT_SIZE 96
#define COM_QUEUE_SIZE 540
#define LOG_MAX_ENTRIES 6
#define EXCEPT_MAX_CALLS 6
#define RTS_IEC_UNPRIVILEGED 0 /* 1: 300 bytes of flash, 24 of RAM */
#define RTS_MAIN_STACK_SIZE 2240
#define LOG_TEXT_SIZE 48

#define BOARD_UART_COUNT 1
#define BOARD_UART_RX_SIZE 256
#define BOARD_UART_TX_SIZE 64

#endif
