/*
 * trap.c - start, and the one vector: what a trap saves, on which stack it runs, and how it returns.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * mscratch is 0 in the runtime, which is on the main stack; while a program runs it is where the main stack goes on. So
 * what a program has done to its stack pointer does not matter to a trap.
 */
#include "BareMetal.h"

/* Where the controller starts; lowest in flash, and the entry of the file. */
void start(void);
__attribute__((naked, section(".vectors"), used)) void start(void)
{
    __asm__ volatile("la sp, stack_top\n\ttail ResetHandler");
}

/* A fault of the runtime; it may be that its stack was at its end, so it is given up. */
#if RTS_STRUCTURED_EXCEPTION_HANDLING
static __attribute__((aligned(16), used)) RTS_UI32 fault_stack[64];
#define FAULT_STACK "csrrw a1, mscratch, zero\n\tla sp, fault_stack + 256\n\t"
#else
#define FAULT_STACK "la sp, stack_top\n\t"
#endif
__attribute__((used, noreturn)) static void runtime_fault(RTS_UI32 pc, uintptr_t stack)
{
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    SysExceptCatchFault(CpuFaultStatus(), pc, stack);
#else
    RTS_UNUSED(stack);
#endif
    ResetNow(RESET_FATAL, pc);
}

/* Of several pending interrupts devices and the clock come before tasks; which one a processor takes first differs, and
 * QEMU's order is its own. */
static void interrupt(RTS_UI32 pc)
{
    RTS_UI32 pending = CSR_READ("mip") & CSR_READ("mie");

    if (pending & 1 << INTERRUPT_EXTERNAL)
        BoardInterrupt(pc);
    else if (pending & 1 << INTERRUPT_TIMER)
        ClockInterrupt();
    else if (pending & 1 << INTERRUPT_SOFTWARE)
        TasksInterrupt();
}

__attribute__((used)) static void trap_dispatch(FRAME *frame)
{
    RTS_UI32 cause = CpuFaultStatus();

    if ((RTS_I32)cause < 0)
        interrupt(frame->pc);
    else
        SysExceptTrap(frame, cause);
}

/* A debugger looks at all registers of a program that met a fault. */
#if BP_MAX > 0
#define DISPATCH                                                                                               \
    "csrr a1, mcause\n\tli t0, 8\n\tbltu a1, t0, 5f\n\tcall trap_dispatch\n\tj 6f\n"                           \
    "5:\taddi sp, sp, -48\n\tmv a2, sp\n\t"                                                                    \
    "sw s0, 0(sp)\n\tsw s1, 4(sp)\n\tsw s2, 8(sp)\n\tsw s3, 12(sp)\n\tsw s4, 16(sp)\n\tsw s5, 20(sp)\n\t"      \
    "sw s6, 24(sp)\n\tsw s7, 28(sp)\n\tsw s8, 32(sp)\n\tsw s9, 36(sp)\n\tsw s10, 40(sp)\n\tsw s11, 44(sp)\n\t" \
    "call SysExceptFault\n\t"                                                                                  \
    "lw s0, 0(sp)\n\tlw s1, 4(sp)\n\tlw s2, 8(sp)\n\tlw s3, 12(sp)\n\tlw s4, 16(sp)\n\tlw s5, 20(sp)\n\t"      \
    "lw s6, 24(sp)\n\tlw s7, 28(sp)\n\tlw s8, 32(sp)\n\tlw s9, 36(sp)\n\tlw s10, 40(sp)\n\tlw s11, 44(sp)\n\t" \
    "addi sp, sp, 48\n6:\t"
#else
#define DISPATCH "call trap_dispatch\n\t"
#endif

__attribute__((naked, aligned(4))) static void trap_entry(void)
{
    __asm__ volatile("csrrw sp, mscratch, sp\n\t"
                     "bnez sp, 1f\n\t"
                     "csrr sp, mcause\n\t" /* in the runtime: its stack is not touched before it is known to be sound */
                     "bgez sp, 4f\n\t"
                     "csrrw sp, mscratch, zero\n\t"
                     "addi sp, sp, -80\n\t"
                     "sw t0, 4(sp)\n\t"
                     "sw zero, 64(sp)\n\t"
                     "j 2f\n"
                     "1:\taddi sp, sp, -80\n\t" /* in a program */
                     "sw t0, 4(sp)\n\t"
                     "csrrw t0, mscratch, zero\n\t"
                     "sw t0, 64(sp)\n"
                     "2:\t"
                     "sw ra, 0(sp)\n\tsw t1, 8(sp)\n\tsw t2, 12(sp)\n\tsw a0, 16(sp)\n\tsw a1, 20(sp)\n\t"
                     "sw a2, 24(sp)\n\tsw a3, 28(sp)\n\tsw a4, 32(sp)\n\tsw a5, 36(sp)\n\tsw a6, 40(sp)\n\t"
                     "sw a7, 44(sp)\n\tsw t3, 48(sp)\n\tsw t4, 52(sp)\n\tsw t5, 56(sp)\n\tsw t6, 60(sp)\n\t"
                     "csrr t0, mepc\n\tsw t0, 68(sp)\n\tcsrr t0, mstatus\n\tsw t0, 72(sp)\n\t"
                     "mv a0, sp\n\t" DISPATCH "lw t0, 68(sp)\n\tcsrw mepc, t0\n\tlw t0, 72(sp)\n\tcsrw mstatus, t0\n\t"
                     "lw ra, 0(sp)\n\tlw t1, 8(sp)\n\tlw t2, 12(sp)\n\tlw a0, 16(sp)\n\tlw a1, 20(sp)\n\t"
                     "lw a2, 24(sp)\n\tlw a3, 28(sp)\n\tlw a4, 32(sp)\n\tlw a5, 36(sp)\n\tlw a6, 40(sp)\n\t"
                     "lw a7, 44(sp)\n\tlw t3, 48(sp)\n\tlw t4, 52(sp)\n\tlw t5, 56(sp)\n\tlw t6, 60(sp)\n\t"
                     "lw t0, 64(sp)\n\t"
                     "beqz t0, 3f\n\t"
                     "addi t0, sp, 80\n\t"
                     "csrw mscratch, t0\n\t"
                     "lw t0, 4(sp)\n\t"
                     "lw sp, 64(sp)\n\t"
                     "mret\n"
                     "3:\tlw t0, 4(sp)\n\t"
                     "addi sp, sp, 80\n\t"
                     "mret\n"
                     "4:\tcsrr a0, mepc\n\t" FAULT_STACK "tail runtime_fault");
}

void CpuInit(void)
{
    CSR_WRITE("mscratch", 0);
    CSR_WRITE("mtvec", (uintptr_t)trap_entry);
    CSR_WRITE("mie", 1 << INTERRUPT_SOFTWARE | 1 << INTERRUPT_TIMER | 1 << INTERRUPT_EXTERNAL);
}
