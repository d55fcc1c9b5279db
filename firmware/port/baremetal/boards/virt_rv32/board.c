/*
 * board.c - QEMU's virt: interrupt controller, watchdog, reset, identity.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysTarget.h"

/* The PLIC: machine mode of hart 0 is its context 0. */
#define PLIC 0x0C000000u
#define PLIC_PRIORITY(source) REG32(PLIC + 4u * (source))
#define PLIC_ENABLE REG32(PLIC + 0x2000u)
#define PLIC_THRESHOLD REG32(PLIC + 0x200000u)
#define PLIC_CLAIM REG32(PLIC + 0x200004u)

/* The real-time clock of a Goldfish: an alarm that has nothing to do with the clock of the hart. */
#define RTC 0x00101000u
#define RTC_TIME_LOW REG32(RTC + 0x00)
#define RTC_TIME_HIGH REG32(RTC + 0x04)
#define RTC_ALARM_LOW REG32(RTC + 0x08)
#define RTC_ALARM_HIGH REG32(RTC + 0x0C)
#define RTC_IRQ_ENABLED REG32(RTC + 0x10)
#define RTC_CLEAR_ALARM REG32(RTC + 0x14)
#define RTC_CLEAR_INTERRUPT REG32(RTC + 0x1C)

#define TEST_DEVICE REG32(0x00100000u)

enum { IRQ_UART = 10, IRQ_RTC = 11, TEST_RESET = 0x7777, NS_PER_MS = 1000000 };

static RTS_UI32 watchdog_ms;

void BoardInit(void)
{
    RTC_CLEAR_ALARM = 1;
    RTC_CLEAR_INTERRUPT = 1;
    PLIC_PRIORITY(IRQ_UART) = 1;
    PLIC_PRIORITY(IRQ_RTC) = 1;
    PLIC_THRESHOLD = 0;
    PLIC_ENABLE = 1u << IRQ_UART | 1u << IRQ_RTC;
}

void BoardInterrupt(RTS_UI32 pc)
{
    RTS_UI32 source = PLIC_CLAIM;
    if (source == IRQ_UART)
        UartInterrupt();
    else if (source == IRQ_RTC)
        ResetNow(RESET_WATCHDOG, pc);
    PLIC_CLAIM = source;
}

void CpuReset(void)
{
    TEST_DEVICE = TEST_RESET;
}

/* There is no watchdog: the alarm of the real-time clock, which all but masked interrupts cannot keep away. */
void BoardWatchdogStart(RTS_UI32 ms)
{
    watchdog_ms = ms;
    RTC_IRQ_ENABLED = 1;
    BoardWatchdogKick();
}

void BoardWatchdogKick(void)
{
    RTS_UI64 due = RTC_TIME_LOW; /* latches the upper half */
    due |= (RTS_UI64)RTC_TIME_HIGH << 32;
    due += (RTS_UI64)watchdog_ms * NS_PER_MS;
    RTC_ALARM_HIGH = (RTS_UI32)(due >> 32);
    RTC_ALARM_LOW = (RTS_UI32)due;
}

void BoardRunLamp(bool on)
{
    RTS_UNUSED(on); /* it has none */
}

const SYS_TARGET *SysTargetGet(void)
{
    static const SYS_TARGET target = {
        .type = TARGET_TYPE_PROGRAMMABLE,
        .id = BOARD_DEVICE_ID,
        .version = 0x01000000,
        .device_name = BOARD_DEVICE_NAME,
        .vendor_name = BOARD_VENDOR_NAME,
        .node_name = BOARD_NODE_NAME,
        .serial_number = "0", /* nothing in it that differs from one to the next */
    };
    return &target;
}
