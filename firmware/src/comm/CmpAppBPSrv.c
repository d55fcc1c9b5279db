/*
 * CmpAppBPSrv.c - the services of breakpoints (group 0x12).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each request of a debugger says that it is still there.
 */
#include "CmpAppBPSrv.h"

#include "CmpAppBP.h"

#if BP_MAX > 0

#include <string.h>

#include "CmpBytes.h"
#include "CmpOperationControl.h"
#include "CmpPackets.h"
#include "CmpSrv.h"

/* What a reply has besides data. */
enum { OVERHEAD = 16 };

RTS_STATIC_ASSERT(sizeof(BP_STATUS) == sizeof(BP_STATE), the_state_is_sent_as_it_is);

static RTS_UI64 get64(const RTS_UI8 *at)
{
    return BytesGet32(at) | (RTS_UI64)BytesGet32(at + 4) << 32;
}

static RTS_RESULT reply_result(BTAG_WRITER *reply, RTS_RESULT result)
{
    BTagWrite16(reply, TAG_SERVICE_RESULT, result);
    return ERR_OK;
}

/* ---- the debugger ---- */

static RTS_RESULT attach(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 keep = 0;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_BP_KEEP, &keep);

    return result == ERR_OK ? reply_result(reply, AppBpAttach(keep != 0)) : result;
}

static RTS_RESULT detach(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    AppBpDetach();
    return reply_result(reply, ERR_OK);
}

static RTS_RESULT state(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BP_STATUS now;

    RTS_UNUSED(request);
    AppBpAlive();
    AppBpGetStatus(&now);
    BTagWrite(reply, TAG_BP_STATE, BTAG_ALIGN_0, &now, sizeof now);
    return ERR_OK;
}

/* ---- breakpoints ---- */

static void read_record(const BP_RECORD *wire, BP_BREAKPOINT *breakpoint)
{
    memset(breakpoint, 0, sizeof *breakpoint);
    breakpoint->offset = BytesGet32(wire->code_offset);
    breakpoint->skip = BytesGet32(wire->skip);
    breakpoint->condition.relation = wire->relation;
    breakpoint->condition.kind = wire->kind;
    breakpoint->condition.value = get64(wire->value);
    memcpy(&breakpoint->condition.place, &wire->place, sizeof wire->place);
}

static RTS_RESULT find_record(SRV_REQUEST *request, BP_BREAKPOINT *breakpoint)
{
    BTAG record;
    RTS_RESULT result = BTagFind(&request->tags, TAG_BP_RECORD, sizeof(BP_RECORD), sizeof(BP_RECORD), &record);

    if (result == ERR_OK)
        read_record((const BP_RECORD *)record.data, breakpoint);
    return result;
}

static RTS_RESULT set(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BP_BREAKPOINT breakpoint;
    RTS_RESULT result = find_record(request, &breakpoint);

    if (result != ERR_OK)
        return result;
    AppBpAlive();
    if (breakpoint.condition.place.pointers > PLACE_POINTERS)
        return reply_result(reply, ERR_PARAMETER);
    result = OperationMay(OPERATION_BP);
    return reply_result(reply, result == ERR_OK ? AppBpSet(&breakpoint) : result);
}

/* One, or without an offset all. */
static RTS_RESULT clear(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 offset = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_BP_OFFSET, &offset);

    if (result != ERR_OK && result != ERR_L7_TAG_MISSING)
        return result;
    AppBpAlive();
    if (result == ERR_OK)
        return reply_result(reply, AppBpClear(offset));
    AppBpClearAll();
    return reply_result(reply, ERR_OK);
}

/* From an index on, as many as fit: the offset and the hits of each. */
static RTS_RESULT list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BP_BREAKPOINT breakpoint;
    RTS_UI32 index = 0;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_BP_START, &index);

    if (result != ERR_OK)
        return result;
    AppBpAlive();
    BTagOpen(reply, TAG_BP_OFFSETS, BTAG_ALIGN_0);
    while (BTagGetRoom(reply) >= OVERHEAD && AppBpGet(index++, &breakpoint)) {
        BTagAppend32(reply, breakpoint.offset);
        BTagAppend32(reply, breakpoint.hits);
    }
    BTagClose(reply);
    return ERR_OK;
}

/* ---- steps ---- */

static RTS_RESULT find_offsets(SRV_REQUEST *request, BTAG *offsets, RTS_UI32 *more)
{
    RTS_RESULT result = BTagFind(&request->tags, TAG_BP_OFFSETS, sizeof(RTS_UI32), request->tags.size, offsets);

    if (result == ERR_OK)
        result = BTagFindOptional(&request->tags, TAG_BP_MORE, more);
    return result == ERR_OK && offsets->size % sizeof(RTS_UI32) != 0 ? (RTS_RESULT)ERR_SIZE_MISMATCH : result;
}

/* Up to the first that is refused. */
static RTS_RESULT add_traps(const BTAG *offsets, RTS_RESULT (*add)(RTS_UI32 offset))
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < offsets->size && result == ERR_OK; i += sizeof(RTS_UI32))
        result = add(BytesGet32(offsets->data + i));
    return result;
}

/* Without TAG_BP_MORE the traps of before are forgotten. */
static RTS_RESULT temporary(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG offsets;
    RTS_UI32 more = 0;
    RTS_RESULT result = find_offsets(request, &offsets, &more);

    if (result != ERR_OK)
        return result;
    AppBpAlive();
    if (!more)
        AppBpClearTemporary();
    return reply_result(reply, add_traps(&offsets, AppBpAddTemporary));
}

static RTS_RESULT add_watch(SRV_REQUEST *request)
{
    BP_BREAKPOINT breakpoint;
    RTS_RESULT result = find_record(request, &breakpoint);

    if (result != ERR_OK)
        return result == ERR_L7_TAG_MISSING ? (RTS_RESULT)ERR_OK : result;
    return breakpoint.condition.place.pointers > PLACE_POINTERS ? (RTS_RESULT)ERR_PARAMETER
                                                                : AppBpAddWatch(&breakpoint.condition.place);
}

/* A variable, if there is one, and traps, if there are some. Without TAG_BP_MORE those of before are forgotten. */
static RTS_RESULT watch(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG offsets;
    RTS_UI32 more = 0;
    RTS_RESULT result = find_offsets(request, &offsets, &more);

    if (result == ERR_L7_TAG_MISSING) {
        offsets.size = 0;
        result = BTagFindOptional(&request->tags, TAG_BP_MORE, &more);
    }
    if (result != ERR_OK)
        return result;
    AppBpAlive();
    if (!more)
        AppBpClearWatches();
    result = OperationMay(OPERATION_BP);
    if (result == ERR_OK)
        result = add_watch(request);
    return reply_result(reply, result == ERR_OK ? add_traps(&offsets, AppBpAddWatchTrap) : result);
}

/* The serial number is that of the halt: a request that is repeated does not end the next one. */
static RTS_RESULT go_on(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BP_STATUS now;
    RTS_UI32 how = 0;
    RTS_UI32 serial = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_BP_HOW, &how);

    if (result == ERR_OK)
        result = BTagFindUnsigned(&request->tags, TAG_BP_SERIAL, &serial);
    if (result != ERR_OK)
        return result;
    AppBpAlive();
    AppBpGetStatus(&now);
    return reply_result(reply, now.serial == serial ? AppBpGo(how) : (RTS_RESULT)ERR_OK);
}

static RTS_RESULT pause_tasks(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_RESULT result = OperationMay(OPERATION_BP);

    RTS_UNUSED(request);
    AppBpAlive();
    return reply_result(reply, result == ERR_OK ? AppBpPause() : result);
}

/* ---- the stack ---- */

static RTS_RESULT read_stack(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 distance = 0;
    RTS_UI32 size = 0;
    const RTS_UI8 *data;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_BP_DISTANCE, &distance);

    if (result == ERR_OK)
        result = BTagFindUnsigned(&request->tags, TAG_BP_SIZE, &size);
    if (result != ERR_OK)
        return result;
    AppBpAlive();
    data = AppBpGetStack(distance, size);
    if (data == NULL || size == 0 || size + OVERHEAD > BTagGetRoom(reply))
        return reply_result(reply, ERR_OUT_OF_LIMITS);
    BTagWrite(reply, TAG_BP_DATA, BTAG_ALIGN_0, data, size);
    return reply_result(reply, ERR_OK);
}

static RTS_RESULT write_stack(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 distance = 0;
    BTAG data;
    RTS_UI8 *at;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_BP_DISTANCE, &distance);

    if (result == ERR_OK)
        result = BTagFind(&request->tags, TAG_BP_DATA, 1, request->tags.size, &data);
    if (result != ERR_OK)
        return result;
    AppBpAlive();
    at = AppBpGetStack(distance, data.size);
    if (at == NULL)
        return reply_result(reply, ERR_OUT_OF_LIMITS);
    memcpy(at, data.data, data.size);
    return reply_result(reply, ERR_OK);
}

static const SRV_SERVICE services[] = {
    {SRV_BP_ATTACH, RIGHT_WRITE, attach},
    {SRV_BP_DETACH, RIGHT_WRITE, detach},
    {SRV_BP_STATUS, RIGHT_WRITE, state},
    {SRV_BP_SET, RIGHT_WRITE, set},
    {SRV_BP_CLEAR, RIGHT_WRITE, clear},
    {SRV_BP_LIST, RIGHT_WRITE, list},
    {SRV_BP_TEMPORARY, RIGHT_WRITE, temporary},
    {SRV_BP_GO, RIGHT_WRITE, go_on},
    {SRV_BP_PAUSE, RIGHT_WRITE, pause_tasks},
    {SRV_BP_READ_STACK, RIGHT_WRITE, read_stack},
    {SRV_BP_WRITE_STACK, RIGHT_WRITE, write_stack},
    {SRV_BP_WATCH, RIGHT_WRITE, watch},
};

RTS_RESULT CmpAppBPSrv_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_APPLICATION_BP, services, RTS_COUNT(services)) : ERR_OK;
}

#endif
