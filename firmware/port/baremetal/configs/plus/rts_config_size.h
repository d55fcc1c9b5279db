/*
 * rts_config_size.h - sizes of the plus configuration: that of a small product, with events for programs and components in
 * C, what a program forbids, messages of programs in the log, and functions for tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#define RTS_CONFIG_NAME "plus"
#define APP_CRASH_TEXT_SIZE 1
#define APP_MAX_TASKS 3
#define NETSERVER_MESSAGE_SIZE 944 /* two full blocks */
#define EVENT_MAX_CALLBACKS 9      /* four of the runtime's own, five for components */
#define SCHED_MAX_EXTERNAL_EVENTS 2
#define OPERATION_CONTROL 1
#define IEC_LOG_BURST 4
#define IEC_EVENTS 1
#define IEC_TASK_CALLS 1
#define TASK_LOAD 1
#define SCHED_LEVEL_EVENTS 1
#define IEC_TASK_HANDLER 1
#define APP_REFUSAL_TEXT_SIZE 96
#define COM_QUEUE_SIZE 540
#define LOG_MAX_ENTRIES 8
#define LOG_TEXT_SIZE 80
#define LOG_KEEP 32
#define EXCEPT_MAX_CALLS 6
#define RTS_IEC_UNPRIVILEGED 0   /* 1: 300 bytes of flash, 24 of RAM */
#define RTS_MAIN_STACK_SIZE 2560 /* an event is posted in the middle of a download */

#define BOARD_UART_COUNT 1
#define BOARD_UART_RX_SIZE 256
#define BOARD_UART_TX_SIZE 64

#endif
