/*
 * Cpu.h - what every RV32IMAC controller with a CLINT shares, and what it asks of a board.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The runtime is in machine mode. There are three interrupts: the clock, which is the alarm, too; what the board has; and
 * a software interrupt that runs the tasks, each interrupted by those of better levels (tasks.c).
 */
#ifndef CPU_H
#define CPU_H

/*
 * board.h defines:
 *   BOARD_CLINT        where the CLINT is: software interrupt, compare register and counter of the first hart
 *   BOARD_MTIME_HZ     rate of its counter, a multiple of 1000, at least 1 MHz
 *   BOARD_CODE, BOARD_CODE_LOG2, BOARD_RAM, BOARD_RAM_LOG2   what programs may read and run: memory of the runtime's code
 *                      and of variables, each 2^LOG2 bytes at a multiple of that
 * and implements BoardInterrupt.
 */

#define CLINT_MSIP REG32(BOARD_CLINT)
#define CLINT_MTIMECMP REG32((BOARD_CLINT) + 0x4000u)
#define CLINT_MTIMECMP_HIGH REG32((BOARD_CLINT) + 0x4004u)
#define CLINT_MTIME REG32((BOARD_CLINT) + 0xBFF8u)

/* Bits of mie and mip. */
enum { INTERRUPT_SOFTWARE = 3, INTERRUPT_TIMER = 7, INTERRUPT_EXTERNAL = 11 };
enum { MSTATUS_MIE = 1 << 3, MSTATUS_MPIE = 1 << 7, MSTATUS_MPP = 3 << 11 };

#define CSR_READ(name)                                     \
    (__extension__({                                       \
        RTS_UI32 value_;                                   \
        __asm__ volatile("csrr %0, " name : "=r"(value_)); \
        value_;                                            \
    }))
#define CSR_WRITE(name, value) __asm__ volatile("csrw " name ", %0" ::"r"((RTS_UI32)(value)) : "memory")
#define CSR_SET(name, bits) __asm__ volatile("csrs " name ", %0" ::"r"((RTS_UI32)(bits)) : "memory")
#define CSR_CLEAR(name, bits) __asm__ volatile("csrc " name ", %0" ::"r"((RTS_UI32)(bits)) : "memory")

/* ---- for BareMetal.h ---- */

static inline RTS_UI32 CpuMask(void)
{
    RTS_UI32 status;
    __asm__ volatile("csrrci %0, mstatus, %1" : "=r"(status) : "i"(MSTATUS_MIE) : "memory");
    return (status & MSTATUS_MIE) ^ MSTATUS_MIE;
}

static inline void CpuRestore(RTS_UI32 mask)
{
    CSR_SET("mstatus", mask ^ MSTATUS_MIE);
}

static inline void CpuBarrier(void)
{
    __asm__ volatile("fence iorw, iorw\n\tfence.i" ::: "memory");
}

static inline void CpuSleep(void)
{
    __asm__ volatile("wfi" ::: "memory");
}

static inline RTS_UI32 CpuNoise(void)
{
    return CSR_READ("mcycle");
}

#define CPU_FAULT_STATUS "mcause"

static inline RTS_UI32 CpuFaultStatus(void)
{
    return CSR_READ("mcause");
}

void CpuReset(void); /* of the board: there is no register for it that all chips have */

/* Main and each task that is interrupted leave a FRAME and the registers that SysExceptTry keeps; and code of this
 * processor needs more stack than that of a Cortex-M. */
enum { CPU_CONTEXTS_SIZE = (APP_MAX_TASKS + 1) * (80 + 64) + 512 };

void CpuInit(void);

/* ---- interrupts of tasks (tasks.c) ---- */

void CpuTaskSetLevel(RTS_UI32 timer, RTS_UI32 level);
void CpuTaskTrigger(RTS_UI32 timer);
void CpuTaskForget(RTS_UI32 timer);
RTS_UI32 CpuTaskLevel(void); /* of the task that runs; 255: main */

static inline void CpuTaskEnable(RTS_UI32 timer, RTS_UI32 level)
{
    CpuTaskSetLevel(timer, level);
}

/* ---- traps (trap.c) ---- */

/* What a trap saves, on the main stack: that of a program is its own. Right below what the interrupted code has there. */
typedef struct {
    RTS_UI32 ra, t0, t1, t2, a0, a1, a2, a3, a4, a5, a6, a7, t3, t4, t5, t6;
    RTS_UI32 sp; /* of a program, in whose code the trap was; 0: the runtime's own */
    RTS_UI32 pc;
    RTS_UI32 status; /* mstatus */
    RTS_UI32 unused; /* a multiple of 16 bytes */
} FRAME;
RTS_STATIC_ASSERT(sizeof(FRAME) == 80, frame_is_what_trap_c_says);

/* A fault, or a call of the runtime, in a program. With BP_MAX calls only. */
void SysExceptTrap(FRAME *frame, RTS_UI32 cause);
/* With BP_MAX: a fault. `saved`: s0 to s11, which may be changed. */
void SysExceptFault(FRAME *frame, RTS_UI32 cause, RTS_UI32 *saved);

/* Handles a fault of the runtime: continues at the rts_catch of the rts_try around it; returns if there is none. */
void SysExceptCatchFault(RTS_UI32 cause, uintptr_t address, uintptr_t stack);

/* The clock's interrupt, and that of tasks. */
void ClockInterrupt(void);
void TasksInterrupt(void);

/* The interrupts of the board, above all tasks. `pc`: what it has interrupted. */
void BoardInterrupt(RTS_UI32 pc);

/* ---- memory protection ---- */

enum { PMP_READ = 1, PMP_WRITE = 2, PMP_EXECUTE = 4, PMP_LOCKED = 0x80 };

/* Entries: lower ones win over higher ones. A program has no access where there is none; the runtime has, but where an
 * entry is locked. A board may use what is left from PMP_BOARD up. */
enum { PMP_STACK, PMP_NULL, PMP_IEC_STACK, PMP_AREAS, PMP_CODE = PMP_AREAS + 2, PMP_RAM, PMP_BOARD };

/* Gives 2^log2_size bytes (at least 8) at `base`, a multiple of that size, these rights. */
void PmpProtect(RTS_UI32 entry, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 rights);

#endif
