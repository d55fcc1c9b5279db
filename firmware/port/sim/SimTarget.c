/*
 * SimTarget.c - what the simulated device says it is.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CompactDownload.h"
#include "Sim.h"
#include "SysTarget.h"

#if defined(__aarch64__)
#define SIM_TARGET_ID TARGET_ID_AARCH64_LINUX
#elif defined(__ARM_PCS_VFP)
#define SIM_TARGET_ID TARGET_ID_ARMV7_LINUX
#elif defined(_WIN32)
#define SIM_TARGET_ID TARGET_ID_X86_64_WINDOWS
#else
#define SIM_TARGET_ID TARGET_ID_X86_64_LINUX
#endif

static const char *board_name;

static SYS_TARGET target = {
    TARGET_TYPE_PROGRAMMABLE, SIM_TARGET_ID, 0x01000000, "plctool simulator", "plctool", "simulator", "0",
};

const SYS_TARGET *SysTargetGet(void)
{
    return &target;
}

/* It stands for any board, unless a test says which one it is. */
bool SysTargetIsBoard(const char *name)
{
    return board_name == NULL || strcmp(name, board_name) == 0;
}

SYS_STACK SysTargetGetStack(void)
{
    return (SYS_STACK){0, 0};
}

/* A xorshift generator: what it gives is the same in every process, so that tests repeat. */
RTS_UI32 SysTargetRandom(void)
{
    static RTS_UI32 state = 0x2545F491;

    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

bool SysTargetHasGenerator(void)
{
    return true;
}

void SimSetTarget(RTS_UI32 type, RTS_UI32 id, RTS_UI32 version)
{
    target.type = type;
    target.id = id;
    target.version = version;
}

void SimSetBoard(const char *name)
{
    board_name = name;
}
