/*
 * uart.c - USART1 at PA9 and PB7, which has no FIFO, for OneUart.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "OneUart.h"

#define USART1 0x40011000u
#define USART_SR REG32(USART1 + 0x00)
#define USART_DR REG32(USART1 + 0x04)
#define USART_BRR REG32(USART1 + 0x08)
#define USART_CR1 REG32(USART1 + 0x0C)
#define USART_CR2 REG32(USART1 + 0x10)
#define RCC_AHB1ENR REG32(0x40023830u)
#define RCC_APB2ENR REG32(0x40023844u)
#define GPIOA 0x40020000u
#define GPIOB 0x40020400u
#define GPIO_MODER(port) REG32((port) + 0x00)
#define GPIO_AFR(port, pin) REG32((port) + 0x20 + (pin) / 8 * 4)

enum { USART_CLOCK = 84000000, LEAST_DIVISOR = 16, MOST_DIVISOR = 0xFFFF };
enum { SR_OVERRUN = 1 << 3, SR_RECEIVED = 1 << 5, SR_ROOM = 1 << 7 };
enum { CR1_ON = 1 << 13 | 1 << 3 | 1 << 2, CR1_IRQ_RECEIVED = 1 << 5, CR1_IRQ_ROOM = 1 << 7 };
enum { CR1_9_BITS = 1 << 12, CR1_PARITY = 1 << 10, CR1_ODD = 1 << 9, CR2_STOP_2 = 2 << 12 };

static void give_pin(RTS_UI32 port, RTS_UI32 pin)
{
    enum { ALTERNATE = 2, AF_USART1 = 7 };
    GPIO_MODER(port) = (GPIO_MODER(port) & ~(3u << 2 * pin)) | (RTS_UI32)ALTERNATE << 2 * pin;
    GPIO_AFR(port, pin) = (GPIO_AFR(port, pin) & ~(0xFu << pin % 8 * 4)) | (RTS_UI32)AF_USART1 << pin % 8 * 4;
}

void UartInit(void)
{
    enum { AHB1_GPIOA_GPIOB = 3, APB2_USART1 = 1 << 4, TX_PIN = 9, RX_PIN = 7 };
    RCC_AHB1ENR |= AHB1_GPIOA_GPIOB;
    RCC_APB2ENR |= APB2_USART1;
    (void)RCC_APB2ENR; /* as in start_timers of board.c */
    give_pin(GPIOA, TX_PIN);
    give_pin(GPIOB, RX_PIN);
    IrqEnable(IRQ_USART1, LEVEL_DEVICE);
}

/* Room to send interrupts as long as there is some: each byte that is sent asks for the next interrupt, and a received
 * byte in between does not take that back. */
void UartIrq(void)
{
    if (UartHasRoom())
        USART_CR1 &= ~(RTS_UI32)CR1_IRQ_ROOM;
    OneUartInterrupt();
}

/* There is no pin for the direction. */
bool UartStart(const SYSCOM_SETTINGS *settings)
{
    RTS_UI32 divisor = settings->baud != 0 ? (USART_CLOCK + settings->baud / 2) / settings->baud : 0;
    RTS_UI32 frame = 0;
    if (divisor < LEAST_DIVISOR || divisor > MOST_DIVISOR || settings->rs485)
        return false;
    if (settings->parity != SYSCOM_PARITY_NONE)
        frame = CR1_9_BITS | CR1_PARITY | (settings->parity == SYSCOM_PARITY_ODD ? CR1_ODD : 0);
    USART_BRR = divisor;
    USART_CR2 = settings->stop_bits == 2 ? CR2_STOP_2 : 0;
    (void)USART_DR; /* what came before */
    USART_CR1 = CR1_ON | CR1_IRQ_RECEIVED | frame;
    return true;
}

void UartStop(void)
{
    USART_CR1 = 0;
}

bool UartIsOn(void)
{
    return USART_CR1 != 0;
}

bool UartTake(RTS_UI8 *byte)
{
    RTS_UI32 status = USART_SR;
    if ((status & (SR_RECEIVED | SR_OVERRUN)) == 0)
        return false;
    *byte = (RTS_UI8)USART_DR; /* an overrun interrupts until this is read, also without a byte */
    return (status & SR_RECEIVED) != 0;
}

bool UartHasRoom(void)
{
    return (USART_SR & SR_ROOM) != 0;
}

void UartSend(RTS_UI8 byte)
{
    USART_DR = byte;
    USART_CR1 |= CR1_IRQ_ROOM;
}
