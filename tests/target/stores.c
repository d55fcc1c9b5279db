/*
 * stores.c - TCG plugin for QEMU: every store into the board's flash, in order.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Arguments base=, size= (of the flash, in the guest), memory= (the file it is in), out=, sector=. Each store appends the
 * offset of its aligned block of 8 bytes (u32) and what that block holds afterwards to `out`, at once: the flash after
 * n stores is the flash before, with the first n of these written over it. With sector= stores are commands to a flash
 * with sectors of that size: what counts is each block of the sector that they have changed. Debian has no header for
 * plugins; these are the few prototypes needed, which are the same in all versions. -DVERSION: of the
 * interface, 2 from QEMU 9 on.
 */
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;

enum { NO_REGISTERS = 0, WRITES = 2, BLOCK = 8 };

void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id id, void (*callback)(plugin_id, struct qemu_plugin_tb *));
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t index);
void qemu_plugin_register_vcpu_mem_cb(struct qemu_plugin_insn *insn,
                                      void (*callback)(unsigned cpu, uint32_t info, uint64_t address, void *data),
                                      int registers, int kind, void *data);
bool qemu_plugin_mem_is_store(uint32_t info);

EXPORT int qemu_plugin_version = VERSION;
EXPORT int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv);

static uint64_t base, size, sector;
static const uint8_t *memory;
static uint8_t *before; /* what it was like, with sector= */
static int out = -1;

static void write_block(uint64_t offset)
{
    struct {
        uint32_t offset;
        uint8_t block[BLOCK];
    } record;

    record.offset = (uint32_t)offset;
    memcpy(record.block, memory + offset, BLOCK);
    if (write(out, &record, sizeof(record)) != (ssize_t)sizeof(record))
        abort();
}

static void write_changed_blocks(uint64_t begin)
{
    if (memcmp(before + begin, memory + begin, sector) == 0)
        return;
    for (uint64_t offset = begin; offset < begin + sector; offset += BLOCK)
        if (memcmp(before + offset, memory + offset, BLOCK) != 0)
            write_block(offset);
    memcpy(before + begin, memory + begin, sector);
}

static void on_store(unsigned cpu, uint32_t info, uint64_t address, void *data)
{
    uint64_t offset = address - base;

    (void)cpu;
    (void)data;
    if (offset >= size || !qemu_plugin_mem_is_store(info)) /* loads come too, in spite of WRITES */
        return;
    if (sector == 0)
        write_block(offset / BLOCK * BLOCK);
    else
        write_changed_blocks(offset / sector * sector);
}

static void on_translate(plugin_id id, struct qemu_plugin_tb *tb)
{
    (void)id;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(tb); i++)
        qemu_plugin_register_vcpu_mem_cb(qemu_plugin_tb_get_insn(tb, i), on_store, NO_REGISTERS, WRITES, NULL);
}

static const char *value_of(const char *argument, const char *name)
{
    size_t length = strlen(name);
    return strncmp(argument, name, length) == 0 && argument[length] == '=' ? argument + length + 1 : NULL;
}

static const char *find_value(int argc, char **argv, const char *name)
{
    for (int i = 0; i < argc; i++)
        if (value_of(argv[i], name) != NULL)
            return value_of(argv[i], name);
    return "";
}

int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv)
{
    (void)info;
    base = strtoull(find_value(argc, argv, "base"), NULL, 0);
    size = strtoull(find_value(argc, argv, "size"), NULL, 0);
    out = open(find_value(argc, argv, "out"), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    int file = open(find_value(argc, argv, "memory"), O_RDONLY);
    memory = mmap(NULL, size, PROT_READ, MAP_SHARED, file, 0);
    if (out < 0 || memory == MAP_FAILED)
        return 1;
    sector = strtoull(find_value(argc, argv, "sector"), NULL, 0);
    before = malloc(size);
    if (before == NULL)
        return 1;
    memcpy(before, memory, size);
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translate);
    return 0;
}
