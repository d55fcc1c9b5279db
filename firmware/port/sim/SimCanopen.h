/*
 * SimCanopen.h - the CANopen nodes of the description, on the CAN bus of the simulator.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMCANOPEN_H
#define SIMCANOPEN_H

#include "IoConfig.h"
#include "Sim.h"

enum { SIM_CANOPEN_NODE = 2 }; /* of SimCan.h, of all of them together */

/* Frames that have arrived, and what is due at this time. */
void SimCanopenRun(RTS_I64 now_ns);

/* When a node has something to do, INT64_MAX: never. */
RTS_I64 SimCanopenGetDueNs(void);

/* As in SIM_BUS. */
RTS_RESULT SimCanopenSet(const IoConfigConnector *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data);
RTS_RESULT SimCanopenGet(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_UI8 *data);
RTS_RESULT SimCanopenFail(const IoConfigConnector *connector, RTS_UI32 fault, RTS_UI32 value);

/* With the configuration: nodes without power, and those that have it now. */
void SimCanopenForget(void);
void SimCanopenMake(RTS_I64 now_ns);

#endif
