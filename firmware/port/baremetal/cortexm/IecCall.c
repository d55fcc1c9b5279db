/*
 * IecCall.c - enters compiled code, with the import table in r9. What it saves counts (RTS_IEC_STACK_LOST).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "rts_config.h"

#define ARGUMENT __attribute__((unused)) /* in its register; a naked function has no statement that could use it */

#ifdef __ARM_ARCH_6M__
__attribute__((naked)) void IecCall(const IEC_CONTEXT *context ARGUMENT, RTS_UI32 argument ARGUMENT,
                                    uintptr_t entry ARGUMENT)
{
    __asm__ volatile("push {r4, lr}\n\tmov r4, r9\n\tpush {r3, r4}\n\tldr r4, [r0, %0]\n\tmov r9, r4\n\t"
                     "blx r2\n\tpop {r3, r4}\n\tmov r9, r4\n\tpop {r4, pc}" ::"i"(offsetof(IEC_CONTEXT, imports)));
}
#else
/* When a large frame leaves no room for that of the fault, its place is lost: then find_caller finds the entry, after
 * the instructions that make its frame and have no line. */
#if RTS_IEC_UNPRIVILEGED
#define PUSH_ENTRY "add r3, r2, #10\n\tpush {r3, r9}\n\tpush {r9, lr}\n\t"
#define RETURN "pop {r9, lr}\n\tadd sp, #8\n\tbx lr"
#else
#define PUSH_ENTRY "push {r9, lr}\n\t"
#define RETURN "pop {r9, pc}"
#endif

__attribute__((naked)) void IecCall(const IEC_CONTEXT *context ARGUMENT, RTS_UI32 argument ARGUMENT,
                                    uintptr_t entry ARGUMENT)
{
    __asm__ volatile(PUSH_ENTRY "ldr r9, [r0, %0]\n\t"
                                "blx r2\n\t" RETURN ::"i"(offsetof(IEC_CONTEXT, imports)));
}
#endif
