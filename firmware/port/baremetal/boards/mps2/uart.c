/*
 * uart.c - SysCom on the CMSDK UARTs, interrupt driven with ring buffers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CortexM.h"
#include "SysCom.h"

enum { UART_BAUD = 115200 };
enum { STATE_TX_FULL = 1 };
enum { CTRL_ALL = 0xF }; /* transmit, receive, and their interrupts */
enum { INT_TX = 1, INT_RX = 2 };

typedef struct {
    volatile RTS_UI32 data, state, ctrl, intclear, bauddiv;
} UART;

/* A ring is empty when head == tail; positions run freely and are masked on use. */
typedef struct {
    volatile RTS_UI16 head, tail;
} RING;

typedef struct {
    RING rx, tx;
    RTS_UI8 rx_data[BOARD_UART_RX_SIZE];
    RTS_UI8 tx_data[BOARD_UART_TX_SIZE];
} LINE;

RTS_STATIC_ASSERT((BOARD_UART_RX_SIZE & (BOARD_UART_RX_SIZE - 1)) == 0, rx_size_is_a_power_of_two);
RTS_STATIC_ASSERT((BOARD_UART_TX_SIZE & (BOARD_UART_TX_SIZE - 1)) == 0, tx_size_is_a_power_of_two);

static UART *const uarts[] = {(UART *)0x40004000u, (UART *)0x40005000u};
static LINE lines[BOARD_UART_COUNT];
static volatile bool work;

static RTS_UI16 used(const RING *ring)
{
    return (RTS_UI16)(ring->head - ring->tail);
}

/* The hardware holds one byte: the next one is the next interrupt. */
static void receive(RTS_UI32 index)
{
    LINE *line = &lines[index];
    uarts[index]->intclear = INT_RX;
    RTS_UI8 byte = (RTS_UI8)uarts[index]->data;
    work = true;
    if (used(&line->rx) == BOARD_UART_RX_SIZE)
        return; /* lost; the frame's check sum shows it */
    line->rx_data[line->rx.head % BOARD_UART_RX_SIZE] = byte;
    line->rx.head++;
}

static void transmit(RTS_UI32 index)
{
    LINE *line = &lines[index];
    uarts[index]->intclear = INT_TX;
    if (used(&line->tx) == 0 || (uarts[index]->state & STATE_TX_FULL))
        return;
    uarts[index]->data = line->tx_data[line->tx.tail % BOARD_UART_TX_SIZE];
    line->tx.tail++;
    work = true;
}

void Uart0RxIrq(void)
{
    receive(0);
}

void Uart0TxIrq(void)
{
    transmit(0);
}

#if BOARD_UART_COUNT > 1
void Uart1RxIrq(void)
{
    receive(1);
}

void Uart1TxIrq(void)
{
    transmit(1);
}
#endif

void UartInit(void)
{
    for (RTS_UI32 i = 0; i < BOARD_UART_COUNT; i++) {
        IrqEnable(IRQ_UART0_RX + 2 * i, LEVEL_DEVICE);
        IrqEnable(IRQ_UART0_TX + 2 * i, LEVEL_DEVICE);
    }
}

bool BoardHasWork(void)
{
    bool was = work;
    work = false;
    return was;
}

RTS_UI32 SysComGetCount(void)
{
    return BOARD_UART_COUNT;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    if (index >= BOARD_UART_COUNT)
        return ERR_DEVICE;
    lines[index].rx = (RING){0, 0};
    lines[index].tx = (RING){0, 0};
    uarts[index]->bauddiv = BOARD_CLOCK_HZ / UART_BAUD;
    uarts[index]->ctrl = CTRL_ALL;
    return ERR_OK;
}

void SysComClose(RTS_UI32 index)
{
    if (index < BOARD_UART_COUNT)
        uarts[index]->ctrl = 0;
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    if (index >= BOARD_UART_COUNT)
        return 0;
    LINE *line = &lines[index];
    RTS_UI32 count = 0;
    while (count < size && used(&line->rx)) {
        data[count++] = line->rx_data[line->rx.tail % BOARD_UART_RX_SIZE];
        line->rx.tail++;
    }
    return count;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    if (index >= BOARD_UART_COUNT)
        return 0;
    LINE *line = &lines[index];
    RTS_UI32 count = 0;
    while (count < size && used(&line->tx) < BOARD_UART_TX_SIZE) {
        line->tx_data[line->tx.head % BOARD_UART_TX_SIZE] = data[count++];
        line->tx.head++;
    }
    RTS_UI32 mask = CpuMask();
    transmit(index); /* the interrupt comes only after a byte has left */
    CpuRestore(mask);
    return count;
}
