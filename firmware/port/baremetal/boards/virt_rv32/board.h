/*
 * board.h - QEMU's virt board with one RV32IMAC hart.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef BOARD_H
#define BOARD_H

#include "rts_config.h"

#define BOARD_CLINT 0x02000000u
#define BOARD_MTIME_HZ 10000000u

/* As in virt.ld. */
#define BOARD_CODE 0x80000000u
#define BOARD_CODE_LOG2 18
#define BOARD_RAM 0x80100000u
#define BOARD_RAM_LOG2 17

/* A page: in one that has other memory too, QEMU 7.2 does not look at an entry of the PMP each time. */
#define BOARD_STACK_GUARD_LOG2 12

/* Its watchdog is an interrupt: what masks all interrupts is not noticed. */
#define BOARD_WATCHDOG_IS_MASKED 1

/* Called by BoardInterrupt. */
void UartInterrupt(void);

#endif
