/*
 * IecCall.c - enters compiled code, with the import table in s11. What it saves counts (RTS_IEC_STACK_LOST).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "rts_config.h"

__attribute__((naked)) void IecCall(const IEC_CONTEXT *context, RTS_UI32 argument, uintptr_t entry)
{
    RTS_UNUSED(context);
    RTS_UNUSED(argument);
    RTS_UNUSED(entry);
    __asm__ volatile("addi sp, sp, -16\n\tsw ra, 12(sp)\n\tsw s11, 8(sp)\n\tlw s11, %0(a0)\n\t"
                     "jalr a2\n\t"
                     "lw s11, 8(sp)\n\tlw ra, 12(sp)\n\taddi sp, sp, 16\n\tret" ::"i"(offsetof(IEC_CONTEXT, imports)));
}
