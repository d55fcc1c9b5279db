/*
 * IecCom.c - serial ports for programs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecCom.h"

#if APP_CALLS > 0

#include "CmpAppCalls.h"

enum { VERSION = 0x00010000 };

#if IEC_COMS > 0

#include <string.h>

#include "AppEventIds.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "SysCom.h"
#include "SysTime.h"

enum { SLOTS = 256 }; /* in a handle: its slot, and how many ports were opened before */

#define NOT_OPEN UINT32_MAX

typedef struct {
    RTS_UI32 handle; /* 0: closed */
    RTS_UI32 number; /* of the port */
    RTS_UI32 line;   /* NOT_OPEN after settings that it cannot do */
} OPEN_COM;

static struct {
    RTS_UI32 opened; /* ever */
    OPEN_COM com[IEC_COMS];
} coms;

static OPEN_COM *find_open(RTS_UI32 handle)
{
    OPEN_COM *found = &coms.com[handle % SLOTS % IEC_COMS];

    return handle != 0 && found->handle == handle ? found : NULL;
}

static OPEN_COM *find_closed(void)
{
    for (RTS_UI32 i = 0; i < IEC_COMS; i++) {
        if (coms.com[i].handle == 0)
            return &coms.com[i];
    }
    return NULL;
}

static void close_line(OPEN_COM *com)
{
    if (com->line != NOT_OPEN)
        SysComClose(com->line);
    com->line = NOT_OPEN;
}

static void close_com(OPEN_COM *com)
{
    close_line(com);
    com->handle = 0;
}

static void close_all(void)
{
    for (RTS_UI32 i = 0; i < IEC_COMS; i++) {
        if (coms.com[i].handle != 0)
            close_com(&coms.com[i]);
    }
}

static bool is_any_open(void)
{
    for (RTS_UI32 i = 0; i < IEC_COMS; i++) {
        if (coms.com[i].handle != 0)
            return true;
    }
    return false;
}

static RTS_I32 error_of(RTS_RESULT result)
{
    switch (result) {
    case ERR_OK:
        return 0;
    case ERR_DUPLICATE:
        return IEC_COM_IN_USE;
    case ERR_NOT_SUPPORTED:
        return IEC_COM_WRONG_PARAMETER;
    default:
        return IEC_COM_NO_PORT;
    }
}

static RTS_I32 open_line(OPEN_COM *com, RTS_UI32 value)
{
    const SYSCOM_SETTINGS settings = {
        .baud = value & IEC_COM_BAUD,
        .parity = (RTS_UI8)(value >> IEC_COM_PARITY_SHIFT & 3),
        .stop_bits = (value & IEC_COM_TWO_STOP_BITS) != 0 ? 2 : 1,
    };

    if (settings.baud == 0 || settings.parity > SYSCOM_PARITY_ODD)
        return IEC_COM_WRONG_PARAMETER;
    return error_of(SysComOpenProgram(com->number, &settings, &com->line));
}

static RTS_I32 open_com(APP_CALL *call)
{
    OPEN_COM *com = find_closed();

    if (com == NULL)
        return IEC_COM_IN_USE;
    com->number = call->handle;
    RTS_I32 error = open_line(com, call->value);
    if (error != 0)
        return error;
    com->handle = (++coms.opened % (UINT32_MAX / SLOTS) + 1) * SLOTS + (RTS_UI32)(com - coms.com);
    call->result = com->handle;
    return 0;
}

/* A port without a line has the handle still: the program may try other settings. */
static RTS_I32 change_settings(OPEN_COM *com, RTS_UI32 value)
{
    close_line(com);
    return open_line(com, value);
}

static RTS_I32 undo(const APP_CALL *call)
{
    OPEN_COM *com = call->operation == IEC_COM_OPEN ? find_open(call->result) : NULL;

    if (com != NULL)
        close_com(com);
    return 0;
}

static RTS_I32 move_bytes(APP_CALL *call, RTS_UI32 line)
{
    RTS_UI32 room = call->value < sizeof call->data ? call->value : sizeof call->data;

    if (call->operation == IEC_COM_READ)
        call->result = SysComRead(line, call->data, room);
    else if (call->operation == IEC_COM_WRITE)
        call->result = SysComWrite(line, call->data, call->size);
    else
        return IEC_COM_WRONG_PARAMETER;
    return 0;
}

static RTS_I32 do_with_open(APP_CALL *call)
{
    OPEN_COM *com = find_open(call->handle);

    if (com == NULL)
        return IEC_COM_WRONG_HANDLE;
    switch (call->operation) {
    case IEC_COM_CLOSE:
        close_com(com);
        return 0;
    case IEC_COM_SETTINGS:
        return change_settings(com, call->value);
    default:
        return com->line == NOT_OPEN ? IEC_COM_WRONG_HANDLE : move_bytes(call, com->line);
    }
}

static RTS_I32 carry_out(APP_CALL *call)
{
    if (call->error == APP_CALL_ABANDONED)
        return undo(call);
    return call->operation == IEC_COM_OPEN ? open_com(call) : do_with_open(call);
}

static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    close_all();
}

static void poll_coms(void)
{
    RTS_UI32 state = AppGetState();

    if (!is_any_open())
        return;
    if (state == AS_NONE || state == AS_STOP)
        close_all();
    else
        SysTimeWantPass(1);
}

static RTS_RESULT live(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(coms);
    else if (hook == CH_COMM_CYCLE)
        poll_coms();
    else if (hook == CH_INIT3)
        return EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
    return ERR_OK;
}

#else

static RTS_I32 carry_out(APP_CALL *call)
{
    RTS_UNUSED(call);
    return IEC_COM_NO_PORT;
}

static RTS_RESULT live(CMP_HOOK hook)
{
    RTS_UNUSED(hook);
    return ERR_OK;
}

#endif

/* ---- what the library calls ---- */

static RTS_I32 com_call(RTS_UI32 operation, RTS_UI32 handle, RTS_UI32 value)
{
    const APP_CALL_ARGUMENTS arguments = {operation, handle, value};

    return AppCallTake(carry_out, &arguments);
}

APP_GATE(com_call);

static const CMP_EXT_FUNCTION functions[] = {
    {"com_call", 0x1B1B1C5F, VERSION, (RTS_PFN)APP_GATED(com_call)}, /* com_call(UDINT,UDINT,UDINT):DINT */
};

RTS_RESULT IecCom_Hook(CMP_HOOK hook)
{
    RTS_RESULT result = live(hook);

    return hook == CH_INIT3 && result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
