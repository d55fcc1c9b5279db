/*
 * tanks.h - the tanks example in C: what a harness calls.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef TANKS_H
#define TANKS_H

#include <stdint.h>

/* Puts everything into the state of a cold start. */
void tanks_init(void);

/* One cycle of the plant and of the controller, every 10 ms; `now_ms` is the time of the cycle. */
void plant_cycle(int32_t now_ms);
void control_cycle(int32_t now_ms);

/* The set point in %. */
void tanks_set(float setpoint);

/* The levels in %, and a number made of their bits. */
void tanks_levels(float *level1, float *level2);
uint32_t tanks_checksum(void);

#endif
