/*
 * port.c - how the Linux port says why something failed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "port.h"

#include <stdarg.h>
#include <stdio.h>

void PortReason(PORT_REASON *reason, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reason->text, sizeof(reason->text), format, arguments);
    va_end(arguments);
    reason->busy = false;
}
