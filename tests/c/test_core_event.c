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

static void note(EVENT_PARAM *event)
{
    strncat(order, event->user, sizeof order - strlen(order) - 1);
    last_parameter = event->parameter;
}

static void note_once(EVENT_PARAM *event)
{
    note(event);
    CHECK_EQUAL(EventUnregisterCallback(event->provider, event->event, note_once, event->user), ERR_OK);
}

static void deny(EVENT_PARAM *event)
{
    note(event);
    CHECK(EventIsPosting());
    CHECK_EQUAL(event->answer, ERR_OK);
    event->answer = ERR_OPERATION_DENIED;
    event->reason = event->user;
}

static void deny_without_words(EVENT_PARAM *event)
{
    event->answer = ERR_FAILED;
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
    EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, &parameter);
    CHECK(strcmp(order, "abc") == 0);
    CHECK(last_parameter == &parameter);
}

static void provider_and_event_together_name_an_event(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpLog, EVENT, note, "b"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, OTHER_EVENT, note, "c"), ERR_OK);
    EventPost(CMPID_CmpLog, EVENT, EVTPARAMID_NONE, NULL);
    CHECK(strcmp(order, "b") == 0);
    EventPost(CMPID_CmpLog, OTHER_EVENT, EVTPARAMID_NONE, NULL);
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
    EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, NULL);
    CHECK(strcmp(order, "b") == 0);
}

static void a_callback_may_unregister_itself(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note_once, "a"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "b"), ERR_OK);
    EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, NULL);
    EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, NULL);
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

static void the_first_denial_is_the_answer_and_all_callbacks_hear_of_it(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note, "a"), ERR_OK);
    CHECK_EQUAL(EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, NULL), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, deny, "b"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, deny_without_words, "c"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, deny, "d"), ERR_OK);
    CHECK_EQUAL(EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, NULL), ERR_OPERATION_DENIED);
    CHECK(strcmp(order, "aabd") == 0);
    CHECK(strcmp(EventGetReason(), "b") == 0);
    CHECK(!EventIsPosting());
}

static void a_reason_is_that_of_the_last_event(void)
{
    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, deny, "b"), ERR_OK);
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, OTHER_EVENT, deny_without_words, NULL), ERR_OK);
    CHECK_EQUAL(EventPost(CMPID_CmpMgr, EVENT, EVTPARAMID_NONE, NULL), ERR_OPERATION_DENIED);
    CHECK_EQUAL(EventPost(CMPID_CmpMgr, OTHER_EVENT, EVTPARAMID_NONE, NULL), ERR_FAILED);
    CHECK(EventGetReason() == NULL);
}

static void note_type(EVENT_PARAM *event)
{
    CHECK_EQUAL(event->parameter_id, 7);
    CHECK_EQUAL(event->version, EVENT_PARAM_VERSION);
    note(event);
}

static void a_callback_is_told_the_type_of_the_parameter(void)
{
    int parameter;

    begin();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpMgr, EVENT, note_type, "a"), ERR_OK);
    CHECK_EQUAL(EventPost(CMPID_CmpMgr, EVENT, 7, &parameter), ERR_OK);
    CHECK(last_parameter == &parameter);
}

int main(void)
{
    RUN(the_first_denial_is_the_answer_and_all_callbacks_hear_of_it);
    RUN(a_reason_is_that_of_the_last_event);
    RUN(a_callback_is_told_the_type_of_the_parameter);
    RUN(callbacks_run_in_the_order_of_registration);
    RUN(provider_and_event_together_name_an_event);
    RUN(what_was_unregistered_is_not_called);
    RUN(a_callback_may_unregister_itself);
    RUN(callbacks_are_limited);
    return test_result();
}
