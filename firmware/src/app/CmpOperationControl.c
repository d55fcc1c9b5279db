/*
 * CmpOperationControl.c - what the running program forbids tools to do.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpOperationControl.h"

#if OPERATION_CONTROL

#include "AppAddress.h"
#include "AppLife.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "CmpStd.h"

enum { ALL = (1 << OPERATION_ALL) - 1, VERSION = 0x00010000 };

/* Where the program has its variable; `is_set`: it has one. */
static struct {
    bool is_set;
    RTS_UI32 area;
    RTS_UI32 offset;
} variable;

/* Called by the initial values of the variable. An address that is not one of a variable forbids nothing. */
static RTS_UI8 operation_control(const RTS_UI8 *address)
{
    variable.is_set = AppFindArea((uintptr_t)address, &variable.area, &variable.offset);
    return variable.is_set;
}

APP_GATE(operation_control);

static const CMP_EXT_FUNCTION functions[] = {
    {"operation_control", 0x1F2E9698, VERSION,
     (RTS_PFN)APP_GATED(operation_control)}, /* operation_control(POINTER TO BYTE):BOOL */
};

RTS_UI32 OperationForbidden(void)
{
    const RTS_UI8 *forbids = NULL;
    RTS_UI32 forbidden = 0;

    if (variable.is_set && AppGetState() == AS_RUN && !AppHasException())
        forbids = AppGetAreaAddress(variable.area, variable.offset, OPERATION_COUNT);
    if (forbids == NULL)
        return 0;
    for (RTS_UI32 i = 0; i < OPERATION_ALL; i++)
        forbidden |= (RTS_UI32)(forbids[i] != 0) << i;
    return forbids[OPERATION_ALL] != 0 ? (RTS_UI32)ALL : forbidden;
}

RTS_RESULT OperationMay(RTS_UI32 operation)
{
    return (OperationForbidden() >> operation & 1) != 0 ? ERR_OPERATION_DENIED : ERR_OK;
}

static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    variable.is_set = false;
}

RTS_RESULT CmpOperationControl_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        variable.is_set = false;
    if (hook != CH_INIT3)
        return ERR_OK;
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
