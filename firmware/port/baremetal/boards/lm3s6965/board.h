/*
 * board.h - TI LM3S6965 evaluation board (Cortex-M3), as QEMU runs it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef BOARD_H
#define BOARD_H

#include "rts_config.h"

#define BOARD_CLOCK_HZ 50000000u
#define BOARD_IRQ_COUNT 44u
#define BOARD_PRIORITY_BITS 3
#define BOARD_TASK_IRQ 9u /* PWM and quadrature encoder, which are not used here */

enum { IRQ_UART0 = 5, IRQ_WATCHDOG = 18, IRQ_TIMER0A = 19 };

void UartIrq(void);
void AlarmIrq(void);
void NmiHandler(void); /* of cortexm: the chip's watchdog has no NMI, an interrupt above all tasks is the next best */

#define BOARD_VECTORS                                                               \
    [IRQ_VECTOR(IRQ_UART0)] = {UartIrq}, [IRQ_VECTOR(IRQ_WATCHDOG)] = {NmiHandler}, \
    [IRQ_VECTOR(IRQ_TIMER0A)] = {AlarmIrq},

/* Called from BoardInit. */
void UartInit(void);
void EepromInit(void);

#endif
