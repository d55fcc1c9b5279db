/*
 * SimCan.h - a CAN bus on the virtual clock: bit times, arbitration, acknowledgement, errors, bus off.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * All nodes are on one bus. Node 0 is the device, which reaches it through SysCan.h; tests are the others. A frame takes
 * as long as its bits do, with those that were stuffed; of the frames that wait when the bus is free the one with the
 * lowest identifier goes first. Time passes in SimCanAdvance only.
 */
#ifndef SIMCAN_H
#define SIMCAN_H

#include "SysCan.h"

enum { SIM_CAN_NODES = 16, SIM_CAN_QUEUE = 64, SIM_CAN_DEVICE = 0 };

/* A new bus; all nodes are stopped and have no filters. `data_bit_rate` 0: no FD. */
void SimCanReset(RTS_UI32 bit_rate, RTS_UI32 data_bit_rate);

/* `catch_up` is called before each frame of the device, to let the bus's time pass until now. NULL: time passes only in
 * SimCanAdvance. */
void SimCanSetClock(void (*catch_up)(void));

/* Number and base of the identifiers of the device (SysCanGetAddress). */
void SimCanSetAddress(RTS_UI32 node, RTS_UI32 base);

/* The functions of SysCan.h, of any node. A node that is started receives everything until it has filters. */
void SimCanStart(RTS_UI32 node);
void SimCanStop(RTS_UI32 node);
RTS_RESULT SimCanSetFilters(RTS_UI32 node, const CAN_FILTER *filters, RTS_UI32 count);
RTS_RESULT SimCanSend(RTS_UI32 node, const CAN_FRAME *frame);
RTS_RESULT SimCanReceive(RTS_UI32 node, CAN_FRAME *frame);

/* True if a frame has arrived, or there is room again for one that was refused. */
bool SimCanHasWork(RTS_UI32 node);
void SimCanGetState(RTS_UI32 node, CAN_STATE *state);
void SimCanRestart(RTS_UI32 node);

/* Virtual time of the bus [ns] since SimCanReset, and until when nothing happens; INT64_MAX if nothing is sent. */
RTS_I64 SimCanNow(void);
RTS_I64 SimCanNext(void);
void SimCanAdvance(RTS_I64 to_ns);

/* The next `count` frames that this node sends are destroyed on the bus; each is sent again. */
void SimCanDestroy(RTS_UI32 node, RTS_UI32 count);

/* One frame in `period` that arrives at this node is lost, as by an overrun; 0: none. */
void SimCanLose(RTS_UI32 node, RTS_UI32 period);

/* Time a frame takes on this bus, with the pause after it [ns]. */
RTS_I64 SimCanFrameNs(const CAN_FRAME *frame);

/* Time the bus was not free since SimCanReset [ns], and frames that were sent without errors. */
RTS_I64 SimCanBusyNs(void);
RTS_UI32 SimCanFrames(void);

#endif
