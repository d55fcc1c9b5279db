/*
 * rts_config_port.h - the MPS2 AN386 board (Cortex-M4F): its identity. Its sizes are those of the configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "rts_config_size.h"

#include "rts_config_cortexm.h"

#define BOARD_TARGET_ID TARGET_ID_CORTEX_M4F
#define BOARD_DEVICE_NAME "MPS2 AN386"
#define BOARD_NODE_NAME "mps2-an386"

/* The flash that applications and files have: a part of the PSRAM. Sizes in bytes. */
#define BOARD_FLASH_ADDRESS 0x21000000u
#define BOARD_FLASH_SIZE 0x80000u
#define BOARD_FLASH_SECTOR_SIZE 4096u
#define FLASH_READS_FAIL 0 /* it is memory */

/* In the full configuration this board stands for one with backup RAM and a supply monitor. */
#ifdef FILE_STORE_FILES
#define APP_RETAIN_SRAM 1
#define APP_POWER_FAIL 1
#endif

#endif
