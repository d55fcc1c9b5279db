/*
 * rts_config_size.h - sizes of the minimal configuration: one serial line, a super loop; no monitoring, no log, no
 * retain variables, no words for errors.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_SIZE_H
#define RTS_CONFIG_SIZE_H

#define RTS_CONFIG_NAME "minimal"
#define APP_CRASH_TEXT_SIZE 1
#define CM_LEAVES_OUT 0
#define APP_MAX_TASKS 2
#define APP_MAX_IMPORTS 16
#define EVENT_MAX_CALLBACKS 0
#define CYCLE_MAX_PHASES 0
#define SCHED_MAX_EXTERNAL_EVENTS 0
#define SCHED_EVENTS_IN_TIMERS 0   /* the super loop has no timers */
#define NETSERVER_MESSAGE_SIZE 232 /* the identity, with names of 19 characters and a serial number of 24 */
#define COM_QUEUE_SIZE 324
#define LOG_MAX_ENTRIES 0
#define EXCEPT_MAX_CALLS 0
#define APP_REFUSAL_TEXT_SIZE 1
#define APP_RETAIN_SIZE 0
#define APP_IMAGE_SIZE 0 /* the super loop runs one task after the other */
#define SRV_INFORMATION 0
#define NS_OLD_VERSIONS 0
#define COMM_COUNTERS 0
#define NS_REPLY_SIZE 196 /* the same in a scan */
#define RTS_IEC_UNPRIVILEGED 0
#define RTS_MAIN_STACK_SIZE 1312 /* no task interrupts main */

#define BOARD_UART_COUNT 1
#define BOARD_UART_RX_SIZE 128
#define BOARD_UART_TX_SIZE 32

#endif
