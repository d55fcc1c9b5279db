/*
 * board.h - Arm MPS2 with the AN385 (Cortex-M3), AN386 (Cortex-M4F) or AN500 (Cortex-M7) image, as QEMU runs it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef BOARD_H
#define BOARD_H

#include "rts_config.h"

#define BOARD_CLOCK_HZ 25000000u
#define BOARD_IRQ_COUNT 32u
#define BOARD_PRIORITY_BITS 3
#define BOARD_MEMORY_HOLES 0xEE /* code and RAM are in the first and the fifth 128 MiB */
#define BOARD_TASK_IRQ 24u      /* lines of single GPIO pins */

enum { IRQ_UART0_RX = 0, IRQ_UART0_TX = 1, IRQ_UART1_RX = 2, IRQ_UART1_TX = 3, IRQ_GPIO0 = 6, IRQ_TIMER0 = 8 };

void Uart0RxIrq(void);
void Uart0TxIrq(void);
void Uart1RxIrq(void);
void Uart1TxIrq(void);
void AlarmIrq(void);
void SupplyIrq(void);

#define BOARD_UART0_VECTORS [IRQ_VECTOR(IRQ_UART0_RX)] = {Uart0RxIrq}, [IRQ_VECTOR(IRQ_UART0_TX)] = {Uart0TxIrq},
#if BOARD_UART_COUNT > 1
#define BOARD_UART1_VECTORS [IRQ_VECTOR(IRQ_UART1_RX)] = {Uart1RxIrq}, [IRQ_VECTOR(IRQ_UART1_TX)] = {Uart1TxIrq},
#else
#define BOARD_UART1_VECTORS
#endif
#if APP_POWER_FAIL
#define BOARD_SUPPLY_VECTOR [IRQ_VECTOR(IRQ_GPIO0)] = {SupplyIrq},
#else
#define BOARD_SUPPLY_VECTOR
#endif
/* clang-format off */
#define BOARD_VECTORS BOARD_UART0_VECTORS BOARD_UART1_VECTORS BOARD_SUPPLY_VECTOR [IRQ_VECTOR(IRQ_TIMER0)] = {AlarmIrq},
/* clang-format on */

/* Called from BoardInit. */
void UartInit(void);
void FlashInit(void);

#endif
