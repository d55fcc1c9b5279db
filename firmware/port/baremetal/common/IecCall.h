/*
 * IecCall.h - how compiled code is entered by all processor families here.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IECCALL_H
#define IECCALL_H

#include "CmpIecAbi.h"

/* Calls an entry of compiled code with the import table in the register that plctool reserves for it; `argument` is
 * init_retains or 0. IecCall.c of the family. */
void IecCall(const IEC_CONTEXT *context, RTS_UI32 argument, uintptr_t entry);

#define APP_CALL_ENTRY(entry, context) IecCall((context), 0, (uintptr_t)(entry))
#define APP_CALL_GLOBAL_INIT(entry, context, init_retains) IecCall((context), (init_retains), (uintptr_t)(entry))

#endif
