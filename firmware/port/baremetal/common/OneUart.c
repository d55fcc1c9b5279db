/*
 * OneUart.c - SysCom on the one UART of a board, interrupt driven with ring buffers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "OneUart.h"

#include <string.h>

#include "BareMetal.h"
#include "SysTime.h"
#include "rts_config.h"

enum { UART_BAUD = 115200 };

/* Empty when head == tail; positions run freely and are masked on use. A byte is stored before the head passes it: all
 * of it is volatile, so that the compiler keeps that order for the interrupt. */
static volatile struct {
    RTS_UI16 rx_head, rx_tail, tx_head, tx_tail;
    bool work;
    RTS_UI8 rx[BOARD_UART_RX_SIZE];
    RTS_UI8 tx[BOARD_UART_TX_SIZE];
} line;

static RTS_I64 byte_ns; /* SYSCOM_BYTE_TIMES */

RTS_STATIC_ASSERT((BOARD_UART_RX_SIZE & (BOARD_UART_RX_SIZE - 1)) == 0, rx_size_is_a_power_of_two);
RTS_STATIC_ASSERT((BOARD_UART_TX_SIZE & (BOARD_UART_TX_SIZE - 1)) == 0, tx_size_is_a_power_of_two);

/* A byte that finds no room is lost; the frame's check sum shows it. */
static void receive(void)
{
    RTS_UI8 byte;
    if (SYSCOM_BYTE_TIMES)
        byte_ns = SysTimeGetNs();
    while (UartTake(&byte)) {
        if ((RTS_UI16)(line.rx_head - line.rx_tail) < BOARD_UART_RX_SIZE) {
            line.rx[line.rx_head % BOARD_UART_RX_SIZE] = byte;
            line.rx_head++;
        }
        line.work = true;
    }
}

static void transmit(void)
{
    while (line.tx_head != line.tx_tail && UartHasRoom()) {
        UartSend(line.tx[line.tx_tail % BOARD_UART_TX_SIZE]);
        line.tx_tail++;
        line.work = true;
    }
}

void OneUartInterrupt(void)
{
    receive();
    transmit();
}

void OneUartNoteWork(void)
{
    line.work = true;
}

bool BoardHasWork(void)
{
    bool was = line.work;
    line.work = false;
    return was;
}

RTS_UI32 SysComGetCount(void)
{
    return 1;
}

static RTS_RESULT open_line(const SYSCOM_SETTINGS *settings)
{
    UartStop();
    line.rx_tail = line.rx_head;
    line.tx_tail = line.tx_head;
    return UartStart(settings) ? ERR_OK : ERR_NOT_SUPPORTED;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    static const SYSCOM_SETTINGS settings = {UART_BAUD, SYSCOM_PARITY_NONE, 1, false};
    return index == 0 ? open_line(&settings) : ERR_DEVICE;
}

/* "COM1", if no block driver has it. */
RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    *index = 0;
    if (strcmp(name, "COM1") != 0)
        return ERR_NO_OBJECT;
    return UartIsOn() ? ERR_DUPLICATE : open_line(settings);
}

void SysComClose(RTS_UI32 index)
{
    if (index == 0)
        UartStop();
}

void SysComDiscard(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

RTS_I64 SysComGetByteNs(RTS_UI32 index)
{
    RTS_UI32 mask = CpuMask();
    RTS_I64 last_ns = index == 0 ? byte_ns : 0;
    CpuRestore(mask);
    return last_ns;
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = 0;
    while (index == 0 && count < size && line.rx_head != line.rx_tail) {
        data[count++] = line.rx[line.rx_tail % BOARD_UART_RX_SIZE];
        line.rx_tail++;
    }
    return count;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = 0;
    while (index == 0 && count < size && (RTS_UI16)(line.tx_head - line.tx_tail) < BOARD_UART_TX_SIZE) {
        line.tx[line.tx_head % BOARD_UART_TX_SIZE] = data[count++];
        line.tx_head++;
    }
    RTS_UI32 mask = CpuMask();
    transmit(); /* the interrupt comes only after bytes have left */
    CpuRestore(mask);
    return count;
}
