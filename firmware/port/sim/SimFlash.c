/*
 * SimFlash.c - a flash that is stricter than hardware, with power cuts.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A byte may be programmed once after an erase, also with the value it has. What breaks a rule is counted, and happens
 * as it would on a chip. The cells survive the end of a child process that ran the runtime, as they survive power off,
 * and while power is on a store into them is a fault, as it is on a chip.
 */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <unistd.h>

#include "Sim.h"
#include "SimPower.h"
#include "SysFlash.h"
#include "rts_config.h"
#include "sim_port.h"

enum { CODE_SLOTS = 2, PAGE = 4096 };

typedef struct {
    RTS_UI8 *code;
    RTS_UI32 size;
} MAPPING;

/* The cells, and which of them were programmed since they were erased; shared with child processes. */
typedef struct {
    RTS_UI8 *data;   /* for reading */
    RTS_UI8 *change; /* the same memory at another address, by which cells are changed */
    RTS_UI8 *programmed;
    RTS_UI8 *touched; /* pages that may not be as they were made */
    RTS_UI32 size;
    pid_t owner; /* the process that made them */
} CELLS;

/* When something happens, as values of the counters; 0: never. */
typedef struct {
    RTS_UI32 cut_at;
    RTS_UI32 cut_mode;
    RTS_UI32 fail_at[SIM_CALLS];
    bool fail_on[SIM_CALLS]; /* all calls after that one, too */
} PLAN;

unsigned SimFileStoreSize;
unsigned SimKeptLogSize;

static struct {
    SYS_FLASH flash;
    CELLS cells;
    CELLS kept;   /* by SimFlashSave */
    CELLS synced; /* by the last sync, when one is planned to fail */
    bool sync_failed;
    bool unmapped;
    RTS_UI32 unreadable; /* bytes from here on */
    RTS_UI32 unreadable_size;
    RTS_UI32 operations;
    RTS_UI32 calls[SIM_CALLS];
    PLAN plan;
    PLAN next_plan; /* from the next power on */
    bool power_lost;
    RTS_UI32 violations;
    char violation[80];
    MAPPING mapping[CODE_SLOTS];
} chip;

/* ---- rules ---- */

static RTS_RESULT violate(const char *what, RTS_UI32 offset)
{
    if (chip.violations++ == 0)
        snprintf(chip.violation, sizeof chip.violation, "%s at offset %u", what, (unsigned)offset);
    return ERR_DEVICE;
}

static bool is_inside(RTS_UI32 offset, RTS_UI32 size)
{
    return size <= chip.flash.size && offset <= chip.flash.size - size;
}

static bool was_programmed(RTS_UI32 offset, RTS_UI32 size)
{
    return memchr(chip.cells.programmed + offset, 1, size) != NULL;
}

static RTS_UI32 pages_of(RTS_UI32 size)
{
    return (size + PAGE - 1) / PAGE;
}

static void touch(RTS_UI32 offset, RTS_UI32 size)
{
    memset(chip.cells.touched + offset / PAGE, 1, pages_of(offset % PAGE + size));
}

static void protect(int access)
{
    (void)mprotect(chip.cells.data, chip.cells.size, access);
}

/* Whether tests may store into the cells. */
static void set_writable(bool writable)
{
    protect(writable ? PROT_READ | PROT_WRITE : PROT_READ);
    if (writable)
        touch(0, chip.cells.size);
}

/* ---- cuts ---- */

/* Counts an operation on `size` bytes; returns how many of them happen. *after: what follows, SIM_CUT_* or
 * SIM_FAULT. */
static RTS_UI32 begin_operation(RTS_UI32 size, int *after)
{
    *after = -1;
    if (++chip.operations != chip.plan.cut_at)
        return size;
    chip.plan.cut_at = 0;
    *after = (int)chip.plan.cut_mode;
    if (chip.plan.cut_mode == SIM_CUT_AFTER)
        return size;
    return chip.plan.cut_mode == SIM_CUT_BEFORE ? 0 : size / 2;
}

/* Counts a call; whether it fails. */
static bool fails(RTS_UI32 kind)
{
    RTS_UI32 at = chip.plan.fail_at[kind];

    if (chip.power_lost)
        return true;
    chip.calls[kind]++;
    return chip.calls[kind] == at || (chip.plan.fail_on[kind] && chip.calls[kind] > at);
}

static RTS_RESULT end_operation(int after)
{
    if (after < 0)
        return ERR_OK;
    if (after != SIM_FAULT) {
        chip.power_lost = true;
        SimPowerCut();
    }
    return ERR_DEVICE;
}

/* ---- what the runtime calls ---- */

static bool is_unreadable(RTS_UI32 offset, RTS_UI32 size)
{
    return offset < chip.unreadable + chip.unreadable_size && chip.unreadable < offset + size;
}

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    if (fails(SIM_READ) || is_unreadable(offset, size))
        return ERR_DEVICE;
    if (!is_inside(offset, size))
        return violate("read outside", offset);
    memcpy(data, chip.cells.data + offset, size);
    return ERR_OK;
}

/* What a cell holds after `value` was programmed into it: bits only change away from erased. */
static RTS_UI8 programmed_cell(RTS_UI8 old, RTS_UI8 value)
{
    return chip.flash.erased == 0xFF ? old & value : old | value;
}

/* A half programmed unit counts as programmed. */
static void program_cells(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 unit = chip.flash.program_size;
    RTS_UI8 *cells = chip.cells.change + offset;
    RTS_UI32 i;

    touch(offset, size);
    for (i = 0; i < size; i++)
        cells[i] = programmed_cell(cells[i], data[i]);
    memset(chip.cells.programmed + offset, 1, (size + unit - 1) / unit * unit);
}

static void erase_cells(RTS_UI32 offset, RTS_UI32 size)
{
    touch(offset, size);
    memset(chip.cells.change + offset, chip.flash.erased, size);
    memset(chip.cells.programmed + offset, 0, size);
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    RTS_UI32 unit = chip.flash.program_size;
    int after;

    if (fails(SIM_PROGRAM))
        return ERR_DEVICE;
    if (!is_inside(offset, size) || size == 0)
        return violate("program outside", offset);
    if (offset % unit != 0 || size % unit != 0)
        return violate("program misaligned", offset);
    if (was_programmed(offset, size))
        violate("programmed twice", offset);
    program_cells(offset, data, begin_operation(size, &after));
    return end_operation(after);
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    RTS_UI32 size = chip.flash.sector_size;
    int after;

    if (fails(SIM_ERASE))
        return ERR_DEVICE;
    if (!is_inside(offset, size))
        return violate("erase outside", offset);
    if (offset % size != 0)
        return violate("erase misaligned", offset);
    size = begin_operation(size, &after);
    erase_cells(offset, size);
    return end_operation(after);
}

static void copy_cells(CELLS *to, const CELLS *from)
{
    memcpy(to->data, from->data, chip.flash.size);
    memcpy(to->programmed, from->programmed, chip.flash.size);
}

static RTS_RESULT flash_sync(void)
{
    bool failed = fails(SIM_SYNC);

    if (chip.synced.data != NULL) {
        chip.sync_failed = failed;
        if (!failed)
            copy_cells(&chip.synced, &chip.cells);
    }
    return failed ? ERR_DEVICE : ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    return &chip.flash;
}

/* ---- code ---- */

const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    void *code;

    if (slot >= CODE_SLOTS || size == 0 || !is_inside(offset, size) || fails(SIM_MAP_CODE))
        return NULL;
    SysFlashReleaseCode(slot);
    code = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (code == MAP_FAILED)
        return NULL;
    memcpy(code, chip.cells.data + offset, size);
    __builtin___clear_cache((char *)code, (char *)code + size);
    chip.mapping[slot].code = code;
    chip.mapping[slot].size = size;
    if (mprotect(code, size, PROT_READ | PROT_EXEC) != 0)
        SysFlashReleaseCode(slot);
    return chip.mapping[slot].code;
}

void SysFlashReleaseCode(RTS_UI32 slot)
{
    if (slot < CODE_SLOTS && chip.mapping[slot].code != NULL) {
        munmap(chip.mapping[slot].code, chip.mapping[slot].size);
        chip.mapping[slot].code = NULL;
    }
}

/* ---- what tests call ---- */

static bool is_power_of_two(RTS_UI32 n)
{
    return n != 0 && (n & (n - 1)) == 0;
}

static void free_cells(CELLS *cells)
{
    if (cells->data != NULL)
        munmap(cells->data, cells->size);
    if (cells->programmed != NULL)
        munmap(cells->programmed, cells->size);
    if (cells->touched != NULL)
        munmap(cells->touched, pages_of(cells->size));
    if (cells->change != NULL)
        munmap(cells->change, cells->size);
    memset(cells, 0, sizeof *cells);
}

static RTS_UI8 *map_shared(RTS_UI32 size)
{
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);

    return memory == MAP_FAILED ? NULL : memory;
}

static bool allocate_cells(CELLS *cells, RTS_UI32 size)
{
    cells->size = size;
    cells->owner = getpid();
    cells->programmed = map_shared(size);
    cells->touched = map_shared(pages_of(size));
    if (SimMapTwice(size, &cells->data, &cells->change) && cells->programmed != NULL && cells->touched != NULL)
        return true;
    free_cells(cells);
    return false;
}

static void set_functions(void)
{
    chip.flash.mapped = chip.unmapped ? NULL : chip.cells.data;
    chip.flash.read = flash_read;
    chip.flash.program = flash_program;
    chip.flash.erase = flash_erase;
    chip.flash.sync = flash_sync;
}

/* Whether a new flash can have the cells that there are; those of the parent process are the parent's. */
static bool can_renew_cells(RTS_UI32 size, RTS_UI8 erased)
{
    return chip.cells.data != NULL && chip.cells.size == size && chip.flash.erased == erased &&
           chip.cells.owner == getpid();
}

/* Makes the cells as new; those that there are, where something happened to them, if possible. */
static bool renew_cells(RTS_UI32 size, RTS_UI8 erased)
{
    if (!can_renew_cells(size, erased)) {
        free_cells(&chip.cells);
        if (!allocate_cells(&chip.cells, size))
            return false;
        memset(chip.cells.data, erased, size);
        return true;
    }
    for (RTS_UI32 page = 0; page < pages_of(size); page++) {
        RTS_UI32 left = size - page * PAGE;
        if (chip.cells.touched[page])
            erase_cells(page * PAGE, left < PAGE ? left : PAGE);
        chip.cells.touched[page] = 0;
    }
    protect(PROT_READ | PROT_WRITE);
    return true;
}

void SimSetFileStore(RTS_UI32 size)
{
    SimFileStoreSize = size;
}

void SimSetKeptLog(RTS_UI32 size)
{
    SimKeptLogSize = size;
}

RTS_RESULT SimFlashConfigure(RTS_UI32 size, RTS_UI32 sector_size, RTS_UI32 program_size, RTS_UI8 erased)
{
    if (!is_power_of_two(sector_size) || !is_power_of_two(program_size) || program_size > 16 || size == 0 ||
        size % sector_size != 0 || (erased != 0xFF && erased != 0))
        return ERR_PARAMETER;
    free_cells(&chip.kept);
    free_cells(&chip.synced);
    if (!renew_cells(size, erased))
        return ERR_NOMEMORY;
    chip.flash.size = size;
    chip.flash.sector_size = sector_size;
    chip.flash.program_size = program_size;
    chip.flash.erased = erased;
    chip.violations = 0;
    chip.violation[0] = '\0';
    SimFlashUnreadable(0, 0);
    set_functions();
    return ERR_OK;
}

void SimFlashPowerOff(void)
{
    if (chip.sync_failed && chip.synced.data != NULL) {
        set_writable(true);
        copy_cells(&chip.cells, &chip.synced);
    }
    chip.sync_failed = false;
}

RTS_RESULT SimFlashPowerOn(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 slot;

    for (slot = 0; slot < CODE_SLOTS; slot++)
        SysFlashReleaseCode(slot);
    SimFlashPowerOff();
    chip.operations = 0;
    memset(chip.calls, 0, sizeof chip.calls);
    chip.plan = chip.next_plan;
    memset(&chip.next_plan, 0, sizeof chip.next_plan);
    chip.power_lost = false;
    if (chip.plan.fail_at[SIM_SYNC] == 0)
        free_cells(&chip.synced);
    if (chip.cells.data == NULL)
        result = SimFlashConfigure(SIM_FLASH_SIZE, SIM_FLASH_SECTOR_SIZE, SIM_FLASH_PROGRAM_SIZE, SIM_FLASH_ERASED);
    if (result == ERR_OK)
        set_writable(false);
    return result;
}

void SimFlashSetMapped(int mapped)
{
    chip.unmapped = !mapped;
    set_functions();
}

RTS_UI8 *SimFlashData(void)
{
    if (chip.cells.data != NULL)
        set_writable(true);
    return chip.cells.data;
}

RTS_RESULT SimFlashLoad(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 i;

    if (chip.cells.data == NULL || size != chip.flash.size)
        return ERR_PARAMETER;
    set_writable(true);
    memcpy(chip.cells.data, data, size);
    for (i = 0; i < size; i++)
        chip.cells.programmed[i] = data[i] != chip.flash.erased;
    return ERR_OK;
}

RTS_UI32 SimFlashSize(void)
{
    return chip.flash.size;
}

RTS_RESULT SimFlashSave(void)
{
    if (chip.cells.data == NULL)
        return ERR_NOTINITIALIZED;
    if (chip.kept.data == NULL && !allocate_cells(&chip.kept, chip.flash.size))
        return ERR_NOMEMORY;
    copy_cells(&chip.kept, &chip.cells);
    return ERR_OK;
}

RTS_RESULT SimFlashRestore(void)
{
    if (chip.kept.data == NULL)
        return ERR_NO_OBJECT;
    set_writable(true);
    copy_cells(&chip.cells, &chip.kept);
    return ERR_OK;
}

void SimFlashCut(RTS_UI32 operation, RTS_UI32 mode)
{
    chip.plan.cut_at = operation == 0 ? 0 : chip.operations + operation;
    chip.plan.cut_mode = mode;
}

static void plan_failure(RTS_UI32 kind, RTS_UI32 call, bool all_after)
{
    if (kind >= SIM_CALLS)
        return;
    chip.plan.fail_on[kind] = all_after && call != 0;
    if (kind == SIM_SYNC && chip.synced.data == NULL) {
        if (!allocate_cells(&chip.synced, chip.flash.size))
            return;
        copy_cells(&chip.synced, &chip.cells);
    }
    chip.plan.fail_at[kind] = call == 0 ? 0 : chip.calls[kind] + call;
}

void SimFlashFail(RTS_UI32 kind, RTS_UI32 call)
{
    plan_failure(kind, call, false);
}

void SimFlashFailFrom(RTS_UI32 kind, RTS_UI32 call)
{
    plan_failure(kind, call, true);
}

void SimFlashUnreadable(RTS_UI32 offset, RTS_UI32 size)
{
    chip.unreadable = offset;
    chip.unreadable_size = size;
}

static RTS_UI32 count_from_zero(RTS_UI32 at, RTS_UI32 now)
{
    return at > now ? at - now : 0;
}

void SimFlashAtStart(void)
{
    RTS_UI32 kind;

    chip.next_plan.cut_at = count_from_zero(chip.plan.cut_at, chip.operations);
    chip.next_plan.cut_mode = chip.plan.cut_mode;
    for (kind = 0; kind < SIM_CALLS; kind++) {
        chip.next_plan.fail_at[kind] = count_from_zero(chip.plan.fail_at[kind], chip.calls[kind]);
        chip.next_plan.fail_on[kind] = chip.plan.fail_on[kind];
    }
    memset(&chip.plan, 0, sizeof chip.plan);
}

RTS_UI32 SimFlashCalls(RTS_UI32 kind)
{
    return kind < SIM_CALLS ? chip.calls[kind] : 0;
}

RTS_UI32 SimFlashOps(void)
{
    return chip.operations;
}

RTS_UI32 SimFlashViolations(void)
{
    return chip.violations;
}

const char *SimFlashViolation(void)
{
    return chip.violation;
}
