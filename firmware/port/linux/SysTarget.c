/*
 * SysTarget.c - the identity of this device: architecture, host name, a serial number from the machine id.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysTarget.h"

#include "CmpSettingsEmbedded.h"
#include "CompactDownload.h"
#include "port.h"
#include "rts_config.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/resource.h>
#include <unistd.h>

static struct {
    char node_name[65];
    char serial_number[17];
} state;

static SYS_TARGET target = {
    .type = TARGET_TYPE_PROGRAMMABLE,
    .id = BOARD_DEVICE_ID,
    .version = 0x01000000,
    .device_name = BOARD_DEVICE_NAME,
    .vendor_name = BOARD_VENDOR_NAME,
    .node_name = state.node_name,
    .serial_number = state.serial_number,
};

static const char *given_name; /* by the user; NULL: none */
static const char *board_name; /* of the machine, by the user; NULL: not known */

void PortTargetSetName(const char *name)
{
    given_name = name;
}

void PortTargetSetBoard(const char *name)
{
    target.device_name = board_name = name;
}

const SYS_TARGET *SysTargetGet(void)
{
    return &target;
}

/* A process runs on any machine: which board that is only the user can say. */
bool SysTargetIsBoard(const char *name)
{
    return board_name == NULL || strcmp(name, board_name) == 0;
}

/* It grows by need: what the system says it has grown to, against its limit. */
SYS_STACK SysTargetGetStack(void)
{
    SYS_STACK stack = {0, 0};
    struct rlimit limit;
    unsigned grown_kb = 0;
    char line[128];
    FILE *file = fopen("/proc/self/status", "re");
    while (file != NULL && fgets(line, sizeof(line), file) != NULL && sscanf(line, "VmStk: %u kB", &grown_kb) != 1) {
    }
    if (file != NULL) {
        fclose(file);
    }
    if (grown_kb != 0 && getrlimit(RLIMIT_STACK, &limit) == 0 && limit.rlim_cur <= INT32_MAX) {
        stack.size = (RTS_UI32)limit.rlim_cur;
        stack.unused = grown_kb < stack.size / 1024 ? stack.size - grown_kb * 1024 : 0;
    }
    return stack;
}

RTS_UI32 SysTargetRandom(void)
{
    RTS_UI32 value;
    if (getrandom(&value, sizeof(value), 0) != sizeof(value)) {
        abort(); /* documented not to happen for so few bytes; ids that can be guessed are no way out */
    }
    return value;
}

bool SysTargetHasGenerator(void)
{
    return true;
}

/* FNV-1a: the machine id itself is not to be shown to the network. */
static RTS_UI64 hash(const char *text)
{
    RTS_UI64 value = 0xCBF29CE484222325;
    for (; *text != '\0'; text++) {
        value = (value ^ (RTS_UI8)*text) * 0x100000001B3;
    }
    return value;
}

/* The machine id, or the host name on a machine without one. */
static void read_machine_id(char *text, int size)
{
    FILE *file = fopen("/etc/machine-id", "re");
    if (file == NULL || fgets(text, size, file) == NULL) {
        snprintf(text, (size_t)size, "%s", state.node_name);
    }
    if (file != NULL) {
        fclose(file);
    }
}

/* As the user or the settings of a product say, or that of the machine. */
static void name_node(void)
{
    const char *name = given_name != NULL ? given_name : SettgGetStringValue("SysTarget", "NodeName", NULL);
    if (name != NULL) {
        snprintf(state.node_name, sizeof(state.node_name), "%s", name);
    } else {
        gethostname(state.node_name, sizeof(state.node_name) - 1);
    }
}

RTS_RESULT SysTarget_Hook(CMP_HOOK hook)
{
    char id[80];
    if (hook == CH_INIT_SYSTEM) {
        memset(&state, 0, sizeof(state));
        name_node();
        read_machine_id(id, sizeof(id));
        snprintf(state.serial_number, sizeof(state.serial_number), "%016llX", (unsigned long long)hash(id));
    }
    return ERR_OK;
}
