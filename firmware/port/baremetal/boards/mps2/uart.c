/*
 * uart.c - SysCom on the CMSDK UARTs, interrupt driven with ring buffers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysCom.h"
#include "SysTime.h"
#include "rts_config.h"

#include <string.h>

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

/* The data is volatile as the positions are, so that a byte is stored before the head passes it. */
typedef struct {
    RING rx, tx;
    volatile RTS_UI8 rx_data[BOARD_UART_RX_SIZE];
    volatile RTS_UI8 tx_data[BOARD_UART_TX_SIZE];
} LINE;

RTS_STATIC_ASSERT((BOARD_UART_RX_SIZE & (BOARD_UART_RX_SIZE - 1)) == 0, rx_size_is_a_power_of_two);
RTS_STATIC_ASSERT((BOARD_UART_TX_SIZE & (BOARD_UART_TX_SIZE - 1)) == 0, tx_size_is_a_power_of_two);

static UART *const uarts[] = {(UART *)0x40004000u, (UART *)0x40005000u};
static LINE lines[BOARD_UART_COUNT];
static volatile bool work;
static RTS_I64 byte_ns[BOARD_UART_COUNT]; /* SYSCOM_BYTE_TIMES */

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
    if (SYSCOM_BYTE_TIMES)
        byte_ns[index] = SysTimeGetNs();
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

static void open_line(RTS_UI32 index, RTS_UI32 divider)
{
    lines[index].rx = (RING){0, 0};
    lines[index].tx = (RING){0, 0};
    uarts[index]->bauddiv = divider;
    uarts[index]->ctrl = CTRL_ALL;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    if (index >= BOARD_UART_COUNT)
        return ERR_DEVICE;
    open_line(index, BOARD_CLOCK_HZ / UART_BAUD);
    return ERR_OK;
}

/* "COM1" and "COM2". These UARTs have no parity, one stop bit, no pin for the direction, and divide by 16 or more. */
RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    enum { NUMBER = 3, LEAST_DIVIDER = 16, MOST_DIVIDER = 0xFFFFF };
    RTS_UI32 divider = settings->baud != 0 ? BOARD_CLOCK_HZ / settings->baud : 0;
    *index = memcmp(name, "COM", NUMBER) == 0 ? (RTS_UI32)(name[NUMBER] - '1') : BOARD_UART_COUNT;
    if (*index >= BOARD_UART_COUNT || name[NUMBER + 1] != '\0')
        return ERR_NO_OBJECT;
    if (uarts[*index]->ctrl != 0)
        return ERR_DUPLICATE;
    if (divider < LEAST_DIVIDER || divider > MOST_DIVIDER || settings->parity != SYSCOM_PARITY_NONE ||
        settings->stop_bits != 1 || settings->rs485)
        return ERR_NOT_SUPPORTED;
    open_line(*index, divider);
    return ERR_OK;
}

void SysComClose(RTS_UI32 index)
{
    if (index < BOARD_UART_COUNT)
        uarts[index]->ctrl = 0;
}

void SysComDiscard(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

RTS_I64 SysComGetByteNs(RTS_UI32 index)
{
    RTS_UI32 mask = CpuMask();
    RTS_I64 last_ns = index < BOARD_UART_COUNT ? byte_ns[index] : 0;
    CpuRestore(mask);
    return last_ns;
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
