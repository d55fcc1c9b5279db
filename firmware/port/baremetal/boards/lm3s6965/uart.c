/*
 * uart.c - SysCom on UART0 (a PL011 with FIFOs), interrupt driven with ring buffers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CortexM.h"
#include "SysCom.h"
#include "SysTime.h"
#include "rts_config.h"

#include <string.h>

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

enum { UART_BAUD = 115200, PINS = 3 };
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

/* Empty when head == tail; positions run freely and are masked on use. */
static struct {
    volatile RTS_UI16 rx_head, rx_tail, tx_head, tx_tail;
    volatile bool work;
    RTS_UI8 rx[BOARD_UART_RX_SIZE];
    RTS_UI8 tx[BOARD_UART_TX_SIZE];
} line;

static RTS_I64 byte_ns; /* SYSCOM_BYTE_TIMES */

RTS_STATIC_ASSERT((BOARD_UART_RX_SIZE & (BOARD_UART_RX_SIZE - 1)) == 0, rx_size_is_a_power_of_two);
RTS_STATIC_ASSERT((BOARD_UART_TX_SIZE & (BOARD_UART_TX_SIZE - 1)) == 0, tx_size_is_a_power_of_two);

/* A byte that finds no room is lost; the frame's check sum shows it. */
static void receive(void)
{
    if (SYSCOM_BYTE_TIMES)
        byte_ns = SysTimeGetNs();
    while ((UART_FR & FR_RX_EMPTY) == 0) {
        RTS_UI8 byte = (RTS_UI8)UART_DR;
        if ((RTS_UI16)(line.rx_head - line.rx_tail) < BOARD_UART_RX_SIZE)
            line.rx[line.rx_head++ % BOARD_UART_RX_SIZE] = byte;
        line.work = true;
    }
}

static void transmit(void)
{
    while (line.tx_head != line.tx_tail && (UART_FR & FR_TX_FULL) == 0) {
        UART_DR = line.tx[line.tx_tail++ % BOARD_UART_TX_SIZE];
        line.work = true;
    }
}

void UartIrq(void)
{
    UART_ICR = INT_RX | INT_TX | INT_RX_TIMEOUT;
    receive();
    transmit();
}

void UartInit(void)
{
    PORT_A_AFSEL |= PINS;
    PORT_A_DEN |= PINS;
    IrqEnable(IRQ_UART0, LEVEL_DEVICE);
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

/* Clock / 16 / baud, in 64ths. */
static void open_line(RTS_UI32 divisor_64, RTS_UI32 frame)
{
    UART_CTL = 0;
    UART_LCRH = 0; /* empties the FIFOs */
    line.rx_tail = line.rx_head;
    line.tx_tail = line.tx_head;
    UART_IBRD = divisor_64 / 64;
    UART_FBRD = divisor_64 % 64;
    UART_LCRH = LCRH_FIFOS_8N1 | frame;
    UART_IM = INT_RX | INT_TX | INT_RX_TIMEOUT;
    UART_CTL = CTL_ON;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    enum { DIVISOR_64 = (BOARD_CLOCK_HZ * 4 + UART_BAUD / 2) / UART_BAUD };
    if (index != 0)
        return ERR_DEVICE;
    open_line(DIVISOR_64, 0);
    return ERR_OK;
}

/* "COM1", if no block driver has it. There is no pin for the direction. */
RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    enum { LEAST_DIVISOR_64 = 64, MOST_DIVISOR_64 = 0x3FFFFF };
    RTS_UI32 divisor_64 = settings->baud != 0 ? (BOARD_CLOCK_HZ * 4 + settings->baud / 2) / settings->baud : 0;
    RTS_UI32 frame = settings->stop_bits == 2 ? LCRH_STOP_2 : 0;
    *index = 0;
    if (strcmp(name, "COM1") != 0)
        return ERR_NO_OBJECT;
    if ((UART_CTL & CTL_ON) == CTL_ON)
        return ERR_DUPLICATE;
    if (divisor_64 < LEAST_DIVISOR_64 || divisor_64 > MOST_DIVISOR_64 || settings->rs485)
        return ERR_NOT_SUPPORTED;
    if (settings->parity != SYSCOM_PARITY_NONE)
        frame |= LCRH_PARITY | (settings->parity == SYSCOM_PARITY_EVEN ? LCRH_EVEN : 0);
    open_line(divisor_64, frame);
    return ERR_OK;
}

void SysComClose(RTS_UI32 index)
{
    if (index == 0)
        UART_CTL = 0;
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
    while (index == 0 && count < size && line.rx_head != line.rx_tail)
        data[count++] = line.rx[line.rx_tail++ % BOARD_UART_RX_SIZE];
    return count;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = 0;
    while (index == 0 && count < size && (RTS_UI16)(line.tx_head - line.tx_tail) < BOARD_UART_TX_SIZE)
        line.tx[line.tx_head++ % BOARD_UART_TX_SIZE] = data[count++];
    RTS_UI32 mask = CpuMask();
    transmit(); /* the interrupt comes only after bytes have left */
    CpuRestore(mask);
    return count;
}
