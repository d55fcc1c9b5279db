/*
 * BoardFactsOwn.h - the facts of this firmware and its board; included by CmpList.h, which knows its components.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppRecord.h"
#include "BoardFacts.h"
#include "rts_config.h"

#ifdef BOARD_FLASH_ADDRESS
enum { HAS_ADDRESS = 1, ADDRESS = BOARD_FLASH_ADDRESS };
#else
enum { HAS_ADDRESS = 0, ADDRESS = 0 };
#endif

#ifndef FILE_MAP
#define FILE_MAP FILE_MAP_OF(BOARD_FLASH_SIZE - FILE_STORE_SIZE - LOG_KEEP_SIZE, BOARD_FLASH_SECTOR_SIZE)
#endif

RTS_STATIC_ASSERT(sizeof(BOARD_DEVICE_NAME) <= BOARD_NAME_SIZE && sizeof(RTS_CONFIG_NAME) <= BOARD_NAME_SIZE,
                  names_fit);

#ifdef __APPLE__
#define BOARD_FACTS_SECTION "__DATA,board_facts"
#else
#define BOARD_FACTS_SECTION "board_facts"
#endif

/* Found by its section. The alignment is that of the struct, so that several are an array. */
__attribute__((used, section(BOARD_FACTS_SECTION), aligned(4))) static const BOARD_FACTS facts = {
    .magic = BOARD_FACTS_MAGIC,
    .size = sizeof(BOARD_FACTS),
    .target_id = BOARD_TARGET_ID,
    .device_id = BOARD_DEVICE_ID,
    .has_address = HAS_ADDRESS,
    .flash_address = ADDRESS,
    .flash_size = BOARD_FLASH_SIZE,
    .sector_size = BOARD_FLASH_SECTOR_SIZE,
    .erased = BOARD_FLASH_ERASED,
    .file = {FILE_MAP},
    .store = {FILE_STORE_FILES > 0 ? BOARD_FLASH_SIZE - FILE_STORE_SIZE - LOG_KEEP_SIZE : 0,
              FILE_STORE_FILES > 0 ? FILE_STORE_SIZE : 0},
    .area = {APP_DATA_SIZE, APP_RETAIN_SIZE, APP_INPUT_SIZE, APP_OUTPUT_SIZE, APP_MEMORY_SIZE},
    .code = APP_MAX_CODE_SIZE,
    .stack = RTS_IEC_STACK_SIZE - RTS_IEC_STACK_LOST,
    .tasks = APP_MAX_TASKS,
    .imports = APP_MAX_IMPORTS,
    .record = COMMIT_RECORD_SIZE,
    .copies = APP_IMAGE_SIZE,
    .copies_always = APP_IMAGE_ALWAYS,
    .connectors = IO_MAX_CONNECTORS,
    .gpio_groups = IO_GPIO_GROUPS,
    .events = SCHED_MAX_EXTERNAL_EVENTS,
    .modbus_lines = MODBUS_MAX_CLIENTS,
    .modbus_devices = MODBUS_MAX_DEVICES,
    .modbus_jobs = MODBUS_MAX_JOBS,
    .modbus_calls = MODBUS_MAX_CALLS,
    .modbus_servers = MODBUS_MAX_SERVERS,
    .modbus_ranges = MODBUS_MAX_RANGES,
    .modbus_data = MODBUS_DATA_SIZE,
    .modbus_tcp = MODBUS_MAX_CONNECTIONS > 0 ? MODBUS_MAX_CLIENTS + MODBUS_MAX_SERVERS : 0,
    .name = BOARD_DEVICE_NAME,
    .config = RTS_CONFIG_NAME,
#define X(component) #component " "
    .components =
#include "CmpOrder.h"
#undef X
};
