/*
 * uart.c - a 16550 with FIFOs, for OneUart.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "OneUart.h"

#define UART_REG(n) (*(volatile RTS_UI8 *)(uintptr_t)(0x10000000u + (n)))
#define UART_DATA UART_REG(0) /* divisor, lower byte, with LCR_DIVISOR */
#define UART_IER UART_REG(1)  /* divisor, upper byte */
#define UART_FCR UART_REG(2)  /* written; read it says which interrupt, and clears that of room to send */
#define UART_LCR UART_REG(3)
#define UART_LSR UART_REG(5)

enum { UART_CLOCK = 3686400 };
enum { IER_RX_TX = 3, FCR_ON_AND_EMPTY = 7 | 3 << 6 /* 14 bytes or a pause interrupt */ };
enum { LCR_8 = 3, LCR_STOP_2 = 1 << 2, LCR_PARITY = 1 << 3, LCR_EVEN = 1 << 4, LCR_DIVISOR = 1 << 7 };
enum { LSR_RECEIVED = 1 << 0, LSR_FIFO_EMPTY = 1 << 5, FIFO_SIZE = 16 };

static RTS_UI32 room; /* of the FIFO, when it was empty, less what was sent since */

void UartInterrupt(void)
{
    (void)UART_FCR;
    OneUartInterrupt();
}

/* There is no pin for the direction. */
bool UartStart(const SYSCOM_SETTINGS *settings)
{
    enum { MOST_DIVISOR = 0xFFFF };
    RTS_UI32 divisor = settings->baud != 0 ? UART_CLOCK / 16 / settings->baud : 0;
    RTS_UI32 frame = LCR_8 | (settings->stop_bits == 2 ? LCR_STOP_2 : 0);
    if (divisor == 0 || divisor > MOST_DIVISOR || settings->rs485)
        return false;
    if (settings->parity != SYSCOM_PARITY_NONE)
        frame |= LCR_PARITY | (settings->parity == SYSCOM_PARITY_EVEN ? LCR_EVEN : 0);
    UART_LCR = LCR_DIVISOR;
    UART_DATA = (RTS_UI8)divisor;
    UART_IER = (RTS_UI8)(divisor >> 8);
    UART_LCR = (RTS_UI8)frame;
    UART_FCR = FCR_ON_AND_EMPTY;
    room = 0;
    UART_IER = IER_RX_TX;
    return true;
}

void UartStop(void)
{
    UART_LCR = 0;
    UART_IER = 0;
}

bool UartIsOn(void)
{
    return UART_IER != 0;
}

bool UartTake(RTS_UI8 *byte)
{
    if ((UART_LSR & LSR_RECEIVED) == 0)
        return false;
    *byte = UART_DATA;
    return true;
}

bool UartHasRoom(void)
{
    if ((UART_LSR & LSR_FIFO_EMPTY) != 0)
        room = FIFO_SIZE;
    return room != 0;
}

void UartSend(RTS_UI8 byte)
{
    room--;
    UART_DATA = byte;
}
