/*
 * SimTimes.h - units of virtual time.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMTIMES_H
#define SIMTIMES_H

#include "CmpStd.h"

#define NEVER INT64_MAX
#define NS_PER_US ((RTS_I64)1000)
#define NS_PER_MS ((RTS_I64)1000000)

#endif
