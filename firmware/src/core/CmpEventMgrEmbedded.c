/*
 * CmpEventMgrEmbedded.c - events between components.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpEventMgr.h"

#include <string.h>

#include "CmpMemPool.h"
#include "rts_config.h"

typedef struct LISTENER {
    struct LISTENER *next;
    RTS_UI32 provider;
    RTS_UI32 event;
    PF_EVENT_CALLBACK callback;
    void *user;
} LISTENER;

enum { LISTENER_WORDS = (sizeof(LISTENER) + MEMPOOL_ALIGN - 1) / MEMPOOL_ALIGN };
enum { LISTENERS = EVENT_MAX_CALLBACKS > 0 ? EVENT_MAX_CALLBACKS : 1 };

static struct {
    LISTENER *first;
    MEM_POOL pool;
    RTS_I64 memory[LISTENERS * LISTENER_WORDS];
} events;

RTS_RESULT EventRegisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user)
{
    LISTENER *listener = MemPoolGetBlock(&events.pool);
    LISTENER **last;

    if (listener == NULL)
        return CMNoRoom(EVENT_MAX_CALLBACKS);
    listener->next = NULL;
    listener->provider = provider;
    listener->event = event;
    listener->callback = callback;
    listener->user = user;
    for (last = &events.first; *last != NULL; last = &(*last)->next)
        ;
    *last = listener;
    return ERR_OK;
}

RTS_RESULT EventUnregisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user)
{
    LISTENER **link;

    for (link = &events.first; *link != NULL; link = &(*link)->next) {
        LISTENER *listener = *link;
        if (listener->provider == provider && listener->event == event && listener->callback == callback &&
            listener->user == user) {
            *link = listener->next;
            return MemPoolPutBlock(&events.pool, listener);
        }
    }
    return ERR_NO_OBJECT;
}

void EventPost(RTS_UI32 provider, RTS_UI32 event, void *parameter)
{
    LISTENER *listener;
    LISTENER *next;

    for (listener = events.first; listener != NULL; listener = next) {
        next = listener->next; /* the callback may unregister itself */
        if (listener->provider == provider && listener->event == event) {
            EVENT_PARAM param = {event, provider, parameter, listener->user};
            listener->callback(&param);
        }
    }
}

RTS_RESULT CmpEventMgrEmbedded_Hook(CMP_HOOK hook)
{
    if (hook != CH_INIT_SYSTEM)
        return ERR_OK;
    events.first = NULL;
    return MemPoolCreateStatic(&events.pool, events.memory, sizeof events.memory, LISTENER_WORDS * MEMPOOL_ALIGN);
}
