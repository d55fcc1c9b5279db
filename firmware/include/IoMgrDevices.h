/*
 * IoMgrDevices.h - what is known about the devices of the loaded application.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 8.8. Drivers say what they notice; the program sees it in its variables (IO_DEVICE_STATE), brought up to date
 * before the code of the bus cycle task of the device, and from main while the program is stopped; the log tells changes.
 */
#ifndef IOMGRDEVICES_H
#define IOMGRDEVICES_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoConfig.h"

/* ---- diagnostics (8.8). From any context, interrupts too. ---- */

/* Sets and resets CF_* of a connector. One that sets CF_CONNECTOR_BUS_ERROR or CF_CONNECTOR_ERROR counts as an error,
 * each time. */
void IoMgrConfigSetDiagnosis(const IoConfigConnector *connector, RTS_UI32 flags);
void IoMgrConfigResetDiagnosis(const IoConfigConnector *connector, RTS_UI32 flags);

/* Good data came from the device now, or went to it: it is found, configured, active and without error, and the age
 * of its data is 0. */
void IoMgrConfigNoteData(const IoConfigConnector *connector);
/* The same for a device that is always at hand, such as lines of the board: its data is of the moment it is read, until
 * an error is set. */
void IoMgrConfigNoteAlive(const IoConfigConnector *connector);
/* Something failed, and the device is not lost for that. */
void IoMgrConfigNoteError(const IoConfigConnector *connector);

/* How a connector is now. ERR_INVALIDID. */
RTS_RESULT IoMgrGetState(RTS_UI32 connector, IO_DEVICE_STATE *state);

#endif
