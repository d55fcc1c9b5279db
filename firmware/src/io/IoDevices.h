/*
 * IoDevices.h - the state of each connector, for the manager.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IODEVICES_H
#define IODEVICES_H

#include "CmpStd.h"
#include "CompactDownload.h"
#include "IoDrv.h"

/* All connectors of the configuration begin again, without driver; `tasks` say which is the fastest. From main, while no
 * task runs. */
void IoDevicesReset(const CDL_TASK *tasks, RTS_UI32 task_count);

#if ONLINE_CHANGE
/* Finds the bus cycle tasks again; all else stays. While no task runs. */
void IoDevicesFollow(const CDL_TASK *tasks, RTS_UI32 task_count);
#endif

/* The driver of a connector, NULL: none. */
IO_DRIVER *IoDeviceGetDriver(RTS_UI32 index);
void IoDeviceSetDriver(RTS_UI32 index, IO_DRIVER *driver);

/* The driver if its data is good, NULL otherwise. */
IO_DRIVER *IoDeviceGetWell(RTS_UI32 index);

/* The task in whose cycle the state is brought up to date, and the bus cycle started if the connector has one of its
 * own. */
RTS_UI32 IoDeviceGetBusTask(RTS_UI32 index);
bool IoDeviceHasBusCycle(RTS_UI32 index);

/* A bus cycle that waits for who is in the driver. Take: whether there is one, which is not there any more. */
void IoDeviceLeaveBusCycle(RTS_UI32 index);
bool IoDeviceTakeBusCycle(RTS_UI32 index);

/* Brings the variables of the program up to date, of the connectors of a bus task, or of all. */
enum { IO_ALL_TASKS = 0xFF };
void IoDevicesUpdate(RTS_UI32 task);

/* Tells the log what has changed. From main. */
void IoDevicesLog(void);

#endif
