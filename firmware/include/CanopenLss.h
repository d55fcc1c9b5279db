/*
 * CanopenLss.h - a CANopen device gets its node number by LSS (CiA 305), with fastscan.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main. A new number counts after the next reset of communication; a device without one takes it when the master ends
 * the configuration.
 */
#ifndef CANOPENLSS_H
#define CANOPENLSS_H

#include "CanopenDict.h"

/* A frame of the master. `bit_rate`: of the bus [kbit/s], the only one that can be chosen; 0: not known. */
void LssSlaveTake(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 bit_rate);

/* Sends what waits. */
void LssSlavePoll(CANOPEN_SLAVE *slave);

#endif
