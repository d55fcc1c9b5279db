/*
 * CanopenStore.h - what a CANopen device keeps over power-off: 1010h, 1011h and the node number of LSS.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One file of FileStore.h has what 1010h stores, so a power cut leaves the previous or the new one. It is void for another
 * dictionary. From main. Without a file store nothing is stored.
 */
#ifndef CANOPENSTORE_H
#define CANOPENSTORE_H

#include "CanopenDict.h"
#include "CmpErrors.h"

#define CANOPEN_STORE_FILE "canopen.conf"
#define CANOPEN_NODE_FILE "canopen.node"

enum { CANOPEN_PART_SETTINGS = 1, CANOPEN_PART_VALUES = 2, CANOPEN_PARTS = 3 };

/* Before all others, after SysFileFlash: there may be no component that has opened the store. */
void CanopenStoreOpen(void);

/* Stores the present settings, values or both; a part that is not named stays as it was stored. ERR_NOT_SUPPORTED,
 * ERR_INVALID_STATE: a tool is writing a file; errors of the store. */
RTS_RESULT CanopenStoreSave(const CANOPEN_SLAVE *slave, RTS_UI32 parts);

/* From now on a part is not stored. Errors as above. */
RTS_RESULT CanopenStoreForget(const CANOPEN_SLAVE *slave, RTS_UI32 parts);

/* Restores a stored part. Objects that are not stored, or are of another dictionary, keep their values. */
void CanopenStoreLoad(CANOPEN_SLAVE *slave, RTS_UI32 part);

/* The node number that LSS has stored for this device, 0: none, CANOPEN_NO_NODE: it shall have none. */
enum { CANOPEN_NO_NODE = 0xFF };
RTS_RESULT CanopenStoreNode(RTS_UI8 node);
RTS_UI8 CanopenStoredNode(void);

#endif
