/*
 * app_device.h - a simulated device for tests of the application's life: blank, or with a counter that runs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APP_DEVICE_H
#define APP_DEVICE_H

#include "CmpLog.h"
#include "app_image.h"
#include "test.h"

static inline void start_blank(void)
{
    CHECK(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF) == ERR_OK);
    CHECK(SimStart() == ERR_OK);
}

static inline void start_with_counter(RTS_UI32 step)
{
    APP_BYTES image;

    start_blank();
    build_counter(&image, step);
    CHECK(download(&image) == ERR_OK);
    CHECK(AppStartApplication() == ERR_OK);
}

static inline bool log_has(const char *text)
{
    LOG_ENTRY entry = {0};

    while (LogGetEntry(entry.handle + 1, &entry) == ERR_OK) {
        if (strstr(entry.text, text) != NULL)
            return true;
    }
    return false;
}

#endif
