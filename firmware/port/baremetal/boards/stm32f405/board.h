/*
 * board.h - STM32F405 (Cortex-M4F) with a crystal of 25 MHz, as on a Netduino Plus 2.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef BOARD_H
#define BOARD_H

#include "rts_config.h"

#define BOARD_CLOCK_HZ 168000000u
#define BOARD_IRQ_COUNT 82u
#define BOARD_PRIORITY_BITS 4
#define BOARD_TASK_IRQ 43u /* of timer 8 and a DMA stream, which are not used here */

enum { IRQ_CAN1_TX = 19, IRQ_CAN1_RX0 = 20, IRQ_CAN1_RX1 = 21, IRQ_USART1 = 37, IRQ_TIM5 = 50 };

void UartIrq(void);
void AlarmIrq(void);
void CanIrq(void);

#ifdef BOARD_CAN_COUNT
#define BOARD_CAN_VECTORS \
    [IRQ_VECTOR(IRQ_CAN1_TX)] = {CanIrq}, [IRQ_VECTOR(IRQ_CAN1_RX0)] = {CanIrq}, [IRQ_VECTOR(IRQ_CAN1_RX1)] = {CanIrq},
#else
#define BOARD_CAN_VECTORS
#endif

#define BOARD_VECTORS [IRQ_VECTOR(IRQ_USART1)] = {UartIrq}, [IRQ_VECTOR(IRQ_TIM5)] = {AlarmIrq}, BOARD_CAN_VECTORS

/* Called from BoardInit. */
void UartInit(void);

/* Microseconds of a timer that goes on while the processor waits for the flash; wraps. */
RTS_UI32 BoardMicroseconds(void);

#endif
