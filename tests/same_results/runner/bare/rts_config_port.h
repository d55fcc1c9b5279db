/*
 * rts_config_port.h - sizes of the runner on a bare processor, and how compiled code is entered there.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "CmpIecAbi.h"

#define APP_MAX_TASKS 16
#define APP_MAX_IMPORTS 128
#define APP_DATA_SIZE (256 * 1024)
#define APP_RETAIN_SIZE (16 * 1024)
#define APP_INPUT_SIZE 4096
#define APP_OUTPUT_SIZE 4096
#define APP_MEMORY_SIZE (16 * 1024)
#define CM_MAX_EXT_TABLES 8
#define EVENT_MAX_CALLBACKS 16
#define SIM_FLASH_SIZE (1024 * 1024)
#define SIM_FLASH_SECTOR_SIZE 4096
#define SIM_FLASH_PROGRAM_SIZE 8
#define SIM_FLASH_ERASED 0xFF

/* Calls an entry of compiled code with the import table in its register; `argument` is init_retains or 0. */
void IecCall(uintptr_t entry, const IEC_CONTEXT *context, RTS_UI32 argument);

#if defined(__arm__)
#define APP_ENTRY_MODE_BIT 1
#endif
#define APP_CALL_ENTRY(entry, context) IecCall((uintptr_t)(entry), (context), 0)
#define APP_CALL_GLOBAL_INIT(entry, context, init_retains) IecCall((uintptr_t)(entry), (context), (init_retains))

#endif
