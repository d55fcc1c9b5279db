/*
 * SysExceptCatch.c - the lists of rts_try: what is registered, and who gets an exception.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysExceptCatch.h"

#if RTS_STRUCTURED_EXCEPTION_HANDLING

RTS_RESULT SysExceptRegisterJmpBuf(RTS_TRY *own)
{
    RTS_TRY **list = SysExceptTries(&own->place);

    if (list == NULL)
        return ERR_OPERATION_DENIED;
    own->outer = *list;
    *list = own;
    return ERR_OK;
}

RTS_RESULT SysExceptUnregisterJmpBuf(RTS_TRY *own)
{
    RTS_UI32 place;
    RTS_TRY **list = SysExceptTries(&place);

    if (list == NULL || *list != own)
        return ERR_NO_OBJECT;
    *list = own->outer;
    return ERR_OK;
}

RTS_TRY *SysExceptCatch(RTS_TRY **list, RTS_UI32 place, RTS_UI32 code, uintptr_t address, uintptr_t stack)
{
    RTS_TRY *newest = *list;

    if (newest == NULL || newest->place != place)
        return NULL;
    *list = newest->outer;
    newest->code = code;
    newest->context.IP = address;
    newest->context.BP = 0;
    newest->context.SP = stack;
    return newest;
}

#endif
