/*
 * SimCanBus.h - the CAN bus of the simulator, on the virtual clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMCANBUS_H
#define SIMCANBUS_H

#include "CmpItf.h"

/* When main has something to do for the bus, INT64_MAX: never. */
RTS_I64 SimCanBusGetDueNs(RTS_I64 now_ns);

/* As in SIM_BUS. */
RTS_I64 SimCanBusGetNextNs(void);
bool SimCanBusRun(RTS_I64 now_ns);

RTS_RESULT SimCanBus_Hook(CMP_HOOK hook);

#endif
