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
    bool posting;
    const char *reason; /* of the last answer */
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

RTS_RESULT EventPost(RTS_UI32 provider, RTS_UI32 event, RTS_UI16 parameter_id, void *parameter)
{
    RTS_RESULT answer = ERR_OK;
    LISTENER *listener;
    LISTENER *next;
    bool outer = events.posting;

    events.posting = true;
    events.reason = NULL;

    for (listener = events.first; listener != NULL; listener = next) {
        next = listener->next; /* the callback may unregister itself */
        if (listener->provider == provider && (listener->event == event || listener->event == EVENT_ALL)) {
            EVENT_PARAM param = {event,     provider,       parameter_id, EVENT_PARAM_VERSION,
                                 parameter, listener->user, ERR_OK,       NULL};
            listener->callback(&param);
            if (answer == ERR_OK && param.answer != ERR_OK) {
                answer = param.answer;
                events.reason = param.reason;
            }
        }
    }
    events.posting = outer;
    return answer;
}

const char *EventGetReason(void)
{
    return events.reason;
}

bool EventIsPosting(void)
{
    return events.posting;
}

RTS_RESULT CmpEventMgrEmbedded_Hook(CMP_HOOK hook)
{
    if (hook != CH_INIT_SYSTEM)
        return ERR_OK;
    events.first = NULL;
    events.posting = false;
    events.reason = NULL;
    return MemPoolCreateStatic(&events.pool, events.memory, sizeof events.memory, LISTENER_WORDS * MEMPOOL_ALIGN);
}
