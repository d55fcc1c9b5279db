/*
 * AcmeLock.c - a component of a vendor that denies the events whose bits are in the file that ACME_LOCK names.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AcmeLock.h"

#include "AppEventIds.h"
#include "CmpEventMgr.h"

#include <stdio.h>
#include <stdlib.h>

static RTS_UI32 denied_events(void)
{
    const char *path = getenv("ACME_LOCK");
    FILE *file = path != NULL ? fopen(path, "r") : NULL;
    unsigned bits = 0;

    if (file == NULL)
        return 0;
    if (fscanf(file, "%u", &bits) != 1)
        bits = 0;
    (void)fclose(file);
    return bits;
}

static void answer(EVENT_PARAM *event)
{
    RTS_UI32 number = event->event & 0xFFFF; /* without its class */

    if (number < 32 && (denied_events() >> number & 1) != 0) {
        event->answer = ERR_OPERATION_DENIED;
        event->reason = "the machine is locked";
    }
}

RTS_RESULT AcmeLock_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? EventRegisterCallback(CMPID_CmpAppEmbedded, EVENT_ALL, answer, NULL) : (RTS_RESULT)ERR_OK;
}
