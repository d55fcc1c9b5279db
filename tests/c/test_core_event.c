/*
 * test_core_event.c - events between components.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpEventMgr.h"
#include "rts_config.h"
#include "test.h"

enum { EVENT = 0x10001, OTHER_EVENT = 0x10002 };

static char order[32];
static const void *last_parameter;

static void note(const EVENT_PARAM *event)
{
    strncat(order, event->user, sizeof order - strlen(order) - 1);
    last_parameter = event->parameter;
}

static void note_once(const EVENT_PARAM *event)
{
    note(event);
    CHECK_EQUAL(EventUnregisterCallback(event->provider, event->event, note_once, event->user), ERR_OK);
}

static void begin(void)
{
    CHECK_EQUAL(CmpEventMgrEmbedded_Hook(CH_INIT_SYSTEM), ERR_OK);
    order[0] = '\0';
    last_parameter = NULL;
}

static void callbacks_run_in_the_order_of_registration(void)
{
    int parameter;

    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "b"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "c"), ERR_OK);
    EventPost(CMPID_CmpMgr, EVENT, &parameter);
    CHECK(strcmp(order, "abc") == 0);
    CHECK(last_parameter == &parameter);
}

static void provider_and_event_together_name_an_event(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpLog, EVENT, note, "b"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, OTHER_EVENT, note, "c"), ERR_OK);
    EventPost(CMPID_CmpLog, EVENT, NULL);
    CHECK(strcmp(order, "b") == 0);
    EventPost(CMPID_CmpLog, OTHER_EVENT, NULL);
    CHECK(strcmp(order, "b") == 0);
}

static void what_was_unregistered_is_not_called(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "b"), ERR_OK);
    CHECK_EQUAL(EventUnregisterCallback(CMPID_CmpMgr, EVENT, note, "c"), ERR_NO_OBJECT);
    CHECK_EQUAL(EventUnregisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_OK);
    CHECK_EQUAL(EventUnregisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_NO_OBJECT);
    EventPost(CMPID_CmpMgr, EVENT, NULL);
    CHECK(strcmp(order, "b") == 0);
}

static void a_callback_may_unregister_itself(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note_once, "a"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "b"), ERR_OK);
    EventPost(CMPID_CmpMgr, EVENT, NULL);
    EventPost(CMPID_CmpMgr, EVENT, NULL);
    CHECK(strcmp(order, "abb") == 0);
}

static void callbacks_are_limited(void)
{
    int i;

    begin();
    for (i = 0; i < EVENT_MAX_CALLBACKS; i++)
        CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "x"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "x"), ERR_NOMEMORY);
    CHECK_EQUAL(EventUnregisterCallback(CMPID_CmpMgr, EVENT, note, "x"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "x"), ERR_OK);
}

int main(void)
{
    RUN(callbacks_run_in_the_order_of_registration);
    RUN(provider_and_event_together_name_an_event);
    RUN(what_was_unregistered_is_not_called);
    RUN(a_callback_may_unregister_itself);
    RUN(callbacks_are_limited);
    return test_result();
}
