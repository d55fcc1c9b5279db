/*
 * CanopenDriver.h - what the driver of CANopen has set up, for the simulator, which has the nodes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPENDRIVER_H
#define CANOPENDRIVER_H

#include "CanopenSetup.h"

/* What is configured now. From main. */
CANOPEN_SETUP *IoDrvCanopenGetSetup(void);

/* When main has something to do without a frame [ns], INT64_MAX: never. */
RTS_I64 IoDrvCanopenGetDueNs(RTS_I64 now_ns);

#endif
