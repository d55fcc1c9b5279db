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
#include <unistd.h>

#include "Sim.h"
#include "SysFlash.h"
#include "rts_config.h"
#include "sim_port.h"

enum { CODE_SLOTS = 2 };

typedef struct {
    RTS_UI8 *code;
    RTS_UI32 size;
} MAPPING;

/* The cells, and which of them were programmed since they were erased; shared with child processes. */
typedef struct {
    int file;      /* memory with the cells, by which they are changed */
    RTS_UI8 *data; /* the same, for reading */
    RTS_UI8 *programmed;
    RTS_UI32 size;
} CELLS;

static struct {
    SYS_FLASH flash;
    CELLS cells;
    CELLS kept; /* by SimFlashSave */
    bool unmapped;
    RTS_UI32 operations;
    RTS_UI32 cut_at; /* value of `operations` at which it happens, 0: never */
    RTS_UI32 cut_mode;
    bool power_lost;
    bool on;
    RTS_UI32 calls[SIM_CALL_KINDS];
    struct {
        RTS_UI32 in; /* how many calls until the first one that fails, that one included; 0: it is due or past */
        RTS_UI32 count; /* that are still to fail */
    } failing[SIM_CALL_KINDS];
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

/* Whether tests may store into the cells. */
static void set_writable(bool writable)
{
    (void)mprotect(chip.cells.data, chip.cells.size, writable ? PROT_READ | PROT_WRITE : PROT_READ);
}

static void set_cells(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    if (pwrite(chip.cells.file, data, size, (off_t)offset) != (ssize_t)size)
        violate("the simulator's memory failed", offset);
}

/* ---- failing calls and cuts ---- */

/* Counts a call; true when it was planned to fail. */
static bool call_fails(RTS_UI32 kind)
{
    chip.calls[kind]++;
    if (chip.failing[kind].in > 0)
        chip.failing[kind].in--;
    if (chip.failing[kind].in > 0 || chip.failing[kind].count == 0)
        return false;
    chip.failing[kind].count--;
    return true;
}

static void forget_plans(void)
{
    chip.cut_at = 0;
    memset(chip.failing, 0, sizeof chip.failing);
}

/* Counts an operation on `size` bytes; returns how many of them happen. *after: what follows, SIM_CUT_* or
 * SIM_FAULT. */
static RTS_UI32 begin_operation(RTS_UI32 size, int *after)
{
    *after = -1;
    if (++chip.operations != chip.cut_at)
        return size;
    chip.cut_at = 0;
    *after = (int)chip.cut_mode;
    if (chip.cut_mode == SIM_CUT_AFTER)
        return size;
    return chip.cut_mode == SIM_CUT_BEFORE ? 0 : size / 2;
}

static RTS_RESULT end_operation(int after)
{
    if (after < 0)
        return ERR_OK;
    if (after != SIM_FAULT) {
        chip.power_lost = true;
        chip.on = false;
        SimPowerCut();
    }
    return ERR_DEVICE;
}

/* ---- what the runtime calls ---- */

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    if (!is_inside(offset, size))
        return violate("read outside", offset);
    if (call_fails(SIM_CALL_READ))
        return ERR_DEVICE;
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
    RTS_UI8 part[64];
    RTS_UI32 done;
    RTS_UI32 count;

    for (done = 0; done < size; done += count) {
        RTS_UI32 i;
        count = size - done < sizeof part ? size - done : (RTS_UI32)sizeof part;
        for (i = 0; i < count; i++)
            part[i] = programmed_cell(chip.cells.data[offset + done + i], data[done + i]);
        set_cells(offset + done, part, count);
    }
    memset(chip.cells.programmed + offset, 1, (size + unit - 1) / unit * unit);
}

static void erase_cells(RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI8 part[64];
    RTS_UI32 done;

    memset(part, chip.flash.erased, sizeof part);
    for (done = 0; done < size; done += (RTS_UI32)sizeof part)
        set_cells(offset + done, part, size - done < sizeof part ? size - done : (RTS_UI32)sizeof part);
    memset(chip.cells.programmed + offset, 0, size);
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    RTS_UI32 unit = chip.flash.program_size;
    int after;

    if (chip.power_lost)
        return ERR_DEVICE;
    if (!is_inside(offset, size) || size == 0)
        return violate("program outside", offset);
    if (offset % unit != 0 || size % unit != 0)
        return violate("program misaligned", offset);
    if (call_fails(SIM_CALL_PROGRAM))
        return ERR_DEVICE;
    if (was_programmed(offset, size))
        violate("programmed twice", offset);
    program_cells(offset, data, begin_operation(size, &after));
    return end_operation(after);
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    RTS_UI32 size = chip.flash.sector_size;
    int after;

    if (chip.power_lost)
        return ERR_DEVICE;
    if (!is_inside(offset, size))
        return violate("erase outside", offset);
    if (offset % size != 0)
        return violate("erase misaligned", offset);
    if (call_fails(SIM_CALL_ERASE))
        return ERR_DEVICE;
    size = begin_operation(size, &after);
    erase_cells(offset, size);
    return end_operation(after);
}

static RTS_RESULT flash_sync(void)
{
    return chip.power_lost || call_fails(SIM_CALL_SYNC) ? ERR_DEVICE : ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    return &chip.flash;
}

/* ---- code ---- */

const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    void *code;

    if (slot >= CODE_SLOTS || size == 0 || !is_inside(offset, size))
        return NULL;
    SysFlashReleaseCode(slot);
    if (call_fails(SIM_CALL_MAP))
        return NULL;
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
    if (cells->size != 0)
        close(cells->file);
    memset(cells, 0, sizeof *cells);
}

static RTS_UI8 *map_shared(int file, RTS_UI32 size)
{
    int flags = file < 0 ? MAP_SHARED | MAP_ANONYMOUS : MAP_SHARED;
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, flags, file, 0);

    return memory == MAP_FAILED ? NULL : memory;
}

static bool allocate_cells(CELLS *cells, RTS_UI32 size)
{
    cells->file = memfd_create("flash", MFD_CLOEXEC);
    if (cells->file < 0)
        return false;
    cells->size = size;
    cells->programmed = map_shared(-1, size);
    cells->data = ftruncate(cells->file, (off_t)size) == 0 ? map_shared(cells->file, size) : NULL;
    if (cells->data != NULL && cells->programmed != NULL)
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

RTS_RESULT SimFlashConfigure(RTS_UI32 size, RTS_UI32 sector_size, RTS_UI32 program_size, RTS_UI8 erased)
{
    if (!is_power_of_two(sector_size) || !is_power_of_two(program_size) || program_size > 16 || size == 0 ||
        size % sector_size != 0 || (erased != 0xFF && erased != 0))
        return ERR_PARAMETER;
    free_cells(&chip.cells);
    free_cells(&chip.kept);
    if (!allocate_cells(&chip.cells, size))
        return ERR_NOMEMORY;
    memset(chip.cells.data, erased, size);
    chip.flash.size = size;
    chip.flash.sector_size = sector_size;
    chip.flash.program_size = program_size;
    chip.flash.erased = erased;
    chip.violations = 0;
    chip.violation[0] = '\0';
    set_functions();
    return ERR_OK;
}

RTS_RESULT SimFlashPowerOn(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 slot;

    for (slot = 0; slot < CODE_SLOTS; slot++)
        SysFlashReleaseCode(slot);
    if (chip.on)
        forget_plans();
    chip.on = true;
    chip.operations = 0;
    chip.power_lost = false;
    memset(chip.calls, 0, sizeof chip.calls);
    if (chip.cells.data == NULL)
        result = SimFlashConfigure(SIM_FLASH_SIZE, SIM_FLASH_SECTOR_SIZE, SIM_FLASH_PROGRAM_SIZE, SIM_FLASH_ERASED);
    if (result == ERR_OK)
        set_writable(false);
    return result;
}

void SimFlashPowerOff(void)
{
    chip.on = false;
    forget_plans();
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

static void copy_cells(CELLS *to, const CELLS *from)
{
    memcpy(to->data, from->data, chip.flash.size);
    memcpy(to->programmed, from->programmed, chip.flash.size);
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
    chip.cut_at = operation == 0 ? 0 : chip.operations + operation;
    chip.cut_mode = mode;
}

void SimFlashFail(RTS_UI32 kind, RTS_UI32 call, RTS_UI32 count)
{
    if (kind >= SIM_CALL_KINDS)
        return;
    chip.failing[kind].in = call;
    chip.failing[kind].count = call == 0 ? 0 : count;
}

RTS_UI32 SimFlashCalls(RTS_UI32 kind)
{
    return kind < SIM_CALL_KINDS ? chip.calls[kind] : 0;
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
