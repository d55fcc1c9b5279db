/*
 * CmpIecAbi.h - what compiled IEC code sees of the runtime (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Compiled code holds no absolute address and no writable global. Each entry gets one pointer to an IEC_CONTEXT and
 * reaches everything through it. The layout is the binary interface between plctool's compiler and the runtime: change
 * it only together with CDL_HEADER_VERSION.
 */
#ifndef CMPIECABI_H
#define CMPIECABI_H

#include "CmpStd.h"
#include "CompactDownload.h"

/* One per task, so that each task has the time of its own cycle. Read-only to IEC code. */
typedef struct {
    RTS_I64 time_ns;               /* monotonic time at the start of this cycle, from start of the application */
    RTS_I32 time_ms;               /* the same in ms, wraps */
    RTS_UI32 task;                 /* number of the task, from 1; 0 in code outside of tasks. With IEC_TASK_CALLS */
    RTS_UI8 *area[APP_AREA_COUNT]; /* base address of each area; code too */
    const RTS_PFN *imports;        /* resolved external functions, in the order of their table */
} IEC_CONTEXT;

/* Compiled code is called as C code is on Linux, also on Windows. */
#if defined(_WIN32) && !defined(RTS_CFFI)
#define IEC_CODE __attribute__((sysv_abi))
#else
#define IEC_CODE
#endif

/* Entry of a task (all its programs in order), of CodeInit and GlobalExit. */
typedef void(IEC_CODE *IEC_ENTRY)(const IEC_CONTEXT *context);

/*
 * An application begins in three steps. The runtime sets all areas to zero, and CodeInit gives all variables those
 * initial values that are constant, RETAIN and PERSISTENT ones too. Then the runtime puts back the values that are kept.
 * GlobalInit runs what the program itself does to begin: initial values that are calculated, FB_Init. `init_retains` is
 * 0 when the RETAIN variables are kept, else 1.
 */
typedef void(IEC_CODE *IEC_GLOBAL_INIT)(const IEC_CONTEXT *context, RTS_UI32 init_retains);

/*
 * The external function "ieckept" (interface text below), which GlobalInit may call: whether a value among the `size`
 * bytes at `address` was put back, so that it does not take its initial one.
 */
typedef RTS_UI8 (*IEC_KEPT)(const RTS_UI8 *address, RTS_UI32 size);

/*
 * The external function every image may import as "iecraise" (interface text below): a failed run-time check. `code` is
 * RTSEXCPT_DIVIDEBYZERO, RTSEXCPT_ARRAYBOUNDS or RTSEXCPT_ACCESS_VIOLATION. Does not return. The address it was called
 * from names the source line.
 */
typedef void (*IEC_RAISE)(RTS_UI32 code);

#endif
