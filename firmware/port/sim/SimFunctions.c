/*
 * SimFunctions.c - functions of the program that the host implements.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * IEC code runs on a stack of its own and may be left in the middle. The host's function may not: it is called on the
 * stack of the thread, and is not IEC code meanwhile: a break ends the IEC code after it, and no fault of its own does.
 */
#include "CmpItf.h"
#include "../linux/IecStack.h"
#include "Sim.h"
#include "SysExcept.h"
#include "sim_port.h"

static struct {
    SIM_FUNCTION function;
    RTS_UI8 *passed[SIM_MAX_PASSED];
} host;

typedef struct {
    RTS_UI32 number;
    RTS_UI8 *result;
    RTS_UI32 code;
} HOST_CALL;

void SimSetFunction(SIM_FUNCTION function)
{
    host.function = function;
}

static void call_host(void *arg)
{
    HOST_CALL *call = arg;

    call->code = host.function == NULL ? (RTS_UI32)RTSEXCPT_UNRESOLVED_EXTREFS
                                       : host.function(call->number, host.passed, call->result);
}

/* ---- what IEC code calls ---- */

/* The address of parameter `index` of the next simpython. */
static void simpass(RTS_UI32 index, RTS_UI64 address)
{
    if (index < SIM_MAX_PASSED)
        host.passed[index] = (RTS_UI8 *)(uintptr_t)address;
}

/* `number`: of the function; `result`: where its result goes. */
static void simpython(RTS_UI32 number, RTS_UI64 result)
{
    HOST_CALL call = {number, (RTS_UI8 *)(uintptr_t)result, RTSEXCPT_NOEXCEPTION};
    RTS_UI32 code = IecStackCallOutside(IecStackOfThread, call_host, &call);

    if (call.code != RTSEXCPT_NOEXCEPTION)
        code = call.code;
    if (code != RTSEXCPT_NOEXCEPTION)
        SysExceptRaise(code, (uintptr_t)__builtin_return_address(0) - 1, __builtin_dwarf_cfa());
}

static const CMP_EXT_FUNCTION externals[] = {
    {"simpass", 0xB25885DD, 0x00010000, (RTS_PFN)simpass},     /* simpass(UDINT,LWORD) */
    {"simpython", 0x71638572, 0x00010000, (RTS_PFN)simpython}, /* simpython(UDINT,LWORD) */
};

RTS_RESULT SimFunctionsRegister(void)
{
    return CMRegisterExternal(externals, RTS_COUNT(externals));
}
