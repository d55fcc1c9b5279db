/*
 * sim_port.h - what the files of the simulator share.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIM_PORT_H
#define SIM_PORT_H

#include "CmpItf.h"
#include "CmpStd.h"

/* Power goes off now: back to the Sim* function that runs the runtime. Returns when there is none. */
void SimPowerCut(void);

/* Power on: forget what RAM and pins held. */
RTS_RESULT SimFlashPowerOn(void);
void SimComPowerOn(void);

/* Starts the thread that aborts endless loops, once per process. */
void SimSuperviseStart(void);

/* A mutex as on Linux, for what it costs. */
void SimMutexLock(void);
void SimMutexUnlock(void);

/* The events of the device become known to a runtime that starts. ERR_NOMEMORY. */
RTS_RESULT SimEventRegisterAll(void);

/* What IEC code calls to reach functions of the host. ERR_NOMEMORY. */
RTS_RESULT SimFunctionsRegister(void);

RTS_RESULT SysSim_Hook(CMP_HOOK hook);
/* The next pass of CH_COMM_CYCLE is in `in_ns` at the latest. From any context. */
void SimWantPass(RTS_I64 in_ns);
RTS_RESULT SimModbus_Hook(CMP_HOOK hook);

#endif
