/*
 * AppProperties.h - what [information] of plc.toml says, for components in C (manual 3.3.10).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The properties are in the image, after the strings of AppGetInfo. All from main. Errors: ERR_APP_NOT_LOADED,
 * ERR_NO_OBJECT without a property of that key, ERR_TYPE_MISMATCH if it has another type, ERR_PARAMETER if the image is
 * damaged there, ERR_DEVICE. A firmware without SRV_INFORMATION finds none. What no component calls takes no flash.
 */
#ifndef APPPROPERTIES_H
#define APPPROPERTIES_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* A text, cut to `size` bytes (at least 1) with its NUL. "Title" and "Company" are those of [information], unless a
 * property has this key. */
RTS_RESULT AppGetTextProperty(const char *key, char *text, RTS_SIZE size);

/* A version as it is written, such as "1.2.0.4", cut in the same way. */
RTS_RESULT AppGetVersionProperty(const char *key, char *text, RTS_SIZE size);

RTS_RESULT AppGetNumberProperty(const char *key, RTS_REAL64 *number);
RTS_RESULT AppGetBooleanProperty(const char *key, bool *value);

#endif
