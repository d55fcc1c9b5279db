/*
 * CmpIoMgrEmbedded.h - the I/O manager: what drivers ask of it, and what others see of devices.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 8.4, 8.5, 8.12.2. It calls the drivers (IoDrv.h) that the configuration of the loaded application names
 * (IoConfig.h): when it is loaded, in each cycle, in the safe state, and for requests from the PC.
 *
 * While the application is stopped or has an exception inputs are still read, from main, and devices kept up. Outputs are
 * safe then: each channel holds what the device got last, is zero, or has a value, as the configuration says.
 */
#ifndef CMPIOMGREMBEDDED_H
#define CMPIOMGREMBEDDED_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"
#include "IoConfig.h"
#include "IoDrv.h"
#include "IoMgrConfig.h"
#include "IoMgrDevices.h"
#include "IoMgrFollow.h"
#include "IoMgrRequests.h"

/* ---- drivers (8.4) ---- */

/* In CH_INIT2 and CH_EXIT2, from main. ERR_DUPLICATE: a driver of that name is there. */
RTS_RESULT IoMgrRegisterInstance(IO_DRIVER *driver);
RTS_RESULT IoMgrUnregisterInstance(IO_DRIVER *driver);

/* ---- configuring ---- */

/* Whether the configuration gives an enabled connector to a driver. */
bool IoMgrConfigIsMine(const IoConfigConnector *connector, const IO_DRIVER *driver);

/* `type`: IO_MAP_INPUTS or IO_MAP_OUTPUTS. */
typedef RTS_RESULT (*PF_IO_CHANNEL)(const IoConfigConnector *connector, const IoConfigChannelMap *channel,
                                    RTS_UI32 type);

/* In IoDrvUpdateMapping: shows a driver all channels of its own, one for each task that uses it, until `visit` returns an
 * error, which is returned. */
RTS_RESULT IoMgrConfigEachChannel(const IoConfigTaskMap *task_maps, int count, const IO_DRIVER *driver,
                                  PF_IO_CHANNEL visit);

/*
 * Why a driver refuses its configuration, in IoDrvUpdateConfiguration and IoDrvUpdateMapping: a sentence without the name
 * of the connector, which is put before it. The application is refused with it, and the driver returns what this
 * returns. ERR_OK: the connector is optional; the sentence is in the log, and the driver goes on without it.
 */
RTS_RESULT IoMgrConfigRefuse(const IoConfigConnector *connector, RTS_RESULT result, const char *format, ...)
    RTS_FORMAT(3, 4);

/* Events of the component; manual's numbers. */
enum {
    EVT_PrepareUpdateConfiguration = 0x10001,
    EVT_DoneUpdateConfiguration = 0x10002,
};

RTS_RESULT CmpIoMgrEmbedded_Hook(CMP_HOOK hook);

#endif
