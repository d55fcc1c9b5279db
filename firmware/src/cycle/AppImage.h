/*
 * AppImage.h - the process image of each task: its own copy of the inputs and outputs it uses.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 8.9, 8.10. A task gets a copy of what it shares with others at the start of its cycle and works on that. After
 * its code, the bits that it changed (its copy against the copy as it was) go to the shared outputs. So inputs do
 * not change in a cycle, tasks that write bits of one byte do not undo each other, and a cycle that fails leaves no half of
 * its outputs after. What a task alone uses it works on directly, which costs nothing.
 *
 * The image says which part of each area a task uses (CDL_BLOB_IMAGES); without that all tasks work on the shared areas.
 */
#ifndef APPIMAGE_H
#define APPIMAGE_H

#include "CmpIecAbi.h"
#include "rts_config.h"

#if APP_IMAGE_SIZE > 0

/* Units of CDL_IMAGE_UNIT bytes of an area, or of the copies. */
#if APP_IMAGE_SIZE > 255 * 8 || APP_INPUT_SIZE > 255 * 8 || APP_OUTPUT_SIZE > 255 * 8
typedef RTS_UI16 IMAGE_INDEX;
#else
typedef RTS_UI8 IMAGE_INDEX;
#endif

/* What a task has copies of: `count` units of an area, from `first` on. count 0: it works on the shared area. */
typedef struct {
    IMAGE_INDEX first;
    IMAGE_INDEX count;
    IMAGE_INDEX copy;   /* the task's own */
    IMAGE_INDEX before; /* what they were at the start of the cycle; the same as `copy` when the task writes none */
} IMAGE_PART;

enum { IMAGE_AREAS = 2 }; /* APP_AREA_INPUT, APP_AREA_OUTPUT */
typedef struct {
    IMAGE_PART part[IMAGE_AREAS];
} TASK_IMAGE;

/* Gives a part its place after the `used` units of previous copies; returns how many are used then. */
RTS_UI32 AppImagePlace(IMAGE_PART *part, const CDL_IMAGE *image, RTS_UI32 used);

/* `used` when something is wrong: more than any device has. */
enum { IMAGE_TOO_LARGE = 0xFFFF };

/* The plan of the tasks to come, APP_MAX_TASKS entries that stay valid. From main, while no task runs. */
void AppImageAttach(const TASK_IMAGE *images);

/* Leads the inputs and outputs of a task to its copies; false when it has none. From main, while no task runs. */
bool AppImageSetContext(RTS_UI32 task, IEC_CONTEXT *context);

/* Before and after the code of a cycle, in the context of a task that has copies. What the task changed is lost when
 * *running is 0: outputs are in the safe state then. */
void AppImageCopyIn(RTS_UI32 task);
void AppImageCopyOut(RTS_UI32 task, const RTS_UI32 *running);

/* The area and offset that an address in a copy stands for. When an application is loaded. */
bool AppImageFind(uintptr_t address, RTS_UI32 *area, RTS_UI32 *offset);

/* Where a task has its copy of `size` bytes of APP_AREA_INPUT or APP_AREA_OUTPUT; NULL: it has none of all of them. */
RTS_UI8 *AppImageGetCopy(RTS_UI32 task, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 size);

#else /* tasks run one after the other, or there is nothing to share */
#define AppImageAttach(images) ((void)0)
#define AppImageSetContext(task, context) ((void)(task), false)
#define AppImageCopyIn(task) ((void)(task))
#define AppImageCopyOut(task, running) ((void)(task))
#define AppImageFind(address, area, offset) false
#define AppImageGetCopy(task, area, offset, size) ((RTS_UI8 *)NULL)
#endif

#endif
