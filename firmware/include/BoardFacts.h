/*
 * BoardFacts.h - what plctool has to know of a firmware and its board without asking it (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Made of what the firmware itself is compiled with, by CmpList.h. In the ELF file of a firmware it is the section
 * `board_facts`, which takes no flash (sections.ld); plctool has those of the boards here. A port has one whose
 * rts_config_port.h gives BOARD_TARGET_ID, BOARD_DEVICE_NAME, BOARD_FLASH_SIZE, BOARD_FLASH_SECTOR_SIZE and, if it is
 * memory of the processor, BOARD_FLASH_ADDRESS.
 */
#ifndef BOARDFACTS_H
#define BOARDFACTS_H

#include "CompactDownload.h"
#include "SysFileFlash.h"

enum { BOARD_FACTS_MAGIC = 0x54434642, BOARD_NAME_SIZE = 32, BOARD_COMPONENTS_SIZE = 1024 };

typedef struct {
    RTS_UI32 magic;         /* BOARD_FACTS_MAGIC */
    RTS_UI32 size;          /* of this struct; another one is that of another version */
    RTS_UI32 target_id;     /* of the processor */
    RTS_UI32 device_id;     /* what images are for: BOARD_DEVICE_ID */
    RTS_UI32 has_address;   /* whether the flash is memory of the processor */
    RTS_UI32 flash_address; /* where; else 0 */
    RTS_UI32 flash_size;    /* bytes, as all sizes here */
    RTS_UI32 sector_size;
    RTS_UI32 erased;              /* value of an erased byte */
    FILE_AREA file[FILE_COUNT];   /* where each FILE_* is in the flash */
    FILE_AREA store;              /* FILE_CATALOG, two sectors, and FILE_STORE; no bytes without them */
    RTS_UI32 area[APP_AREA_CODE]; /* RAM of the areas data, retain, input, output, memory */
    RTS_UI32 code;                /* largest code segment; 0: what fits a slot */
    RTS_UI32 stack;               /* of a task, for its calls (without RTS_IEC_STACK_LOST); 0: not known */
    RTS_UI32 tasks;               /* most of an application */
    RTS_UI32 imports;             /* most external functions of an application */
    RTS_UI32 record;              /* data of a commit record (AppRecord.h) */
    RTS_UI32 copies;              /* RAM of the tasks' copies of inputs and outputs; 0: they need none */
    RTS_UI32 copies_always;       /* also of what a task uses alone */
    RTS_UI32 connectors;          /* devices and buses; as the following, most of an application */
    RTS_UI32 gpio_groups;         /* connectors of IoDrvGpio */
    RTS_UI32 events;              /* external ones, such as edges */
    RTS_UI32 modbus_lines;        /* with devices; all of Modbus as in rts_config.h */
    RTS_UI32 modbus_devices;
    RTS_UI32 modbus_jobs;
    RTS_UI32 modbus_calls;
    RTS_UI32 modbus_servers;
    RTS_UI32 modbus_ranges;
    RTS_UI32 modbus_data;
    RTS_UI32 modbus_tcp;                    /* lines and servers over TCP */
    char name[BOARD_NAME_SIZE];             /* BOARD_DEVICE_NAME */
    char config[BOARD_NAME_SIZE];           /* RTS_CONFIG_NAME, "" without */
    char components[BOARD_COMPONENTS_SIZE]; /* their names, a blank after each */
} BOARD_FACTS;

#endif
