/*
 * CanopenCalls.h - what the blocks of CiA 405 do (stdlib/cia405.st): SDO transfers, NMT commands, states, emergencies.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A task takes a slot, puts what is to be written into it and sends it; main does the transfer; the task looks whether it
 * has ended, and gets what was read. Slots go from hand to hand by their state, without a lock: a task may be aborted at
 * any place, and no address of the program is kept. One client at a time asks a node: transfers to it wait for each
 * other, and the manager's for them. CANOPEN_MAX_CALLS slots; without, a program with such blocks is refused.
 */
#ifndef CANOPENCALLS_H
#define CANOPENCALLS_H

#include "CanopenSetup.h"

/* Offers the functions to programs; in CH_INIT3. */
RTS_RESULT CanopenCallsRegister(void);

/* Whose networks are meant from now on, and what sends frames; all slots are free. In main, while no task runs. */
void CanopenCallsBegin(CANOPEN_SETUP *setup, PF_CANOPEN_SEND send);

/* From main: a frame of a node. True: it was the reply to a transfer of a program. */
bool CanopenCallsTake(RTS_UI32 network, const CAN_FRAME *frame, RTS_UI32 now_ms);

/* In main, in each pass, before the nodes. */
void CanopenCallsPoll(bool is_running, RTS_UI32 now_ms);

/* From main, again and again while the result is ERR_PENDING: reads or writes an object of a node for a tool. ERR_TIMEOUT:
 * no reply; ERR_DEVICE: refused, the log has the abort code; ERR_OUT_OF_LIMITS: it has more bits; ERR_NOBUFFER: another
 * tool is at it. */
RTS_RESULT CanopenCallsRead(CANOPEN_DEVICE *device, RTS_UI32 id, void *data, RTS_UI32 bits);
RTS_RESULT CanopenCallsWrite(CANOPEN_DEVICE *device, RTS_UI32 id, const void *data, RTS_UI32 bits);

/* How long it is until a transfer has something to do without a frame [ms]; UINT32_MAX: never. */
RTS_UI32 CanopenCallsGetWaitMs(RTS_UI32 now_ms);

#endif
