/*
 * pid.c - twin of pid.st.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <math.h>
#include <stdint.h>

enum { LOOPS = 64 };

typedef struct {
    float gain, integral_gain, derivative_gain, cycle, low, high;
    float integral, last_error;
} CONTROLLER;

uint32_t chk;
static CONTROLLER controllers[LOOPS];
static float plants[LOOPS];
static float setpoint;
static int32_t count;

void scan_init(void)
{
    static const CONTROLLER fresh = {2.5f, 4.0f, 0.01f, 0.001f, -50.0f, 50.0f, 0.0f, 0.0f};

    for (int i = 0; i < LOOPS; i++) {
        controllers[i] = fresh;
        plants[i] = 0.0f;
    }
    setpoint = 10.0f;
    count = 0;
    chk = 0;
}

static float control(CONTROLLER *c, float target, float actual)
{
    float error = target - actual;
    float sum = c->gain * error + c->integral + c->derivative_gain * (error - c->last_error) / c->cycle;

    c->last_error = error;
    if (sum > c->high)
        return c->high;
    if (sum < c->low)
        return c->low;
    c->integral += c->integral_gain * error * c->cycle;
    return sum;
}

void scan(void)
{
    float total = 0.0f;

    if (++count % 200 == 0)
        setpoint = 25.0f - setpoint;
    for (int i = 0; i < LOOPS; i++) {
        plants[i] += (control(&controllers[i], setpoint, plants[i]) - plants[i]) * 0.02f;
        total += plants[i];
    }
    chk = (chk << 1 | chk >> 31) ^ (uint32_t)(int32_t)rintf(total * 16.0f);
}
