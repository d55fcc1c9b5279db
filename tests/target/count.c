/*
 * count.c - TCG plugin for QEMU: how many instructions from one place to another, each time.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Arguments start= (an address), lo=, hi= (a range, hi excluded), out= (a file). Counts from each execution of start to
 * the next instruction within the range, and writes a line "instructions times" for each number that occurred. Debian
 * has no header for plugins; these are the few prototypes needed. -DVERSION: of the interface, 2 from QEMU 9 on.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;

enum { NO_REGISTERS = 0, LONGEST = 65536, WRITE_EVERY = 50 };

void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id id, void (*callback)(plugin_id, struct qemu_plugin_tb *));
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t index);
uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *insn);
void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *insn, void (*callback)(unsigned cpu, void *data),
                                            int registers, void *data);

EXPORT int qemu_plugin_version = VERSION;
EXPORT int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv);

static uint64_t start, lo, hi, executed, started, counted;
static uint64_t times[LONGEST];
static char *out, *out_new;

/* In one piece, because QEMU may be killed at any time. */
static void write_times(void)
{
    FILE *file = fopen(out_new, "w");
    if (file == NULL)
        return;
    for (int i = 0; i < LONGEST; i++)
        if (times[i] != 0)
            fprintf(file, "%d %llu\n", i, (unsigned long long)times[i]);
    fclose(file);
    rename(out_new, out);
}

static void on_instruction(unsigned cpu, void *data)
{
    uint64_t address = (uintptr_t)data;

    (void)cpu;
    if (started != 0 && address >= lo && address < hi) {
        uint64_t length = executed - started + 1;
        times[length < LONGEST ? length : LONGEST - 1]++;
        started = 0;
        if (++counted % WRITE_EVERY == 0)
            write_times();
    }
    executed++;
    if (address == start)
        started = executed;
}

static void on_translate(plugin_id id, struct qemu_plugin_tb *tb)
{
    (void)id;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(tb); i++) {
        struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, i);
        void *address = (void *)(uintptr_t)qemu_plugin_insn_vaddr(insn);
        qemu_plugin_register_vcpu_insn_exec_cb(insn, on_instruction, NO_REGISTERS, address);
    }
}

int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv)
{
    (void)info;
    for (int i = 0; i < argc; i++) {
        const char *value = strchr(argv[i], '=');
        if (value++ == NULL)
            continue;
        if (strncmp(argv[i], "start=", 6) == 0)
            start = strtoull(value, NULL, 0);
        else if (strncmp(argv[i], "lo=", 3) == 0)
            lo = strtoull(value, NULL, 0);
        else if (strncmp(argv[i], "hi=", 3) == 0)
            hi = strtoull(value, NULL, 0);
        else if (strncmp(argv[i], "out=", 4) == 0)
            out = strdup(value);
    }
    if (out == NULL)
        return 1;
    out_new = malloc(strlen(out) + 5);
    sprintf(out_new, "%s.new", out);
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translate);
    return 0;
}
