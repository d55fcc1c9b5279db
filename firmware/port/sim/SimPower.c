/*
 * SimPower.c - power of the simulated device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimPower.h"

#include <setjmp.h>
#include <string.h>

#include "Sim.h"

static struct {
    bool on;
    bool is_lost; /* by a planned cut, until SimStart */
    bool landing; /* `jump` is valid */
    jmp_buf jump;
} power;

bool SimIsOn(void)
{
    return power.on;
}

void SimPowerSetOn(bool on)
{
    power.on = on;
}

void SimPowerReturn(void)
{
    power.on = false;
    power.is_lost = false;
}

void SimPowerCheck(void)
{
    if (power.is_lost && power.landing)
        longjmp(power.jump, 1);
}

void SimPowerCut(void)
{
    power.is_lost = true;
    power.on = false;
    SimPowerCheck();
}

RTS_RESULT SimPowerRun(RTS_RESULT (*fn)(void *arg), void *arg)
{
    RTS_RESULT result;

    if (power.is_lost)
        return SIM_POWER_CUT;
    if (power.landing)
        return fn(arg);
    power.landing = true;
    if (setjmp(power.jump) == 0)
        result = fn(arg);
    else
        result = SIM_POWER_CUT;
    power.landing = false;
    return power.is_lost ? (RTS_RESULT)SIM_POWER_CUT : result;
}

RTS_RESULT SimPowerRunStarted(RTS_RESULT (*fn)(void *arg), void *arg)
{
    if (power.is_lost)
        return SIM_POWER_CUT;
    if (!power.on)
        return ERR_NOTINITIALIZED;
    return SimPowerRun(fn, arg);
}

bool SimPowerRunPart(void (*fn)(void))
{
    jmp_buf before;

    memcpy(&before, &power.jump, sizeof before);
    if (setjmp(power.jump) == 0)
        fn();
    memcpy(&power.jump, &before, sizeof before);
    return !power.is_lost;
}

typedef struct {
    void (*fn)(void *arg);
    void *arg;
} CALL;

static RTS_RESULT call(void *arg)
{
    const CALL *c = arg;

    c->fn(c->arg);
    return ERR_OK;
}

RTS_RESULT SimCall(void (*fn)(void *arg), void *arg)
{
    CALL c = {fn, arg};

    return SimPowerRun(call, &c);
}
