/*
 * registers.h - code that notices when a register of a RISC-V is changed; for test_except.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define SET(name, value) "li " #name ", " #value "\n\t"
#define COMPARE(name, value) "li t1, " #value "\n\tbeq " #name ", t1, 1f\n\taddi %0, %0, 1\n1:\n\t"
/* clang-format off */
#define EACH(use) \
    use(s1, 1) use(s2, 2) use(s3, 3) use(s4, 4) use(s5, 5) use(s6, 6) use(s7, 7) use(s8, 8) use(s9, 9) use(s10, 10) \
    use(s11, 11) use(a2, 22) use(a3, 23) use(a4, 24) use(a5, 25) use(a6, 26) use(a7, 27) use(t2, 32) use(t3, 33) \
    use(t4, 34) use(t5, 35) use(t6, 36) use(ra, 41)
/* clang-format on */

/* Holds known values in every register a function may keep, and in those that it may not, for a while. */
static void keep_registers_busy(void *arg)
{
    RTS_UI32 bad = 0;
    for (RTS_UI32 round = 0; round < 200; round++) {
        RTS_UI32 wrong;
        __asm__ volatile("li %0, 0\n\t" EACH(SET) "li t0, 1000\n"
                                                  "2:\taddi t0, t0, -1\n\tbnez t0, 2b\n\t" EACH(COMPARE)
                         : "=&r"(wrong)
                         :
                         : "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "a2", "a3", "a4", "a5",
                           "a6", "a7", "t0", "t1", "t2", "t3", "t4", "t5", "t6", "ra", "memory");
        bad += wrong;
    }
    *(volatile RTS_UI32 *)arg += bad;
}
