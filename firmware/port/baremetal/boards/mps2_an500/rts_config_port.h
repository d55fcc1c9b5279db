/*
 * rts_config_port.h - the MPS2 AN500 board (Cortex-M7): its identity. Its sizes are those of the configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "rts_config_size.h"

#include "rts_config_cortexm.h"

#define BOARD_TARGET_ID TARGET_ID_CORTEX_M7
#define BOARD_DEVICE_NAME "MPS2 AN500"
#define BOARD_NODE_NAME "mps2-an500"

/* The flash that applications and files have: a part of the PSRAM. Sizes in bytes. */
#define BOARD_FLASH_ADDRESS 0x60000000u
#define BOARD_FLASH_SIZE 0x80000u
#define BOARD_FLASH_SECTOR_SIZE 4096u
#define FLASH_READS_FAIL 0 /* it is memory */

#endif
