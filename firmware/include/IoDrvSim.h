/*
 * IoDrvSim.h - driver of simulated devices: its parameters (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Any connector may be one of it (driver "IoDrvSim"), with any parameters. On the simulator it also takes the
 * connectors of drivers that are not there, so that a program runs with its real description. Each parameter that a
 * channel names has a memory of its own, zero at first, as long as its channels need, which IoMgrWriteParameter writes and
 * IoMgrReadParameter reads: what is written to that of an input is what the device measures.
 */
#ifndef IODRVSIM_H
#define IODRVSIM_H

#include "CmpStd.h"

/* Ids that no channel has: faults of the device, u32 each, to be written at any time. */
enum {
    IO_SIM_ABSENT = 0x7FFF0001,  /* 1: it is not there: bus error until 0 is written */
    IO_SIM_LATE = 0x7FFF0002,    /* its data is as old as this [ms] */
    IO_SIM_TYPE = 0x7FFF0003,    /* 1: another type of device than the configuration says */
    IO_SIM_ANSWERS = 0x7FFF0004, /* so many next answers are bad */
    IO_SIM_CUT = 0x7FFF0005,     /* so many next answers end in the middle */
    IO_SIM_FAULTS = 5,           /* as many as there are */
};

#ifndef RTS_CFFI
#include "CmpItf.h"
RTS_RESULT IoDrvSim_Hook(CMP_HOOK hook);
#endif

#endif
