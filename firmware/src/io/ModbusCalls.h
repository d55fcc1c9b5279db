/*
 * ModbusCalls.h - requests that a program makes once, by the blocks MODBUS_READ and MODBUS_WRITE of the library.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A task takes a slot, puts what is to be written into it and sends it; main does the request in turn with the jobs of
 * the line; the task looks whether it has ended, and gets what was read. No address of the program is kept, so nothing is
 * left of a program that has gone. Slots go from hand to hand by their state, without a lock: a task may be aborted at
 * any place. MODBUS_MAX_CALLS of them; without, a program with such blocks is refused.
 */
#ifndef MODBUSCALLS_H
#define MODBUSCALLS_H

#include "ModbusSetup.h"

/* ErrorID of the blocks; below these, the exception of the device. */
enum {
    MODBUS_ERROR_NO_DEVICE = 0x101, /* the description names no such device of a client */
    MODBUS_ERROR_INVALID = 0x102,   /* function, address, count or room for the data */
    MODBUS_ERROR_NO_ROOM = 0x103,   /* as many requests are on their way as there may be: again later */
    MODBUS_ERROR_NO_REPLY = 0x104,  /* from the device, or it is lost */
    MODBUS_ERROR_CANCELLED = 0x105, /* the program was stopped, or has not asked for a minute */
};

/* Offers the functions to programs; in CH_INIT3. */
RTS_RESULT ModbusCallsRegister(void);

/* Whose devices are asked from now on; NULL: none. `wake`, if there is one, is called by the task that sends a
 * request. In main, while no task runs. */
void ModbusCallsBegin(MODBUS_SETUP *setup, void (*wake)(void));

/* In main, in each pass. Takes back what is not asked for any more, so that nothing is sent for a program that does not run. */
void ModbusCallsPoll(bool is_running, RTS_I64 now_ns);

#endif
