/*
 * IecClock.c - the wall clock for programs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecClock.h"

#include "CmpStd.h"
#include "SysTime.h"
#include "SysTimeRtc.h"
#include "rts_config.h"

enum { VERSION = 0x00010000 };

/* ns since 1970-01-01, at least 0; else the negative of an error. */
static RTS_I64 clock_get(void)
{
    RTS_I64 utc_ns = 0;
    RTS_RESULT result = SysTimeRtcGet(&utc_ns);

    if (result != ERR_OK)
        return -(RTS_I64)result;
    return utc_ns > 0 ? utc_ns : 0;
}

static RTS_UI32 clock_set(RTS_I64 utc_ns)
{
    return utc_ns < 0 ? (RTS_UI32)ERR_PARAMETER : SysTimeRtcSet(utc_ns);
}

/* ns since power on, as they pass: TIME() stays the same within a cycle. */
static RTS_I64 clock_now(void)
{
    return (RTS_I64)SysTimeGetNs();
}

APP_GATE(clock_get);
APP_GATE(clock_set);
APP_GATE(clock_now);

static const CMP_EXT_FUNCTION functions[] = {
    {"clock_get", 0xB6CF938A, VERSION, (RTS_PFN)APP_GATED(clock_get)}, /* clock_get():LINT */
    {"clock_set", 0x649BE92F, VERSION, (RTS_PFN)APP_GATED(clock_set)}, /* clock_set(LINT):UDINT */
    {"clock_now", 0x517B353D, VERSION, (RTS_PFN)APP_GATED(clock_now)}, /* clock_now():LINT */
};

RTS_RESULT IecClock_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? CMRegisterExternal(functions, RTS_COUNT(functions)) : ERR_OK;
}
