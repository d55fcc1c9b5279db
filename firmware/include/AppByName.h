/*
 * AppByName.h - functions and variables of the program, by name, for components in C (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * IEC functions that can be called from C (manual 2.3.1). The program offers what has {attribute 'from_c'}
 * (docs/c-functions.md); `plctool export-itf` writes the structures and signatures. All from main, such as CH_COMM_CYCLE or the callback of an event, and not from a function that the program
 * calls. What no component calls takes no flash.
 */
#ifndef APPBYNAME_H
#define APPBYNAME_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* Something that was found. It stays valid over stops, starts, exceptions and resets, and is refused as soon as another
 * program is there, also after an online change: find it again then. Members are not for components. */
typedef struct {
    RTS_UI32 crc; /* of the image */
    RTS_UI32 entry;
    RTS_UI32 area;
    RTS_UI32 offset;
    RTS_UI32 size;
} APP_NAMED;

/* Finds a function, a method of an instance or a program by its full name, in any case: "Scale", "Main.pump.Start", "Main".
 * ERR_APP_NOT_LOADED, ERR_NO_OBJECT: the program offers no such function, ERR_APP_SIGNATURE_MISMATCH: it has other
 * parameters, ERR_PARAMETER: the image is damaged there, ERR_DEVICE. */
RTS_RESULT AppFindFunctionByName(const char *name, RTS_UI32 signature, APP_NAMED *function);

/* The same for a variable; ERR_TYPE_MISMATCH: it has another type. */
RTS_RESULT AppFindVariableByName(const char *name, RTS_UI32 signature, APP_NAMED *variable);

/*
 * Calls a function with a structure of `size` bytes, in which its outputs and its result are afterwards. It is watched as
 * code of an event is (APP_INIT_WATCHDOG_US); communication waits for it. It reads and writes inputs and outputs themselves,
 * beside tasks that run. Nothing is called, and the structure stays as it is, after ERR_INVALID_HANDLE: another program is
 * there, ERR_APP_NOT_LOADED, ERR_NOT_READY_YET: the program has no values yet, ERR_EXCEPTION: it has failed before, or in
 * this call, which is its exception then, ERR_SIZE_MISMATCH, ERR_CALL_AGAIN: code of the program runs in main already.
 */
RTS_RESULT AppCallFunction(const APP_NAMED *function, void *parameters, RTS_SIZE size);

/* Copies the value of a variable. The same errors, without ERR_EXCEPTION: values can be looked at then. Interrupts are locked
 * meanwhile; where tasks run beside main, a task may change a value of more than 8 bytes while it is copied. */
RTS_RESULT AppReadVariable(const APP_NAMED *variable, void *value, RTS_SIZE size);
RTS_RESULT AppWriteVariable(const APP_NAMED *variable, const void *value, RTS_SIZE size);

#endif
