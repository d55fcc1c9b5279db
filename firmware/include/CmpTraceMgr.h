/*
 * CmpTraceMgr.h - the trace manager: records variables in each cycle of a task, as an oscilloscope does (shared with the
 * host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 3.17. A packet records up to TRACE_MAX_RECORDS places (AppAddress.h) and system values at the end of every n-th
 * cycle of a task, into a ring of samples; with a trigger it keeps a part of those before. Packets share TRACE_BUFFER
 * bytes. While none records, no phase is registered and a cycle costs what it costs without this component.
 *
 * Main changes the list and reads samples while tasks write. A sample is valid if it is still in the ring after it was
 * read. On several cores a task holds the lock of the runtime while it records.
 *
 * A packet ends when the variables do (EVT_PrepareExit: reset, download), and when no tool has asked for it for
 * TRACE_IDLE_MS, unless it is kept. A persistent packet is a file (FileStore.h) whose name begins with TRACE_FILE, with
 * its TRACE_CONFIG and records: it begins again whenever the application that it is for starts.
 *
 * Without TRACE_BUFFER this component is not there, and all of it is left out. All functions: from main.
 */
#ifndef CMPTRACEMGR_H
#define CMPTRACEMGR_H

#include "AppAddress.h"
#include "CmpErrors.h"
#include "CmpPackets.h"
#include "CmpStd.h"
#ifndef RTS_CFFI
#include "CmpItf.h"
#include "rts_config.h"
#endif

enum {
    TRACE_MAX_RECORDS = 96,  /* the configuration fits a message of 2048 bytes */
    TRACE_KEPT_RECORDS = 16, /* of a persistent packet */
    TRACE_IDLE_MS = 20000,
    TRACE_TIME_SIZE = 8, /* bytes of IEC_CONTEXT.time_ns, with which each sample begins */
};

/* TRACE_CONFIG.flags */
enum {
    TRACE_KEEP = 1,    /* stays without a tool that asks for it */
    TRACE_TRIGGER = 2, /* samples are kept from the trigger on, and `before` of those before it */
    TRACE_LEVEL = 4,   /* the trigger need not have been false before */
    TRACE_SIGNED = 8,  /* what the trigger compares: INT and its like, else as an unsigned number */
    TRACE_REAL = 16,   /* REAL or LREAL */
};

/* TRACE_CONFIG.comparison: the trigger is true if its value is one of these to the constant. NAN is none of them. */
enum { TRACE_LESS = NUMBER_LESS, TRACE_EQUAL = NUMBER_EQUAL, TRACE_GREATER = NUMBER_GREATER };

/* The area of a place that is a system value of the task; its offset says which. 4 bytes each. */
enum {
    TRACE_SYSTEM = 0xFE,
    TRACE_CYCLE_NS = 0, /* how long this cycle took until its values were recorded */
    TRACE_LATE_NS = 4,  /* how long after it was due it began */
};

/* TRACE_STATE.state */
enum { TRACE_WAITING = 1, TRACE_TRIGGERED = 2, TRACE_COMPLETE = 3 };

/* The file of a persistent packet is named so, and after that as the packet. */
#define TRACE_FILE "trace."

/*
 * Begins a packet: TRACE_CONFIG and its records of 4, 2 or 1 bytes, the largest first; a value of 8 bytes is two. It gets the room for its samples if there is so much,
 * else what there is; without end half of what there is.
 *
 * ERR_PARAMETER, ERR_SIZE_MISMATCH; ERR_INVALIDID no such task; ERR_APP_INVALID_DATAID it is for another application;
 * ERR_NOMEMORY no room in the buffer for it; ERR_INVALID_REFERENCE: *place is the error
 * of the place of a record, as of AppPlaceFind, and *bad the index of the record; of the trigger as many as there are
 * records.
 */
RTS_RESULT TraceCreate(const RTS_UI8 *config, RTS_UI32 size, RTS_UI32 *id, RTS_UI32 *bad, MON_RESULT *place);

/* ERR_INVALIDID when there is none. */
RTS_RESULT TraceDelete(RTS_UI32 id);
void TraceDeleteAll(void);

/* The configuration of the packet after `id` in the order of ids, as it was created; 0: the first one. NULL after the last
 * one. Valid until the list changes. */
const RTS_UI8 *TraceGetNext(RTS_UI32 *id, RTS_UI32 *size);

/* Packs samples from `from` on, as many as fit, into `data`: see docs/protocol.md. What is not in the ring any more is left
 * out: state->first is the first one packed. *size: the room, and then how many bytes they take. ERR_INVALIDID when there is
 * no such packet. */
RTS_RESULT TraceRead(RTS_UI32 id, RTS_UI32 from, RTS_UI8 *data, RTS_UI32 *size, TRACE_STATE *state);

#ifndef RTS_CFFI
RTS_RESULT CmpTraceMgr_Hook(CMP_HOOK hook);
#endif

#endif
