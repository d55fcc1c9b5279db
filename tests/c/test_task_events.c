/*
 * test_task_events.c - external events that interrupt the creation of tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * TaskTrigger.c alone. The processor stops after each instruction of TriggerCreate (x86-64: the trap flag), and the
 * handler posts the event, as an interrupt may at any of them. Elsewhere it comes before and after the call only. The
 * memset of that file is the one here, which sets a byte at a time, as on a small processor.
 */
#define _GNU_SOURCE
#include "CmpChecksum.h"
#include "SchedEvents.h"
#include "SysTimer.h"
#include "../../firmware/src/cycle/TaskTrigger.h"
#include "rts_config.h"
#include "test.h"

#include <signal.h>
#include <string.h>

enum { AREAS = 6, TASKS = 2, TRAP_FLAG = 0x100 };

static RTS_UI32 posted;
static RTS_UI32 woken;
static RTS_HANDLE door;
static CDL_TASK tasks[TASKS];
static RTS_UI8 memory[16];
static RTS_UI8 *const areas[AREAS] = {memory, memory, memory, memory, memory, memory};
static const RTS_HANDLE timers[APP_MAX_TASKS];

void *set_bytes(void *start, int value, size_t size)
{
    volatile RTS_UI8 *bytes = start;

    for (size_t i = 0; i < size; i++)
        bytes[i] = (RTS_UI8)value;
    return start;
}

void SysTimerTrigger(RTS_HANDLE timer, RTS_I64 due_ns)
{
    RTS_UNUSED(timer);
    RTS_UNUSED(due_ns);
    woken++;
}

static void post(int number)
{
    RTS_UNUSED(number);
    posted++;
    CHECK_EQUAL(SchedPostExternalEvent(door), ERR_OK);
}

/* Not inlined, so that only its instructions, and those it returns through, are stopped at. */
static RTS_NOINLINE void create(RTS_UI32 count, bool interrupted)
{
    RTS_UNUSED(interrupted);
#ifdef __x86_64__
    if (interrupted)
        __asm__ volatile("pushfq; orq %0, (%%rsp); popfq" ::"i"(TRAP_FLAG) : "memory", "cc");
#endif
    TriggerCreate(count > 0 ? tasks : NULL, count, count > 0 ? areas : NULL, timers);
#ifdef __x86_64__
    if (interrupted)
        __asm__ volatile("pushfq; andq %0, (%%rsp); popfq" ::"i"(~TRAP_FLAG) : "memory", "cc");
#endif
}

static void setup(void)
{
    TriggerReset();
    door = SchedRegisterExternalEvent("door", NULL);
    for (RTS_UI32 i = 0; i < TASKS; i++) {
        memset(&tasks[i], 0, sizeof tasks[i]);
        tasks[i].kind = KIND_EXTERNAL;
        tasks[i].event_offset = CRC32Update(0, "door", 4);
    }
}

static void an_event_may_come_while_tasks_are_created_and_deleted(void)
{
    setup();
    for (RTS_UI32 round = 0; round < 3; round++) {
        create(TASKS, true);
        create(0, true);
    }
#ifdef __x86_64__
    CHECK(posted > 6 * 10);
#endif
}

static void it_is_for_the_tasks_that_there_are(void)
{
    setup();
    post(0);
    CHECK_EQUAL(woken, 0);
    create(TASKS, false);
    TriggerForget();
    post(0);
    for (RTS_UI32 i = 0; i < TASKS; i++) {
        CHECK(TriggerTake(i));
        CHECK(!TriggerTake(i));
    }
    create(0, false);
    post(0);
    create(TASKS, false);
    CHECK(!TriggerTake(0));
}

int main(void)
{
    struct sigaction action = {.sa_handler = post};
    CHECK_EQUAL(sigaction(SIGTRAP, &action, NULL), 0);
    RUN(an_event_may_come_while_tasks_are_created_and_deleted);
    woken = 0;
    RUN(it_is_for_the_tasks_that_there_are);
    return test_result();
}
