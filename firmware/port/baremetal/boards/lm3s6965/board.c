/*
 * board.c - LM3S6965: clock, alarm timer, watchdog, identity.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysTarget.h"

#define SYSCTL_RIS REG32(0x400FE050u)
#define SYSCTL_RESC REG32(0x400FE05Cu)
#define SYSCTL_RCC REG32(0x400FE060u)
#define SYSCTL_RCGC0 REG32(0x400FE100u)
#define SYSCTL_RCGC1 REG32(0x400FE104u)
#define SYSCTL_RCGC2 REG32(0x400FE108u)
#define USER_REG(n) REG32(0x400FE1E0u + 4u * (n))
#define TIMER0 0x40030000u
#define TIMER_TAMR REG32(TIMER0 + 0x04)
#define TIMER_CTL REG32(TIMER0 + 0x0C)
#define TIMER_IMR REG32(TIMER0 + 0x18)
#define TIMER_ICR REG32(TIMER0 + 0x24)
#define TIMER_TAILR REG32(TIMER0 + 0x28)
#define WATCHDOG 0x40000000u
#define WATCHDOG_LOAD REG32(WATCHDOG + 0x00)
#define WATCHDOG_CTL REG32(WATCHDOG + 0x08)
#define WATCHDOG_ICR REG32(WATCHDOG + 0x0C)
#define PORT_F 0x40025000u
#define PORT_F_DATA(pins) REG32(PORT_F + ((pins) << 2))
#define PORT_F_DIR REG32(PORT_F + 0x400)
#define PORT_F_DEN REG32(PORT_F + 0x51C)

enum { RCC_PWRDN = 1 << 13, RCC_BYPASS = 1 << 11, RCC_USESYSDIV = 1 << 22, RCC_DIV_4 = 3 << 23, RCC_8MHZ = 14 << 6 };
enum { RIS_PLL_LOCKED = 1 << 6, RESC_WATCHDOG = 1 << 3 };
enum { RCGC0_WATCHDOG = 1 << 3, RCGC1_UART0_I2CS_TIMER0 = 1 << 0 | 5 << 12 | 1 << 16, RCGC2_PORTS_A_B_F = 3 | 1 << 5 };
enum { TIMER_ONE_SHOT = 1, TIMER_TIME_OUT = 1, WATCHDOG_INTEN_RESEN = 3, STATUS_LED = 1 << 0 };

/* Where nothing is there is a bus fault; not in QEMU, which swallows writes. Below the RAM a large frame would pass all
 * stacks unnoticed; the upper half of the addresses is where wild pointers lead. */
enum { MPU_BELOW_RAM = MPU_BOARD, MPU_UPPER_HALF = MPU_BOARD + 1 };
RTS_STATIC_ASSERT(MPU_UPPER_HALF < 8, the_mpu_has_two_regions_left);

/* 200 MHz of the PLL, from the crystal of 8 MHz, divided by 4. */
static void start_clock(void)
{
    SYSCTL_RCC = RCC_BYPASS | RCC_PWRDN | RCC_8MHZ;
    SYSCTL_RCC = RCC_BYPASS | RCC_8MHZ | RCC_USESYSDIV | RCC_DIV_4;
    while ((SYSCTL_RIS & RIS_PLL_LOCKED) == 0)
        ;
    SYSCTL_RCC = RCC_8MHZ | RCC_USESYSDIV | RCC_DIV_4;
}

void BoardInit(void)
{
    start_clock();
    if ((SYSCTL_RESC & RESC_WATCHDOG) != 0)
        ResetSetCause(RESET_WATCHDOG);
    SYSCTL_RESC = 0;
    SYSCTL_RCGC0 |= RCGC0_WATCHDOG;
    SYSCTL_RCGC1 |= RCGC1_UART0_I2CS_TIMER0;
    SYSCTL_RCGC2 |= RCGC2_PORTS_A_B_F;
    TIMER_TAMR = TIMER_ONE_SHOT;
    TIMER_IMR = TIMER_TIME_OUT;
    IrqEnable(IRQ_TIMER0A, LEVEL_DEVICE);
    IrqEnable(IRQ_WATCHDOG, LEVEL_DEVICE);
    MpuProtect(MPU_BELOW_RAM, 0x1FFF0000u, 16, MPU_NO_ACCESS);
    MpuProtect(MPU_UPPER_HALF, 0x80000000u, 31, MPU_NO_ACCESS);
    UartInit();
    EepromInit();
}

void BoardAlarmSet(RTS_UI32 ns)
{
    TIMER_CTL = 0;
    TIMER_TAILR = ns / (1000000000u / BOARD_CLOCK_HZ) + 1;
    TIMER_CTL = 1;
}

void AlarmIrq(void)
{
    TIMER_ICR = TIMER_TIME_OUT;
    SysTimerAlarm();
}

/* The first time-out interrupts, the second one resets. */
void BoardWatchdogStart(RTS_UI32 ms)
{
    WATCHDOG_LOAD = ms * (BOARD_CLOCK_HZ / 1000);
    WATCHDOG_CTL = WATCHDOG_INTEN_RESEN;
}

void BoardWatchdogKick(void)
{
    WATCHDOG_ICR = 1;
}

void BoardRunLamp(bool on)
{
    PORT_F_DIR |= STATUS_LED;
    PORT_F_DEN |= STATUS_LED;
    PORT_F_DATA(STATUS_LED) = on ? STATUS_LED : 0;
}

/* ---- identity ---- */

/* The Ethernet address, which the factory leaves in two registers of 24 bits each, lowest byte first. */
static const char *read_serial_number(void)
{
    static char number[13];
    for (RTS_UI32 i = 0; i < 12; i++) {
        RTS_UI32 byte = USER_REG(i / 6) >> (i / 2 % 3 * 8);
        number[i] = "0123456789ABCDEF"[(i % 2 ? byte : byte >> 4) & 0xF];
    }
    return number;
}

const SYS_TARGET *SysTargetGet(void)
{
    static SYS_TARGET target = {
        .type = TARGET_TYPE_PROGRAMMABLE,
        .id = BOARD_DEVICE_ID,
        .version = 0x01000000,
        .device_name = BOARD_DEVICE_NAME,
        .vendor_name = BOARD_VENDOR_NAME,
        .node_name = BOARD_NODE_NAME,
    };
    if (target.serial_number == NULL)
        target.serial_number = read_serial_number();
    return &target;
}
