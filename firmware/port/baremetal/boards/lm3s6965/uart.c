/*
 * uart.c - UART0, a PL011 with FIFOs, for OneUart.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "OneUart.h"

#define UART0 0x4000C000u
#define UART_DR REG32(UART0 + 0x00)
#define UART_FR REG32(UART0 + 0x18)
#define UART_IBRD REG32(UART0 + 0x24)
#define UART_FBRD REG32(UART0 + 0x28)
#define UART_LCRH REG32(UART0 + 0x2C)
#define UART_CTL REG32(UART0 + 0x30)
#define UART_IM REG32(UART0 + 0x38)
#define UART_ICR REG32(UART0 + 0x44)
#define PORT_A_AFSEL REG32(0x40004420u)
#define PORT_A_DEN REG32(0x4000451Cu)

enum { PINS = 3 };
enum {
    FR_RX_EMPTY = 1 << 4,
    FR_TX_FULL = 1 << 5,
    LCRH_FIFOS_8N1 = 7 << 4,
    LCRH_PARITY = 1 << 1,
    LCRH_EVEN = 1 << 2,
    LCRH_STOP_2 = 1 << 3
};
enum { CTL_ON = 3 << 8 | 1 };
enum { INT_RX = 1 << 4, INT_TX = 1 << 5, INT_RX_TIMEOUT = 1 << 6 };

void UartIrq(void)
{
    UART_ICR = INT_RX | INT_TX | INT_RX_TIMEOUT;
    OneUartInterrupt();
}

void UartInit(void)
{
    PORT_A_AFSEL |= PINS;
    PORT_A_DEN |= PINS;
    IrqEnable(IRQ_UART0, LEVEL_DEVICE);
}

/* Clock / 16 / baud, in 64ths. There is no pin for the direction. */
bool UartStart(const SYSCOM_SETTINGS *settings)
{
    enum { LEAST_DIVISOR_64 = 64, MOST_DIVISOR_64 = 0x3FFFFF };
    RTS_UI32 divisor_64 = settings->baud != 0 ? (BOARD_CLOCK_HZ * 4 + settings->baud / 2) / settings->baud : 0;
    RTS_UI32 frame = settings->stop_bits == 2 ? LCRH_STOP_2 : 0;
    if (divisor_64 < LEAST_DIVISOR_64 || divisor_64 > MOST_DIVISOR_64 || settings->rs485)
        return false;
    if (settings->parity != SYSCOM_PARITY_NONE)
        frame |= LCRH_PARITY | (settings->parity == SYSCOM_PARITY_EVEN ? LCRH_EVEN : 0);
    UART_LCRH = 0; /* empties the FIFOs */
    UART_IBRD = divisor_64 / 64;
    UART_FBRD = divisor_64 % 64;
    UART_LCRH = LCRH_FIFOS_8N1 | frame;
    UART_IM = INT_RX | INT_TX | INT_RX_TIMEOUT;
    UART_CTL = CTL_ON;
    return true;
}

void UartStop(void)
{
    UART_CTL = 0;
}

bool UartIsOn(void)
{
    return (UART_CTL & CTL_ON) == CTL_ON;
}

bool UartTake(RTS_UI8 *byte)
{
    if ((UART_FR & FR_RX_EMPTY) != 0)
        return false;
    *byte = (RTS_UI8)UART_DR;
    return true;
}

bool UartHasRoom(void)
{
    return (UART_FR & FR_TX_FULL) == 0;
}

void UartSend(RTS_UI8 byte)
{
    UART_DR = byte;
}
