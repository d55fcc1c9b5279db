/*
 * Cpu.h - what every Armv7-M controller shares, and what it asks of a board.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Faults and SVC are level 0 of the NVIC; each timer has an interrupt line of its own, which software triggers.
 * Application code runs in thread mode at the level of its timer, without privileges (SysExcept.c).
 */
#ifndef CPU_H
#define CPU_H

/*
 * board.h defines:
 *   BOARD_CLOCK_HZ       clock of core and SysTick, a multiple of 1000, at least 4 MHz
 *   BOARD_IRQ_COUNT      interrupt lines of the chip
 *   BOARD_PRIORITY_BITS  priority bits of the NVIC, 3 or more
 *   BOARD_TASK_IRQ       first of SYSTIMER_COUNT lines in a row that no peripheral in use drives: software triggers
 * them
 *   BOARD_VECTORS        initialisers [IRQ_VECTOR(n)] = {handler} for its peripherals, each followed by a comma
 */

#define SYST_CSR REG32(0xE000E010u)
#define SYST_RVR REG32(0xE000E014u)
#define SYST_CVR REG32(0xE000E018u)
#define NVIC_ISER(n) REG32(0xE000E100u + 4u * (n))
#define NVIC_ICPR(n) REG32(0xE000E280u + 4u * (n))
#define NVIC_IPR(n) (*(volatile RTS_UI8 *)(uintptr_t)(0xE000E400u + (n)))
#define NVIC_STIR REG32(0xE000EF00u) /* an IRQ written here becomes pending */
#define SCB_ICSR REG32(0xE000ED04u)
#define SCB_AIRCR REG32(0xE000ED0Cu)
#define SCB_CCR REG32(0xE000ED14u)
#define SCB_SHPR(n) (*(volatile RTS_UI8 *)(uintptr_t)(0xE000ED18u + (n) - 4u)) /* n: exception number */
#define SCB_SHCSR REG32(0xE000ED24u)
#define SCB_CFSR REG32(0xE000ED28u)
#define SCB_HFSR REG32(0xE000ED2Cu)
#define SCB_MMFAR REG32(0xE000ED34u)
#define SCB_BFAR REG32(0xE000ED38u)
#define SCB_CPACR REG32(0xE000ED88u)
#define FPU_FPCCR REG32(0xE000EF34u)
#define MPU_TYPE REG32(0xE000ED90u)
#define MPU_CTRL REG32(0xE000ED94u)
#define MPU_RBAR REG32(0xE000ED9Cu)
#define MPU_RASR REG32(0xE000EDA0u)
enum { MPU_RBAR_VALID = 1 << 4 };

enum { VECTOR_SVCALL = 11, VECTOR_SYSTICK = 15, VECTOR_IRQ = 16 };
#define IRQ_VECTOR(irq) (VECTOR_IRQ + (irq))

typedef union {
    void (*handler)(void);
    void *stack;
} VECTOR;

/* ---- interrupts ---- */

static inline RTS_UI8 CpuPriority(RTS_UI32 level)
{
    return (RTS_UI8)(level << (8 - BOARD_PRIORITY_BITS));
}

static inline void IrqEnable(RTS_UI32 irq, RTS_UI32 level)
{
    NVIC_IPR(irq) = CpuPriority(level);
    NVIC_ISER(irq / 32) = 1u << (irq % 32);
}

/* Masks all interrupts but faults; returns what CpuRestore needs. */
static inline RTS_UI32 CpuMask(void)
{
    RTS_UI32 primask;
    __asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(primask)::"memory");
    return primask;
}

static inline void CpuRestore(RTS_UI32 primask)
{
    __asm__ volatile("msr primask, %0" ::"r"(primask) : "memory");
}

static inline RTS_UI32 CpuExceptionNumber(void)
{
    RTS_UI32 ipsr;
    __asm__("mrs %0, ipsr" : "=r"(ipsr));
    return ipsr;
}

static inline void CpuBarrier(void)
{
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

/* ---- memory protection ---- */

/* Attributes: access, and eighths of the region that are left out of it (bit 0 the lowest). */
enum { MPU_NO_ACCESS = 0, MPU_READ_ONLY = 6 << 24, MPU_WRITE_PRIVILEGED = 2 << 24, MPU_DATA = 1 << 28 | 3 << 24 };
#define MPU_WITHOUT_EIGHTHS(mask) ((RTS_UI32)((mask) & 0xFF) << 8)

/* Regions; a board may use what is left from MPU_BOARD up to 7 (higher ones win over lower ones). Unprivileged code has
 * no access where there is none. */
#if RTS_IEC_UNPRIVILEGED
enum { MPU_MEMORY, MPU_NULL, MPU_STACK, MPU_AREAS, MPU_IEC_STACK = MPU_AREAS + 2, MPU_BOARD };
#else
enum { MPU_NULL, MPU_STACK, MPU_IEC_STACK, MPU_BOARD = MPU_IEC_STACK + APP_MAX_TASKS };
#endif

/* Gives 2^log2_size bytes at `base`, a multiple of that size, these attributes; does nothing on a chip without MPU. */
void MpuProtect(RTS_UI32 region, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 attributes);

/* ---- for BareMetal.h ---- */

static inline void CpuSleep(void)
{
    __asm__ volatile("dsb\n\twfi");
}

static inline RTS_UI32 CpuNoise(void)
{
    return SYST_CVR;
}

#define CPU_FAULT_STATUS "CFSR"

static inline RTS_UI32 CpuFaultStatus(void)
{
    return SCB_CFSR;
}

static inline void CpuReset(void)
{
    enum { AIRCR_SYSRESETREQ = 0x05FA0004 };
    SCB_AIRCR = AIRCR_SYSRESETREQ;
}

/* What an FPU adds to the main stack: main and each task that is interrupted leave a context of 64 bytes that
 * SysExceptTry saves and 72 that the processor does. */
#ifdef __ARM_FP
enum { CPU_CONTEXTS_SIZE = (APP_MAX_TASKS + 1) * (64 + 72) };
#else
enum { CPU_CONTEXTS_SIZE = 0 };
#endif

void CpuInit(void);

/* ---- interrupts of tasks ---- */

static inline void CpuTaskEnable(RTS_UI32 timer, RTS_UI32 level)
{
    IrqEnable(BOARD_TASK_IRQ + timer, level);
}

static inline void CpuTaskSetLevel(RTS_UI32 timer, RTS_UI32 level)
{
    NVIC_IPR(BOARD_TASK_IRQ + timer) = CpuPriority(level);
}

static inline void CpuTaskTrigger(RTS_UI32 timer)
{
    NVIC_STIR = BOARD_TASK_IRQ + timer;
}

static inline void CpuTaskForget(RTS_UI32 timer)
{
    NVIC_ICPR((BOARD_TASK_IRQ + timer) / 32) = 1u << (BOARD_TASK_IRQ + timer) % 32;
}

#endif
