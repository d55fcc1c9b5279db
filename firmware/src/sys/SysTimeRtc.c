/*
 * SysTimeRtc.c - the wall clock of a port that has none.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTimeRtc.h"

__attribute__((weak)) RTS_RESULT SysTimeRtcGet(RTS_I64 *utc_ns)
{
    RTS_UNUSED(utc_ns);
    return ERR_NOT_SUPPORTED;
}

__attribute__((weak)) RTS_RESULT SysTimeRtcSet(RTS_I64 utc_ns)
{
    RTS_UNUSED(utc_ns);
    return ERR_NOT_SUPPORTED;
}
