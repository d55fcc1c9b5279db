/*
 * sim_port.h - what the files of the simulator share.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIM_PORT_H
#define SIM_PORT_H

#include "CmpItf.h"
#include "CmpStd.h"
#include "IoConfig.h"
#include "Sim.h"
#include "SysCom.h"

/* Power on: forget what RAM and pins held. */
RTS_RESULT SimFlashPowerOn(void);
void SimComPowerOn(void);
void SimNetPowerOn(void);
void SimRunStart(void);

/* Maps new memory at two addresses, NULL where that fails; munmap takes each of them back. Shared with child processes. */
bool SimMapTwice(RTS_UI32 size, RTS_UI8 **first, RTS_UI8 **second);

/* Starts the thread that aborts endless loops, once per process. */
void SimSuperviseStart(void);

/* Holds back what aborts a cycle, and all signals of this thread; then lets through again what it had before. */
void SimSuperviseHold(bool hold);

/* A mutex as on Linux, for what it costs. */
void SimMutexLock(void);
void SimMutexUnlock(void);

/* The events of the device become known to a runtime that starts. ERR_NOMEMORY. */
RTS_RESULT SimEventRegisterAll(void);

/* What IEC code calls to reach functions of the host. ERR_NOMEMORY. */
RTS_RESULT SimFunctionsRegister(void);

RTS_RESULT SysSim_Hook(CMP_HOOK hook);

/* Simulated field buses: lines with devices on them. Without them (NULL) there are no such lines, and IoDrvSim has all
 * devices. */
typedef struct {
    /* SysCom.h, of the lines from 1 on. */
    RTS_RESULT (*open)(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *line);
    void (*close)(RTS_UI32 line);
    RTS_UI32 (*read)(RTS_UI32 line, RTS_UI8 *data, RTS_UI32 size);
    RTS_UI32 (*write)(RTS_UI32 line, const RTS_UI8 *data, RTS_UI32 size);
    void (*discard)(RTS_UI32 line);
    RTS_I64 (*byte_ns)(RTS_UI32 line);
    /* Sim.h, of a connector that is on a bus or is one: as SimIoWrite, SimIoRead and SimIoFault. ERR_NOT_SUPPORTED: it is
     * neither. */
    RTS_RESULT (*set)(const IoConfigConnector *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data);
    RTS_RESULT (*get)(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_UI8 *data);
    RTS_RESULT (*fail)(const IoConfigConnector *connector, RTS_UI32 fault, RTS_UI32 value);
    /* When main has something to do for a bus, INT64_MAX: never. */
    RTS_I64 (*due_ns)(RTS_I64 now_ns);
    /* When something happens on a bus that main may have nothing to do with, INT64_MAX: never. */
    RTS_I64 (*next_ns)(void);
    /* Lets it happen. True if main has something to do. */
    bool (*run)(RTS_I64 now_ns);
} SIM_BUS;

extern const SIM_BUS *SimBus;
RTS_RESULT SimBuses_Hook(CMP_HOOK hook);
RTS_RESULT SimCanBus_Hook(CMP_HOOK hook);

#endif
