/*
 * rts_config_port.h - an STM32F405 board: its identity, and where programs and logs are in its one bank of flash. Its
 * sizes are those of the configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

/* So programs have none either. */
#define APP_CALLS 0
#define IEC_FILES 0
#define CM_VERSIONS 0
#define LOG_KEEP 0 /* nor for the log that is kept */

#include "rts_config_size.h"

/* No sectors are left for files. */
#undef FILE_STORE_SIZE
#define FILE_STORE_SIZE 0u

/* CAN1, in the configuration with CAN. */
#if defined COMM_ENDPOINTS && COMM_ENDPOINTS > 0
#define BOARD_CAN_COUNT 1
#endif

#include "rts_config_cortexm.h"

#define BOARD_TARGET_ID TARGET_ID_CORTEX_M4F
#define BOARD_DEVICE_NAME "STM32F405"
#define BOARD_NODE_NAME "stm32f405"

/* The whole flash: four sectors of 16 KiB, one of 64 KiB, seven of 128 KiB. */
#define BOARD_FLASH_ADDRESS 0x08000000u
#define BOARD_FLASH_SIZE 0x100000u
#define BOARD_FLASH_SECTOR_SIZE 0x4000u
#define FLASH_SECTOR_AT(offset) ((offset) < 0x10000u ? 0x4000u : (offset) < 0x20000u ? 0x10000u : 0x20000u)
#define FLASH_READS_FAIL 0 /* it is memory, without ECC */

/* Programs in two sectors each, the commit log in two small ones, which are erased quickly, the retain log in the last
 * two. The others are the runtime's (stm32f405.ld), and one of 16 KiB is left over. */
#define FILE_MAP                                              \
    {0x40000, 0x40000}, {0x80000, 0x40000}, {0x4000, 0x8000}, \
    {                                                         \
        0xC0000, 0x40000                                      \
    }

#endif
