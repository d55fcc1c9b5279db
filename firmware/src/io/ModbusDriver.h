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

#endif
