/*
 * board.c - STM32F405: clock, alarm timer, watchdog, lamp, identity.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * QEMU's netduinoplus2 has the processor, USART1 and the timers, at another rate and without the interrupt of this alarm;
 * clock tree, flash controller, watchdog and pins are not there: what is written is ignored, and 0 is read.
 */
#include "BareMetal.h"
#include "SysTarget.h"

#define RCC_CR REG32(0x40023800u)
#define RCC_PLLCFGR REG32(0x40023804u)
#define RCC_CFGR REG32(0x40023808u)
#define RCC_AHB1ENR REG32(0x40023830u)
#define RCC_APB1ENR REG32(0x40023840u)
#define RCC_CSR REG32(0x40023874u)
#define FLASH_ACR REG32(0x40023C00u)
#define TIM2 0x40000000u
#define TIM5 0x40000C00u
#define TIM_CR1(timer) REG32((timer) + 0x00)
#define TIM_DIER(timer) REG32((timer) + 0x0C)
#define TIM_SR(timer) REG32((timer) + 0x10)
#define TIM_EGR(timer) REG32((timer) + 0x14)
#define TIM_CNT(timer) REG32((timer) + 0x24)
#define TIM_PSC(timer) REG32((timer) + 0x28)
#define TIM_ARR(timer) REG32((timer) + 0x2C)
#define IWDG_KR REG32(0x40003000u)
#define IWDG_PR REG32(0x40003004u)
#define IWDG_RLR REG32(0x40003008u)
#define GPIOA_MODER REG32(0x40020000u)
#define GPIOA_BSRR REG32(0x40020018u)

enum { CR_HSEON = 1 << 16, CR_HSERDY = 1 << 17, CR_PLLON = 1 << 24, CR_PLLRDY = 1 << 25 };
/* 1 MHz * 336 / 2 = 168 MHz; / 7 = 48 MHz: from the crystal of 25 MHz, or the oscillator of 16 MHz in the chip. */
enum { PLL_168MHZ = 336 << 6 | 0 << 16 | 7 << 24, PLL_OF_CRYSTAL = 25 | 1 << 22, PLL_OF_CHIP = 16 };
enum { CFGR_APB1_42MHZ_APB2_84MHZ = 5 << 10 | 4 << 13, CFGR_PLL = 2, CFGR_ON_PLL = 2 << 2 };
enum { ACR_5_WAIT_STATES_AND_CACHES = 5 | 7 << 8 };
enum { CSR_WATCHDOG = 1 << 29, CSR_FORGET = 1 << 24 };
enum { CR1_ENABLE = 1, CR1_ONE_PULSE = 1 << 3, DIER_UPDATE = 1, EGR_UPDATE = 1 };
enum { TIMER_CLOCK_MHZ = 84 };
enum { LAMP_PIN = 10 };
enum { CLOCK_TRIES = 100000 }; /* some 10 ms */

static bool wait_for(volatile RTS_UI32 *word, RTS_UI32 bits, RTS_UI32 value)
{
    for (RTS_UI32 i = 0; i < CLOCK_TRIES && (*word & bits) != value; i++)
        ;
    return (*word & bits) == value;
}

/* Without the crystal the rate is the same, within 1 % at room temperature. */
static void start_clock(void)
{
    RCC_CR |= CR_HSEON;
    RCC_PLLCFGR = PLL_168MHZ | (wait_for(&RCC_CR, CR_HSERDY, CR_HSERDY) ? PLL_OF_CRYSTAL : PLL_OF_CHIP);
    RCC_CR |= CR_PLLON;
    wait_for(&RCC_CR, CR_PLLRDY, CR_PLLRDY);
    FLASH_ACR = ACR_5_WAIT_STATES_AND_CACHES;
    RCC_CFGR = CFGR_APB1_42MHZ_APB2_84MHZ | CFGR_PLL;
    wait_for(&RCC_CFGR, CFGR_ON_PLL, CFGR_ON_PLL);
}

static void start_timers(void)
{
    enum { APB1_TIM2 = 1 << 0, APB1_TIM5 = 1 << 3 };
    RCC_APB1ENR |= APB1_TIM2 | APB1_TIM5;
    (void)RCC_APB1ENR; /* a device may miss a write right after it is switched on (errata sheet of the chip) */
    TIM_PSC(TIM2) = TIMER_CLOCK_MHZ - 1;
    TIM_ARR(TIM2) = 0xFFFFFFFFu;
    TIM_EGR(TIM2) = EGR_UPDATE;
    TIM_CR1(TIM2) = CR1_ENABLE;
    TIM_DIER(TIM5) = DIER_UPDATE;
    IrqEnable(IRQ_TIM5, LEVEL_DEVICE);
}

void BoardInit(void)
{
    enum { AHB1_GPIOA = 1 << 0 };
    start_clock();
    if ((RCC_CSR & CSR_WATCHDOG) != 0)
        ResetSetCause(RESET_WATCHDOG);
    RCC_CSR |= CSR_FORGET;
    RCC_AHB1ENR |= AHB1_GPIOA;
    start_timers();
    UartInit();
}

RTS_UI32 BoardMicroseconds(void)
{
    return TIM_CNT(TIM2);
}

/* When it ends is set last, while it counts: QEMU forgets a time that is over before the timer is on. If what was set
 * before ends it in between, the alarm is early. If the counter has passed the new end by then, it is now. */
void BoardAlarmSet(RTS_UI32 ns)
{
    enum { STEP_NS = 125, TICKS_OF_TWO_STEPS = 2 * STEP_NS * TIMER_CLOCK_MHZ / 1000 };
    RTS_UI32 end = ns / STEP_NS * TICKS_OF_TWO_STEPS / 2 + 1;
    TIM_CR1(TIM5) = 0;
    TIM_CNT(TIM5) = 0;
    TIM_CR1(TIM5) = CR1_ENABLE | CR1_ONE_PULSE;
    TIM_ARR(TIM5) = end;
    if (TIM_CNT(TIM5) > end)
        TIM_EGR(TIM5) = EGR_UPDATE;
}

void AlarmIrq(void)
{
    TIM_CR1(TIM5) = 0;
    TIM_SR(TIM5) = 0;
    SysTimerAlarm();
}

/* 125 Hz, from an oscillator of its own. It does not warn before. */
void BoardWatchdogStart(RTS_UI32 ms)
{
    enum { ALLOW = 0x5555, START = 0xCCCC, BY_256 = 6, MS_PER_COUNT = 8 };
    IWDG_KR = START;
    IWDG_KR = ALLOW;
    IWDG_PR = BY_256;
    IWDG_RLR = ms / MS_PER_COUNT;
    BoardWatchdogKick();
}

void BoardWatchdogKick(void)
{
    enum { KICK = 0xAAAA };
    IWDG_KR = KICK;
}

void BoardRunLamp(bool on)
{
    GPIOA_MODER = (GPIOA_MODER & ~(3u << 2 * LAMP_PIN)) | 1u << 2 * LAMP_PIN;
    GPIOA_BSRR = on ? 1u << LAMP_PIN : 1u << (LAMP_PIN + 16);
}

/* The chip has a number of its own at 0x1FFF7A10; QEMU has nothing there. */
const SYS_TARGET *SysTargetGet(void)
{
    static const SYS_TARGET target = {
        .type = TARGET_TYPE_PROGRAMMABLE,
        .id = BOARD_DEVICE_ID,
        .version = 0x01000000,
        .device_name = BOARD_DEVICE_NAME,
        .vendor_name = BOARD_VENDOR_NAME,
        .node_name = BOARD_NODE_NAME,
        .serial_number = "0",
    };
    return &target;
}
