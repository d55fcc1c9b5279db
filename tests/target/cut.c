/*
 * cut.c - TCG plugin for QEMU 7.2: a power cut after the n-th store into a range of addresses.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Arguments lo=, hi= (the range, hi excluded), n= (0: never), out= (a file that has the number of stores so far). The
 * store is done, then the process ends with status 3. Debian has no header for plugins; these are the few prototypes
 * needed.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;

enum { NO_REGISTERS = 0, WRITES = 2, EXIT_CUT = 3 };

void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id id, void (*callback)(plugin_id, struct qemu_plugin_tb *));
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t index);
void qemu_plugin_register_vcpu_mem_cb(struct qemu_plugin_insn *insn,
                                      void (*callback)(unsigned cpu, uint32_t info, uint64_t address, void *data),
                                      int registers, int kind, void *data);
bool qemu_plugin_mem_is_store(uint32_t info);

EXPORT int qemu_plugin_version = 1;
EXPORT int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv);

static uint64_t lo, hi, cut_at, stores;
static const char *out;

static void write_count(void)
{
    FILE *file = fopen(out, "w");
    if (file == NULL)
        return;
    fprintf(file, "%llu\n", (unsigned long long)stores);
    fclose(file);
}

static void on_store(unsigned cpu, uint32_t info, uint64_t address, void *data)
{
    (void)cpu;
    (void)data;
    if (address < lo || address >= hi || !qemu_plugin_mem_is_store(info)) /* loads come too, in spite of WRITES */
        return;
    stores++;
    if (stores == cut_at)
        _exit(EXIT_CUT);
    if (out != NULL)
        write_count();
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

int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv)
{
    const struct {
        const char *name;
        uint64_t *value;
    } numbers[] = {{"lo", &lo}, {"hi", &hi}, {"n", &cut_at}};

    (void)info;
    for (int i = 0; i < argc; i++) {
        for (size_t k = 0; k < sizeof(numbers) / sizeof(numbers[0]); k++) {
            const char *text = value_of(argv[i], numbers[k].name);
            if (text != NULL)
                *numbers[k].value = strtoull(text, NULL, 0);
        }
        if (value_of(argv[i], "out") != NULL)
            out = value_of(argv[i], "out");
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translate);
    return 0;
}
