/*
 * board.c - MPS2: alarm timer, watchdog, identity.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppPowerFails.h"
#include "BareMetal.h"
#include "SysFlash.h"
#include "SysTarget.h"

#define TIMER0 0x40000000u
#define TIMER_CTRL REG32(TIMER0 + 0x0)
#define TIMER_RELOAD REG32(TIMER0 + 0x8)
#define TIMER_INTCLEAR REG32(TIMER0 + 0xC)
#define WATCHDOG 0x40008000u
#define WATCHDOG_LOAD REG32(WATCHDOG + 0x0)
#define WATCHDOG_CTRL REG32(WATCHDOG + 0x8)
#define WATCHDOG_INTCLR REG32(WATCHDOG + 0xC)
#define WATCHDOG_LOCK REG32(WATCHDOG + 0xC00)
#define SCC_LAMPS REG32(0x4002F004u) /* CFG1 */

#define RAM_BASE 0x20000000u
#if RTS_IEC_UNPRIVILEGED
/* Reserved; reads as zeros, each an instruction that does nothing: a wild jump executes millions of them. */
enum { HOLE_LOG2 = 23 };
#define HOLE_BASE (RAM_BASE + 0x800000u)
#else
/* The bus below the RAM takes writes without a fault, so a large frame that passes all stacks would do harm unseen. */
enum { HOLE_LOG2 = 16 };
#define HOLE_BASE (RAM_BASE - (1u << HOLE_LOG2))
#endif
enum { MPU_HOLE = MPU_BOARD + 1 };
RTS_STATIC_ASSERT(MPU_HOLE < 8, the_mpu_has_a_region_left);

enum { TIMER_ENABLE_IRQ = 9, WATCHDOG_INTEN_RESEN = 3, WATCHDOG_KEY = 0x1ACCE551 };

void BoardInit(void)
{
    IrqEnable(IRQ_TIMER0, LEVEL_DEVICE);
#if APP_POWER_FAIL
    IrqEnable(IRQ_GPIO0, LEVEL_DEVICE);
#endif
    UartInit();
    FlashInit();
    MpuProtect(MPU_HOLE, HOLE_BASE, HOLE_LOG2, MPU_NO_ACCESS);
}

void BoardAlarmSet(RTS_UI32 ns)
{
    TIMER_RELOAD = ns / (1000000000u / BOARD_CLOCK_HZ) + 1;
    TIMER_CTRL = TIMER_ENABLE_IRQ;
}

void AlarmIrq(void)
{
    TIMER_CTRL = 0;
    TIMER_INTCLEAR = 1;
    SysTimerAlarm();
}

#if APP_POWER_FAIL
/* A supply monitor on a line of GPIO port 0: the edge that says that the input voltage falls. */
void SupplyIrq(void)
{
    AppPowerFails();
}
#endif

/* The first time-out is an NMI, the second one resets. */
void BoardWatchdogStart(RTS_UI32 ms)
{
    WATCHDOG_LOCK = WATCHDOG_KEY;
    WATCHDOG_LOAD = ms * (BOARD_CLOCK_HZ / 1000);
    WATCHDOG_CTRL = WATCHDOG_INTEN_RESEN;
    WATCHDOG_LOCK = 0;
}

void BoardWatchdogKick(void)
{
    WATCHDOG_LOCK = WATCHDOG_KEY;
    WATCHDOG_INTCLR = 1;
    WATCHDOG_LOCK = 0;
}

/* The first of those beside the display. */
void BoardRunLamp(bool on)
{
    SCC_LAMPS = on;
}

/* ---- identity ---- */

/* In the last sector of the PSRAM. */
#define FACTORY_DATA (BOARD_FLASH_ADDRESS + 16 * 1024 * 1024 - BOARD_FLASH_SECTOR_SIZE)

enum { SERIAL_NUMBER_SIZE = 16 };
static char serial_number[SERIAL_NUMBER_SIZE];

/* The number the factory wrote after the file area, or a default when there is none. */
static const char *read_serial_number(void)
{
    const char *factory_data = (const char *)(uintptr_t)FACTORY_DATA;
    RTS_UI32 length = 0;
    while (length < SERIAL_NUMBER_SIZE - 1 && factory_data[length] > ' ' && factory_data[length] <= '~') {
        serial_number[length] = factory_data[length];
        length++;
    }
    serial_number[length] = '\0';
    return length ? serial_number : "0";
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
