/*
 * AppIo.h - what the application's life asks of the I/O manager, which stands above it and registers here.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPIO_H
#define APPIO_H

#include "AppRefusal.h"
#include "CmpErrors.h"
#include "CmpIecAbi.h"
#include "CompactDownload.h"
#include "IoConfig.h"
#include "rts_config.h"

/* All from main, but for `get_kept`. */
typedef struct {
    bool (*has_driver)(const char *name);
    /* Gives a checked configuration to the drivers, while no task runs; it stays valid until unload. `context`: the areas.
     * A refusal comes with its sentence. */
    RTS_RESULT(*load)
    (const IO_CONFIG *config, const CDL_TASK *tasks, RTS_UI32 task_count, const IEC_CONTEXT *context,
     APP_REFUSAL *refusal);
    /* A reset: the variables have their initial values again, while no task runs. */
    void (*reset)(void);
    /* There is no application any more; also when load failed. */
    void (*unload)(void);
    /* Sets the bits of those outputs that stay as they are in the safe state, in a mask of `size` bytes from byte `first` on:
     * those that a channel takes to a device, which gets what is safe by itself. Also from a task that failed. */
    void (*get_kept)(RTS_UI32 first, RTS_UI8 *mask, RTS_UI32 size);
#if ONLINE_CHANGE
    /* Checks that the drivers can go on with a checked configuration in place of the loaded one. A refusal comes with its
     * sentence, and nothing has changed. */
    RTS_RESULT (*check_change)(const IO_CONFIG *config, APP_REFUSAL *refusal);
    /* The drivers go on with such a configuration, while no task runs. `tasks`, `context`: as for load. */
    void (*follow)(const IO_CONFIG *config, const CDL_TASK *tasks, RTS_UI32 task_count, const IEC_CONTEXT *context);
#endif
} APP_IO;

#if IO_MAX_CONNECTORS > 0
/* From main, up to CH_INIT3. NULL: there is none. */
void AppIoRegister(const APP_IO *io);
const APP_IO *AppIoGet(void);
#else
#define AppIoRegister(io) ((void)(io))
#define AppIoGet() ((const APP_IO *)NULL)
#endif

#endif
