/*
 * SysStart.c - why this process starts: what the supervisor saw, or the user.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysStart.h"

#include "Supervisor.h"
#include "SysExcept.h"

static const SYS_START power = {
    .cause = SYS_START_POWER,
    .exception = RTSEXCPT_NOEXCEPTION,
    .task = -1,
    .code_offset = APP_NO_CODE_OFFSET,
    .text = "",
};

static const SYS_START *start = &power;

void PortSetStart(const SYS_START *why)
{
    start = why;
}

const SYS_START *SysStartGet(void)
{
    return start;
}
