/*
 * rts_config_port.h - QEMU's virt board with RV32IMAC: its identity. Its sizes are those of the configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "rts_config_size.h"

#include "rts_config_riscv.h"

/* Sectors are large: the log that is kept has two more than the rest. */
#if defined(LOG_KEEP) && LOG_KEEP > 0
#undef FILE_STORE_SIZE
#define FILE_STORE_SIZE 0x100000u
#endif

#define BOARD_TARGET_ID TARGET_ID_RV32IMAC
#define BOARD_DEVICE_NAME "QEMU virt RV32"
#define BOARD_NODE_NAME "virt-rv32"

/* The second bank of the parallel flash, of which applications and files have the beginning. Sizes in bytes; sectors are
 * two of 128 KiB side by side. The code of applications is copied to RAM. */
#define BOARD_FLASH_SIZE (0x400000u + LOG_KEEP_SIZE)
#define BOARD_FLASH_SECTOR_SIZE 0x40000u
#ifndef APP_MAX_CODE_SIZE
#define APP_MAX_CODE_SIZE 8192
#endif

/* A page of QEMU: where rights change inside one, QEMU 10 translates each instruction every time. */
#define BOARD_CODE_ALIGN 4096

#endif
