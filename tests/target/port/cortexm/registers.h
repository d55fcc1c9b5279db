/*
 * registers.h - code that notices when a register of an Armv7-M is changed; for test_except.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
/* Holds known values in every register a function may keep, and in some that it may not, for a while. */
static void keep_registers_busy(void *arg)
{
    RTS_UI32 bad = 0;
    for (RTS_UI32 round = 0; round < 200; round++) {
        RTS_UI32 wrong;
        __asm__ volatile("mov %0, #0\n\t"
                         "mov r4, #40\n\tmov r5, #50\n\tmov r6, #60\n\tmov r8, #80\n\tmov r9, #90\n\tmov r10, #100\n\t"
                         "mov r11, #110\n\tmov r12, #120\n\tmov r3, #30\n\t"
#ifdef __ARM_FP
                         "vmov s0, r4\n\tvmov s1, r5\n\tvmov s15, r6\n\tvmov s16, r8\n\tvmov s20, r9\n\t"
                         "vmov s31, r10\n\t"
#endif
                         "mov r2, #1000\n\t1: subs r2, #1\n\tbne 1b\n\t"
                         "cmp r4, #40\n\tit ne\n\taddne %0, #1\n\tcmp r5, #50\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r6, #60\n\tit ne\n\taddne %0, #1\n\tcmp r8, #80\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r9, #90\n\tit ne\n\taddne %0, #1\n\tcmp r10, #100\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r11, #110\n\tit ne\n\taddne %0, #1\n\tcmp r12, #120\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r3, #30\n\tit ne\n\taddne %0, #1\n\t"
#ifdef __ARM_FP
                         "vmov r2, s0\n\tcmp r2, #40\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s1\n\tcmp r2, #50\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s15\n\tcmp r2, #60\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s16\n\tcmp r2, #80\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s20\n\tcmp r2, #90\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s31\n\tcmp r2, #100\n\tit ne\n\taddne %0, #1\n\t"
#endif
                         : "=&r"(wrong)
                         :
                         : "r2", "r3", "r4", "r5", "r6", "r8", "r9", "r10", "r11", "r12", "cc", "memory"
#ifdef __ARM_FP
                           ,
                           "s0", "s1", "s15", "s16", "s20", "s31"
#endif
        );
        bad += wrong;
    }
    *(volatile RTS_UI32 *)arg += bad;
}
