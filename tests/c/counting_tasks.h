/*
 * counting_tasks.h - an application whose tasks count, for tests of when tasks run.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef COUNTING_TASKS_H
#define COUNTING_TASKS_H

#include "app_image.h"
#include "test.h"

static APP_SPEC spec;
static APP_BYTES image;

static inline void begin(void)
{
    CHECK(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF) == ERR_OK);
    CHECK(SimStart() == ERR_OK);
    spec_init(&spec);
}

/* A task that counts at data[4 * index]. */
static inline CDL_TASK *add_counting_task(const char *name, RTS_UI8 kind, RTS_UI32 interval_us)
{
    RTS_UI32 entry = here(&spec);
    CDL_TASK *task = add_task(&spec, name, kind, interval_us, entry);

    emit_add(&spec, APP_AREA_DATA, 4 * (spec.task_count - 1), 1);
    emit_ret(&spec);
    return task;
}

static inline void load(void)
{
    build_image(&image, &spec);
    CHECK(download(&image) == ERR_OK);
    CHECK(AppStartApplication() == ERR_OK);
}

static inline RTS_UI32 count_of(RTS_UI32 task)
{
    return read_u32(APP_AREA_DATA, 4 * task);
}

#endif
