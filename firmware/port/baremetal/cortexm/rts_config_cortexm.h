/*
 * rts_config_cortexm.h - how compiled code is entered on Cortex-M; for a board's rts_config_port.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_CORTEXM_H
#define RTS_CONFIG_CORTEXM_H

#include "rts_config_baremetal.h"

#define APP_ENTRY_MODE_BIT 1

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
