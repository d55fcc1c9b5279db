/*
 * rts_config_riscv.h - how programs are kept to their memory on RISC-V; for a board's rts_config_port.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_RISCV_H
#define RTS_CONFIG_RISCV_H

#include "rts_config_baremetal.h"

/* Whatever the configuration says: here it costs nothing that is worth saving. */
#undef RTS_IEC_UNPRIVILEGED
#define RTS_IEC_UNPRIVILEGED 1

/* EXCEPT_REGISTERS_RISCV32; what is saved for a debugger. */
#ifndef EXCEPT_REGISTERS
#define EXCEPT_REGISTERS (BP_MAX > 0 ? 32 : 0)
#endif

/* Registers that rts_try saves (SysExceptCatch.h): sp, s0 to s11, ra. */
#define RTS_JMP_BUF_WORDS 14

/* Of RTS_IEC_STACK_SIZE this is not the program's [bytes]: what IecCall saves. Traps are on the main stack. */
#define RTS_IEC_STACK_LOST 16

/* An entry of the PMP may begin and end at each of these; most chips are as fine. */
#define APP_AREAS_ALIGNED(size) __attribute__((aligned(32)))
#define APP_AREAS_SECTION __attribute__((section(".bss.areas")))

#define APP_GATE(function)                                                                             \
    __attribute__((naked, unused, section(".text.gate." #function))) static void function##_gate(void) \
    {                                                                                                  \
        __asm__ volatile("ecall\n\ttail %0" ::"i"(function));                                          \
    }                                                                                                  \
    RTS_STATIC_ASSERT(1, function##_has_a_gate)
#define APP_GATED(function) function##_gate

#endif
