/*
 * SimStart.c - switches the simulated device on and off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "Sim.h"
#include "SimClock.h"
#include "SimLink.h"
#include "SimPower.h"
#include "SimTimers.h"
#include "SimTimes.h"
#include "SysExcept.h"
#include "rts_config.h"
#include "sim_port.h"

/* ---- why it starts ---- */

enum { START_TEXT_SIZE = 32 };
static const SYS_START power_came = {SYS_START_POWER, 0, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""};
static struct {
    SYS_START now;
    SYS_START next; /* NULL for its text: nothing was set */
    char text[START_TEXT_SIZE];
} starting;

void SimSetStart(const SYS_START *start)
{
    strncpy(starting.text, start->text, START_TEXT_SIZE - 1);
    starting.next = *start;
    starting.next.text = starting.text;
}

const SYS_START *SysStartGet(void)
{
    return &starting.now;
}

/* ---- on and off ---- */

static RTS_RESULT power_on(void *unused)
{
    RTS_RESULT result = SimFlashPowerOn();

    RTS_UNUSED(unused);
    if (result == ERR_OK)
        result = CMInit();
    SimPowerSetOn(result == ERR_OK);
    return result;
}

RTS_RESULT SimStart(void)
{
    starting.now = starting.next.text != NULL ? starting.next : power_came;
    starting.next.text = NULL;
    SimPowerReturn();
    SimClockStart();
    SimRunStart();
    SimTimersForget();
    SimComPowerOn();
    SimNetPowerOn();
    SimLinkReset();
    SimSuperviseStart();
    return SimPowerRun(power_on, NULL);
}

static RTS_RESULT shut_down(void *unused)
{
    RTS_UNUSED(unused);
    return CMExit();
}

void SimStop(void)
{
    if (SimIsOn())
        (void)SimPowerRun(shut_down, NULL);
    SimPowerSetOn(false);
    SysExceptShutdown();
}

/* ---- what IEC code can call ---- */

/* Lets virtual time pass within a cycle: what a long cycle is on a real device. */
static void simburn(RTS_UI32 us)
{
    SimClockPass(us * NS_PER_US);
}

static const CMP_EXT_FUNCTION externals[] = {
    {"simburn", 0x76DDCD81, 0x00010000, (RTS_PFN)simburn}, /* simburn(UDINT) */
};

bool SimHasExternal(const char *name)
{
    return SimIsOn() && CMFindExternal(name) != NULL;
}

RTS_RESULT SysSim_Hook(CMP_HOOK hook)
{
    RTS_RESULT result;

    if (hook != CH_INIT3)
        return ERR_OK;
    result = SimEventRegisterAll();
    if (result == ERR_OK)
        result = SimFunctionsRegister();
    return result == ERR_OK ? CMRegisterExternal(externals, RTS_COUNT(externals)) : result;
}
