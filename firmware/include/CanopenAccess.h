/*
 * CanopenAccess.h - reads and writes objects of a CANopen device, with all checks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main. Functions return an abort code of SDO, 0: done.
 */
#ifndef CANOPENACCESS_H
#define CANOPENACCESS_H

#include "CanopenDict.h"

/* Reads an object into `data`, which has room for CANOPEN_DEVICE_SDO bytes. */
RTS_UI32 CanopenAccessRead(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI8 *data, RTS_UI32 *size);

/* Checks a write of `size` bytes to an object, before it is done. */
RTS_UI32 CanopenAccessCheck(const CANOPEN_OBJECT *object, RTS_UI32 size);

RTS_UI32 CanopenAccessWrite(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, const RTS_UI8 *data, RTS_UI32 size,
                            RTS_UI32 now_ms);

#endif
