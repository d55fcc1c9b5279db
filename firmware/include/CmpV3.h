/*
 * CmpV3.h - what components that were written for CODESYS Control V3 include; docs/c-functions.md.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The types and macros of static linking, and the functions of the runtime under the names, and with the parameters, that
 * such components call them by. `plctool export-itf --from` makes the headers of their own interfaces. Takes no flash
 * itself.
 */
#ifndef CMPV3_H
#define CMPV3_H

#include <string.h>

#include "CMUtils.h"
#include "CmpErrors.h"
#include "CmpEventMgr.h"
#include "CmpItf.h"
#include "CmpLog.h"
#include "CmpMemPool.h"
#include "CmpStd.h"
#include "SysExceptCatch.h"
#include "SysTime.h"
#include "rts_config.h"

#define STATIC_LINK
#define CDECL
#define CDECL_EXT
#define STDCALL
#define DLL_DECL
#define HUGEPTR
#ifndef FALSE
#define FALSE 0
#define TRUE 1
#endif

/* ---- types of the parameters of programs ---- */

typedef RTS_UI8 RTS_IEC_BOOL, RTS_IEC_BYTE, RTS_IEC_USINT;
typedef RTS_I8 RTS_IEC_SINT;
typedef RTS_UI16 RTS_IEC_WORD, RTS_IEC_UINT;
typedef RTS_I16 RTS_IEC_INT;
typedef RTS_UI32 RTS_IEC_DWORD, RTS_IEC_UDINT, RTS_IEC_DATE, RTS_IEC_TOD, RTS_IEC_DT, RTS_IEC_RESULT;
typedef RTS_UI32 RTS_IEC_TIME_OF_DAY, RTS_IEC_DATE_AND_TIME;
typedef RTS_I32 RTS_IEC_DINT, RTS_IEC_TIME;
typedef RTS_UI64 RTS_IEC_LWORD, RTS_IEC_ULINT;
typedef RTS_I64 RTS_IEC_LINT, RTS_IEC_LTIME;
typedef RTS_REAL32 RTS_IEC_REAL;
typedef RTS_REAL64 RTS_IEC_LREAL;
typedef char RTS_IEC_STRING, RTS_CSTRING;
typedef void *RTS_IEC_HANDLE;
typedef uintptr_t RTS_UINTPTR;
typedef int RTS_INT;
typedef unsigned char RTS_BOOL;
typedef RTS_UI32 CMPID;

#define RTS_SETRESULT(place, result) \
    do {                             \
        if ((place) != NULL)         \
            *(place) = (result);     \
    } while (0)

/* Copies a text, cut to `size` bytes with its NUL. */
static inline void V3CopyString(char *to, RTS_SIZE size, const char *from)
{
    RTS_SIZE length = CMUtlStrNLen(from, (RTS_UI32)size - 1);

    memcpy(to, from, length);
    to[length] = '\0';
}

/* ---- functions of the runtime ---- */

#define STD_LOGGER 0
#define LT_EMPTY 0

#define USE_LogAdd
#define EXT_LogAdd
#define GET_LogAdd ERR_OK
#define CHK_LogAdd 1
/* CAL_LogAdd(logger, component, class, error, id of the text, format, ...): the format is a literal of CMUtils.h. */
#define CAL_LogAdd(logger, component, log_class, error, id, ...) LogAdd(component, log_class, error, __VA_ARGS__)

#define USE_SysTimeGetMs
#define EXT_SysTimeGetMs
#define GET_SysTimeGetMs ERR_OK
#define CHK_SysTimeGetMs 1
#define CAL_SysTimeGetMs SysTimeGetMs

#define USE_SysTimeGetUs
#define EXT_SysTimeGetUs
#define GET_SysTimeGetUs ERR_OK
#define CHK_SysTimeGetUs 1
#define CAL_SysTimeGetUs V3SysTimeGetUs
typedef RTS_UI64 RTS_SYSTIME;
static inline RTS_RESULT V3SysTimeGetUs(RTS_SYSTIME *us)
{
    *us = (RTS_SYSTIME)(SysTimeGetNs() / 1000);
    return ERR_OK;
}

#define USE_EventPost
#define EXT_EventPost
#define GET_EventPost ERR_OK
#define CHK_EventPost 1
#define CAL_EventPost EventPost

#define USE_EventRegisterCallback
#define EXT_EventRegisterCallback
#define GET_EventRegisterCallback ERR_OK
#define CHK_EventRegisterCallback 1
#define CAL_EventRegisterCallback EventRegisterCallback

#define USE_EventUnregisterCallback
#define EXT_EventUnregisterCallback
#define GET_EventUnregisterCallback ERR_OK
#define CHK_EventUnregisterCallback 1
#define CAL_EventUnregisterCallback EventUnregisterCallback

#define USE_SysExceptRegisterJmpBuf
#define EXT_SysExceptRegisterJmpBuf
#define GET_SysExceptRegisterJmpBuf ERR_OK
#define CHK_SysExceptRegisterJmpBuf RTS_STRUCTURED_EXCEPTION_HANDLING
#define CAL_SysExceptRegisterJmpBuf SysExceptRegisterJmpBuf

#define USE_SysExceptUnregisterJmpBuf
#define EXT_SysExceptUnregisterJmpBuf
#define GET_SysExceptUnregisterJmpBuf ERR_OK
#define CHK_SysExceptUnregisterJmpBuf RTS_STRUCTURED_EXCEPTION_HANDLING
#define CAL_SysExceptUnregisterJmpBuf SysExceptUnregisterJmpBuf

#define USE_SysExceptCatch /* what rts_try does itself */
#define EXT_SysExceptCatch
#define GET_SysExceptCatch ERR_OK
#define CHK_SysExceptCatch RTS_STRUCTURED_EXCEPTION_HANDLING

#define USE_CMUtlsnprintf
#define EXT_CMUtlsnprintf
#define GET_CMUtlsnprintf ERR_OK
#define CHK_CMUtlsnprintf 1
#define CAL_CMUtlsnprintf CMUtlsnprintf

/* ---- a component ---- */

enum { CH_INIT_DONE = CH_INIT_FINISHED, CH_PRE_EXIT = 0x10000 /* never called */ };

typedef RTS_RESULT (*PFHOOKFUNCTION)(RTS_UI32 ulHook, RTS_UINTPTR ulParam1, RTS_UINTPTR ulParam2);

/* What a component and the component manager exchange in ComponentEntry(). */
typedef struct {
    CMPID CmpId;
    int (*pfExportFunctions)(void);
    int (*pfImportFunctions)(void);
    RTS_UI32 (*pfGetVersion)(void);
    PFHOOKFUNCTION pfHookFunction;
    void *pfCreateInstance, *pfDeleteInstance;                              /* of C++: not called */
    void *pfCMRegisterAPI, *pfCMGetAPI, *pfCMCallHook, *pfCMCreateInstance; /* NULL: all is linked */
} INIT_STRUCT;

/* `entry`: NULL for functions alone; `id`, `version`: as its dependency file says. */
typedef struct {
    int (*entry)(INIT_STRUCT *init);
    CMPID id;
    RTS_UI32 version; /* a byte each of a.b.c.d */
    const CMP_EXT_FUNCTION *functions;
    RTS_SIZE count;
} V3_COMPONENT;

/* Starts the component. ERR_ID_MISMATCH, ERR_VERSION_MISMATCH: its sources were compiled with another dependency file,
 * whose number, or the first two of the four numbers of whose version, are others. */
static inline RTS_RESULT V3Start(const V3_COMPONENT *component, INIT_STRUCT *init)
{
    memset(init, 0, sizeof *init);
    CMNoteVersion(component->id, component->version);
    if (component->entry == NULL)
        return ERR_OK;
    if (component->entry(init) != ERR_OK)
        return ERR_FAILED;
    if (init->CmpId != component->id) {
        LogAdd(component->id, LOG_ERROR, ERR_ID_MISMATCH, "Component has the id %x, and %x in its dependency file",
               (unsigned)init->CmpId, (unsigned)component->id);
        return ERR_ID_MISMATCH;
    }
    if (init->pfGetVersion != NULL && init->pfGetVersion() >> 16 != component->version >> 16) {
        LogAdd(component->id, LOG_ERROR, ERR_VERSION_MISMATCH,
               "Component has the version %x, and %x in its dependency file", (unsigned)init->pfGetVersion(),
               (unsigned)component->version);
        return ERR_VERSION_MISMATCH;
    }
    if (init->pfExportFunctions != NULL && init->pfExportFunctions() != ERR_OK)
        return ERR_FAILED;
    return init->pfImportFunctions != NULL && init->pfImportFunctions() != ERR_OK ? ERR_FAILED : ERR_OK;
}

/* The hook of a component. */
static inline RTS_RESULT V3Hook(const V3_COMPONENT *component, INIT_STRUCT *init, CMP_HOOK hook)
{
    RTS_RESULT result = hook == CH_INIT_SYSTEM ? V3Start(component, init) : ERR_OK;

    if (result == ERR_OK && hook == CH_INIT3 && component->count > 0)
        result = CMRegisterExternal(component->functions, component->count);
    return result == ERR_OK && init->pfHookFunction != NULL ? init->pfHookFunction((RTS_UI32)hook, 0, 0) : result;
}

#endif
