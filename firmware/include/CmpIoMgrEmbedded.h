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

/* ---- drivers (8.4) ---- */

/* In CH_INIT2 and CH_EXIT2, from main. ERR_DUPLICATE: a driver of that name is there. */
RTS_RESULT IoMgrRegisterInstance(IO_DRIVER *driver);
RTS_RESULT IoMgrUnregisterInstance(IO_DRIVER *driver);

/* ---- the configuration (8.5). From any context while the application is loaded; a few instructions, but for lists. ---- */

/* Of the `*count` connectors from `connectors` on the first one of a type (CT_*), or NULL; *count is how many there are
 * from it on. Next: the one after `connector`. */
const IoConfigConnector *IoMgrConfigGetFirstConnector(const IoConfigConnector *connectors, int *count, RTS_UI16 type);
const IoConfigConnector *IoMgrConfigGetNextConnector(const IoConfigConnector *connector, int *count, RTS_UI16 type);
/* The same for those on a bus or device. */
const IoConfigConnector *IoMgrConfigGetFirstChild(const IoConfigConnector *connectors, int *count,
                                                  const IoConfigConnector *parent);
const IoConfigConnector *IoMgrConfigGetNextChild(const IoConfigConnector *connector, int *count,
                                                 const IoConfigConnector *parent);

/* Whether the configuration gives an enabled connector to a driver. */
bool IoMgrConfigIsMine(const IoConfigConnector *connector, const IO_DRIVER *driver);

/* Its place among all connectors, for tables of a driver, and the other way: NULL when there is none. */
RTS_UI32 IoMgrConfigGetIndex(const IoConfigConnector *connector);
const IoConfigConnector *IoMgrConfigGetConnector(RTS_UI32 index);
const char *IoMgrConfigGetName(const IoConfigConnector *connector);

/* A parameter, NULL when the connector does not have it. */
const IoConfigParameter *IoMgrConfigGetParameter(const IoConfigConnector *connector, RTS_UI32 id);
/* Its value; 0 or NULL and ERR_PARAMETER when `parameter` is NULL, or its value is of more bits (Pointer: of up to 32 that
 * stand in the table). `result` may be NULL. */
RTS_UI32 IoMgrConfigGetParameterValueDword(const IoConfigParameter *parameter, RTS_RESULT *result);
RTS_UI16 IoMgrConfigGetParameterValueWord(const IoConfigParameter *parameter, RTS_RESULT *result);
RTS_UI8 IoMgrConfigGetParameterValueByte(const IoConfigParameter *parameter, RTS_RESULT *result);
const void *IoMgrConfigGetParameterValuePointer(const IoConfigParameter *parameter, RTS_RESULT *result);
/* A text, NULL when it is none: its last byte is not NUL. */
const char *IoMgrConfigGetParameterValueText(const IoConfigParameter *parameter);

/* The entries of a map. */
const IoConfigConnectorMap *IoMgrConfigGetConnectorMaps(const IoConfigTaskMap *map);
const IoConfigChannelMap *IoMgrConfigGetChannelMaps(const IoConfigConnectorMap *map);

/*
 * Why a driver refuses its configuration, in IoDrvUpdateConfiguration and IoDrvUpdateMapping: a sentence without the name
 * of the connector, which is put before it. The application is refused with it, and the driver returns what this
 * returns. ERR_OK: the connector is optional; the sentence is in the log, and the driver goes on without it.
 */
RTS_RESULT IoMgrConfigRefuse(const IoConfigConnector *connector, RTS_RESULT result, const char *format, ...);

/* ---- diagnosis (8.8). From any context, interrupts too. ---- */

/* Sets and resets CF_* of a connector. One that sets CF_CONNECTOR_BUS_ERROR or CF_CONNECTOR_ERROR counts as an error,
 * each time. */
void IoMgrConfigSetDiagnosis(const IoConfigConnector *connector, RTS_UI32 flags);
void IoMgrConfigResetDiagnosis(const IoConfigConnector *connector, RTS_UI32 flags);

/* Good data came from the device now, or went to it: it is found, configured, active and without error, and the age
 * of its data is 0. */
void IoMgrConfigNoteData(const IoConfigConnector *connector);
/* Something failed, and the device is not lost for that. */
void IoMgrConfigNoteError(const IoConfigConnector *connector);

/* ---- copies (8.12.2). In IoDrvReadInputs and IoDrvWriteOutputs, within SysLock. ---- */

/*
 * Copies one channel between the memory of its parameter in the driver, from bit 0 of the parameter on, and the inputs or
 * outputs; the driver knows that its memory is as long. LE: the device has the lowest byte of a number first; BE: the
 * highest. What the engineer says of a channel (IO_CHANNEL_BIG_ENDIAN) turns it round. Channels of single bits are
 * not changed by either; other bits of their byte stay.
 */
void IoMgrCopyInputLE(const IoConfigChannelMap *channel, const void *memory);
void IoMgrCopyInputBE(const IoConfigChannelMap *channel, const void *memory);
void IoMgrCopyOutputLE(const IoConfigChannelMap *channel, void *memory);
void IoMgrCopyOutputBE(const IoConfigChannelMap *channel, void *memory);

/* ---- requests (8.2.3). From main; an error of the driver, ERR_NOT_SUPPORTED: it has no such function,
 * ERR_INVALIDID: there is no such connector, ERR_NO_OBJECT: it has no driver, or no such parameter. ---- */

RTS_RESULT IoMgrReadParameter(RTS_UI32 connector, RTS_UI32 id, void *data, RTS_UI32 bits, RTS_UI32 bit_offset);
RTS_RESULT IoMgrWriteParameter(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset);
RTS_RESULT IoMgrIdentify(RTS_UI32 connector);
RTS_RESULT IoMgrScanModules(RTS_UI32 connector, RTS_UI32 index, IoDrvModule *module);

/* How a connector is now. ERR_INVALIDID. */
RTS_RESULT IoMgrGetState(RTS_UI32 connector, IO_DEVICE_STATE *state);

/* Events of the component; manual's numbers. */
enum {
    EVT_PrepareUpdateConfiguration = 0x10001,
    EVT_DoneUpdateConfiguration = 0x10002,
    EVT_PrepareUpdateMapping = 0x10005,
    EVT_DoneUpdateMapping = 0x10006,
};

RTS_RESULT CmpIoMgrEmbedded_Hook(CMP_HOOK hook);

#endif
