/*
 * comm_fakes.h - what the communication needs from the rest of the runtime, faked so that tests can see and steer it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef COMM_FAKES_H
#define COMM_FAKES_H

#include "AppPassword.h"
#include "CmpAppEmbedded.h"
#include "CmpIecTask.h"
#include "CmpItf.h"
#include "CmpAppBP.h"
#include "CmpLog.h"
#include "CmpSrvNumbers.h"
#include "SysTarget.h"

enum { FAKE_LINE_SIZE = 16384, FAKE_AREA_SIZE = 1024, FAKE_IMAGE_SIZE = 16384, FAKE_LOG_SIZE = 40, FAKE_TASKS = 3 };
enum { FAKE_IMAGE_CRC = 0x1C2D3E4F };

typedef struct {
    RTS_UI32 now_ms;
    RTS_UI32 random;
    SYS_TARGET target;
    RTS_UI32 hook_errors;

    RTS_UI8 line_in[FAKE_LINE_SIZE]; /* what the serial line will deliver */
    RTS_UI32 line_in_size;
    RTS_UI32 line_in_read;
    RTS_UI8 line_out[FAKE_LINE_SIZE]; /* what has been sent */
    RTS_UI32 line_out_size;
    RTS_UI32 line_write_limit; /* bytes one call of SysComWrite takes */
    RTS_RESULT line_open_result;
    RTS_UI32 log_added;
    char log_text[120]; /* of the newest one */
    bool no_generator;  /* of random numbers */

    APP_STATUS status;
#if EXCEPT_MAX_CALLS > 0
    EXCEPT_TRACE trace;
#endif
    RTS_UI64 area[APP_AREA_COUNT][FAKE_AREA_SIZE / 8];
    RTS_UI32 area_size[APP_AREA_COUNT];
    RTS_RESULT control_result;
    RTS_UI32 forbidden;  /* by the program: bits 1 << OPERATION_* */
    const char *denial;  /* what reason becomes by start, stop and reset */
    const char *reason;  /* of a component that denied start, stop or reset */
    RTS_UI32 control_ms; /* how long start, stop and reset take */
    RTS_UI32 starts;
    RTS_UI32 stops;
    RTS_UI32 resets;
    RTS_UI32 reset_option;
    RTS_UI32 single_cycles;
    RTS_UI32 reloads;
    char node_name[NS_MAX_NODE_NAME + 1]; /* given; "": none */

    RTS_UI8 image[FAKE_IMAGE_SIZE];
    bool download_open;
    bool tried;
    RTS_UI32 download_total;
    RTS_UI32 download_crc;
    RTS_UI32 download_offset;
    RTS_UI32 download_begins;
    RTS_UI32 download_writes;
    RTS_UI32 download_ends;
    RTS_RESULT write_result;
    RTS_RESULT end_result;
    const char *end_text;

#if COMM_PASSWORD
    USER_VERIFIER password;
    RTS_RESULT password_result; /* of setting it */
#endif
#if BP_MAX > 0
    struct {
        RTS_RESULT result; /* of all that may fail */
        BP_STATUS status;
        BP_BREAKPOINT list[4];
        RTS_UI32 count;
        RTS_UI32 temporary[64];
        RTS_UI32 temporary_count;
        APP_PLACE watch;
        RTS_UI32 watches, watch_traps;
        RTS_UI32 how, gone_on, paused, attached, kept, detached, alive, cleared;
        RTS_UI8 stack[64];
    } bp;
#endif
    LOG_ENTRY log[FAKE_LOG_SIZE];
    RTS_UI32 log_count;
    RTS_RESULT kept; /* of the log that is kept, which has the same entries */
    RTS_I64 utc_ns;  /* 0: not set */
    IEC_TASK_INFO tasks[FAKE_TASKS];
    RTS_UI32 task_count;
    bool task_busy;
    RTS_UI32 task_load;
    RTS_UI32 task_activity;
    RTS_UI32 activity_per_look; /* how much there is from one look at it to the next */
    RTS_UI32 lock_depth;
    RTS_UI32 locks;
} FAKES;

extern FAKES fakes;

/* Everything as after power-on: an application is loaded and stopped, the communication is open. */
void fakes_start(void);
/* Its two halves. */
void fakes_init(void);
void fakes_run_init_hooks(void);

/* One main loop round `ms` later. */
void fakes_cycle(RTS_UI32 ms);

/* A hook of all communication components, in the order of a port's list (exit hooks in reverse). */
void fakes_hook(CMP_HOOK hook);

/* Bytes of an area. */
RTS_UI8 *fakes_area(RTS_UI32 index);

#endif
