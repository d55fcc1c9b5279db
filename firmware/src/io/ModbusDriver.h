/*
 * ModbusDriver.h - what the driver of Modbus has set up, for the simulator, which has the devices.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef MODBUSDRIVER_H
#define MODBUSDRIVER_H

#include "ModbusSetup.h"

/* What is configured now. From main. */
MODBUS_SETUP *IoDrvModbusGetSetup(void);

/* Until a client writes to a server for the first time, its memory is what the inputs are: so they start with the initial
 * values of the program. From main, while a program is loaded, before what a client writes is taken. */
void IoDrvModbusFollowInputs(void);

#endif
