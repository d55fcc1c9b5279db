/*
 * IoMgrConfig.h - how drivers read the I/O configuration of the loaded application, and copy its channels.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 8.5, 8.12.2. The loader has checked the configuration (IoConfigCheck.c): no index or offset of it is checked again.
 */
#ifndef IOMGRCONFIG_H
#define IOMGRCONFIG_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoConfig.h"

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

/* CRC-32 of its parameters: whether two connectors are configured alike. */
RTS_UI32 IoMgrConfigGetCrc(const IoConfigConnector *connector);

/* Its place among all connectors, for tables of a driver, and the other way: NULL when there is none. */
RTS_UI32 IoMgrConfigGetIndex(const IoConfigConnector *connector);
const IoConfigConnector *IoMgrConfigGetConnector(RTS_UI32 index);
const char *IoMgrConfigGetName(const IoConfigConnector *connector);
const char *IoMgrConfigGetDriverName(const IoConfigConnector *connector); /* that it asks for */

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

/* ---- copies (8.12.2). In IoDrvReadInputs and IoDrvWriteOutputs, within SysLock. ---- */

/*
 * Copies one channel between the memory of its parameter in the driver, from bit 0 of the parameter on, and the inputs or
 * outputs; the driver knows that its memory is as long. LE: the device has the lowest byte of a number first; BE: the
 * highest. What the engineer says of a channel (IO_CHANNEL_BIG_ENDIAN) turns it round. Channels of single bits are
 * not changed by either; other bits of their byte stay. While no cycle may start, an output is copied as the configuration
 * says for the safe state: zero, a value, or not at all if it holds.
 */
void IoMgrCopyInputLE(const IoConfigChannelMap *channel, const void *memory);
void IoMgrCopyInputBE(const IoConfigChannelMap *channel, const void *memory);
void IoMgrCopyOutputLE(const IoConfigChannelMap *channel, void *memory);
void IoMgrCopyOutputBE(const IoConfigChannelMap *channel, void *memory);
/* An output as in the safe state, at any time: for a device that has to be safe alone. */
void IoMgrCopySafeOutputLE(const IoConfigChannelMap *channel, void *memory);
/* What an input is now, perhaps its initial value, for a device that starts with it. */
void IoMgrCopyInputBackLE(const IoConfigChannelMap *channel, void *memory);

/* LE of `count` channels from `channel` on, all of them in one memory: faster than a call for each. */
void IoMgrCopyInputs(const IoConfigChannelMap *channel, RTS_UI32 count, const void *memory);
void IoMgrCopyOutputs(const IoConfigChannelMap *channel, RTS_UI32 count, void *memory);

#endif
