/*
 * rts_config_cortexm.h - how compiled code is entered on Cortex-M; for a board's rts_config_port.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_CORTEXM_H
#define RTS_CONFIG_CORTEXM_H

#include "rts_config_baremetal.h"

#define APP_ENTRY_MODE_BIT 1

/* EXCEPT_REGISTERS_ARMV7M; what is saved for a debugger. */
#ifndef EXCEPT_REGISTERS
#define EXCEPT_REGISTERS (BP_MAX > 0 ? 19 : 0)
#endif

/* Registers that rts_try saves (SysExceptCatch.h): sp, r4 to r11, lr, s16 to s31. */
#define RTS_JMP_BUF_WORDS (10 + (CPU_HAS_FPU ? 16 : 0))

/* Of RTS_IEC_STACK_SIZE these are not the program's [bytes]: what IecCall saves at most, the frame that the processor
 * pushes when the program is interrupted, larger with an FPU (BOARD_TARGET_ID), and the guard. */
#define RTS_IEC_STACK_GUARD (RTS_IEC_UNPRIVILEGED ? 0 : 32)
#define RTS_IEC_STACK_LOST (16 + (CPU_HAS_FPU ? 104 : 32) + RTS_IEC_STACK_GUARD)
#define CPU_HAS_FPU (BOARD_TARGET_ID == TARGET_ID_CORTEX_M4F || BOARD_TARGET_ID == TARGET_ID_CORTEX_M7)

#if RTS_IEC_UNPRIVILEGED
/* The areas are rounded up to a multiple of an eighth of the power of 2 that holds them: make APP_DATA_SIZE so large that
 * nothing is lost. */
#define APP_AREAS_ALIGNED(size) __attribute__((aligned((size) > 256 ? 1 << (RTS_LOG2((size) - 1) - 2) : 32)))
#define APP_AREAS_SECTION __attribute__((section(".bss.areas")))

#define APP_GATE(function)                                                                             \
    __attribute__((naked, unused, section(".text.gate." #function))) static void function##_gate(void) \
    {                                                                                                  \
        __asm__ volatile("svc 1\n\tb %c0" ::"i"(function));                                            \
    }                                                                                                  \
    RTS_STATIC_ASSERT(1, function##_has_a_gate)
#define APP_GATED(function) function##_gate
#endif

#endif
