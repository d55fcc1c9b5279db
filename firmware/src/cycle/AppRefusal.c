/*
 * AppRefusal.c - why an image was refused, in words.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppRefusal.h"

#include "CMUtils.h"

RTS_RESULT AppRefuse(APP_REFUSAL *refusal, RTS_RESULT result, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    CMUtlvsnprintf(refusal->text, sizeof refusal->text, format, arguments);
    va_end(arguments);
    return result;
}
