/*
 * IoMgrRequests.h - what the PC asks of a device: parameters, identify, scan.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOMGRREQUESTS_H
#define IOMGRREQUESTS_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoDrv.h"

/* ---- requests (8.2.3). From main; an error of the driver, ERR_NOT_SUPPORTED: it has no such function,
 * ERR_INVALIDID: there is no such connector, ERR_NO_OBJECT: it has no driver, or no such parameter. ---- */

RTS_RESULT IoMgrReadParameter(RTS_UI32 connector, RTS_UI32 id, void *data, RTS_UI32 bits, RTS_UI32 bit_offset);
RTS_RESULT IoMgrWriteParameter(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset);
RTS_RESULT IoMgrIdentify(RTS_UI32 connector);
RTS_RESULT IoMgrScanModules(RTS_UI32 connector, RTS_UI32 index, IoDrvModule *module);

/* How often a task found the driver of a connector busy, since the start of the runtime. */
RTS_UI32 IoMgrGetSkipped(RTS_UI32 connector);

#endif
