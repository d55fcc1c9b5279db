/*
 * SysStart.c - why this process starts.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysStart.h"

#include "SysExcept.h"

static const SYS_START start = {
    .cause = SYS_START_POWER,
    .exception = RTSEXCPT_NOEXCEPTION,
    .task = -1,
    .code_offset = APP_NO_CODE_OFFSET,
    .text = "",
};

const SYS_START *SysStartGet(void)
{
    return &start;
}
