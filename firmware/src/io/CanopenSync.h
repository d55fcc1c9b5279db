/*
 * CanopenSync.h - SYNC of a CANopen network: sent or received, and the events of tasks that run by it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPENSYNC_H
#define CANOPENSYNC_H

#include "CanopenSetup.h"

/* Registers the events and starts the timers of an attached network; from main. ERR_* of IoMgrConfigRefuse. */
RTS_RESULT CanopenSyncBegin(CANOPEN_LINE *line);

/* Gives them back. Does nothing for what was not begun. */
void CanopenSyncEnd(CANOPEN_LINE *line);

/* In each bus cycle: sends the SYNC of a network that has one there. */
void CanopenSyncInBusCycle(CANOPEN_LINE *line);

/* In the context of the port: a SYNC has been received. */
void CanopenSyncTake(CANOPEN_LINE *line);

#endif
