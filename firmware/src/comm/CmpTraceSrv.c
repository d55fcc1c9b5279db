/*
 * CmpTraceSrv.c - the services of the trace manager (group 0x60, own).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: docs/protocol.md.
 */
#include "CmpTraceSrv.h"

#include "CmpTraceMgr.h"

#if TRACE_BUFFER > 0

#include "CmpPackets.h"
#include "CmpSrv.h"

enum { SAMPLES_HEAD = 16 }; /* of the reply, for the heads of its elements */

static RTS_RESULT create(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    MON_RESULT place = MONITORING_ERR_OK;
    RTS_UI32 id = 0;
    RTS_UI32 bad = 0;
    BTAG config;
    RTS_RESULT result = BTagFind(&request->tags, TAG_TRACE_CONFIG, 1, request->tags.size, &config);

    if (result != ERR_OK)
        return result;
    result = TraceCreate(config.data, config.size, &id, &bad, &place);
    if (result == ERR_OK) {
        BTagWrite32(reply, TAG_TRACE_ID, id);
    } else if (result == ERR_INVALID_REFERENCE) {
        BTagWrite32(reply, TAG_TRACE_RESULT, place);
        BTagWrite32(reply, TAG_TRACE_RECORD, bad);
        result = ERR_OK;
    }
    return result;
}

static RTS_RESULT delete(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 id;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_TRACE_ID, &id);

    RTS_UNUSED(reply);
    return result == ERR_OK ? TraceDelete(id) : result;
}

/* The one after an id; an empty reply after the last one. */
static RTS_RESULT list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 id = 0;
    RTS_UI32 size = 0;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_TRACE_ID, &id);
    const RTS_UI8 *config = result == ERR_OK ? TraceGetNext(&id, &size) : NULL;

    if (config != NULL) {
        BTagWrite32(reply, TAG_TRACE_ID, id);
        BTagWrite(reply, TAG_TRACE_CONFIG, BTAG_ALIGN_0, config, size);
    }
    return result;
}

static RTS_RESULT read(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    TRACE_STATE state;
    RTS_UI32 id, size;
    RTS_UI32 from = 0;
    RTS_UI8 *data;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_TRACE_ID, &id);

    if (result == ERR_OK)
        result = BTagFindOptional(&request->tags, TAG_TRACE_FROM, &from);
    if (result != ERR_OK)
        return result;
    BTagOpen(reply, TAG_TRACE_SAMPLES, BTAG_ALIGN_0);
    size = BTagGetRoom(reply);
    size = size > sizeof state + SAMPLES_HEAD ? size - (RTS_UI32)sizeof state - SAMPLES_HEAD : 0;
    data = reply->data + reply->size;
    result = TraceRead(id, from, data, &size, &state);
    if (result != ERR_OK)
        return result;
    (void)BTagReserve(reply, size);
    BTagPad(reply);
    BTagClose(reply);
    BTagWrite(reply, TAG_TRACE_STATE, BTAG_ALIGN_0, &state, sizeof state);
    return ERR_OK;
}

static const SRV_SERVICE services[] = {
    {SRV_TRACE_CREATE, RIGHT_WRITE, create},
    {SRV_TRACE_DELETE, RIGHT_WRITE, delete},
    {SRV_TRACE_LIST, RIGHT_VIEW, list},
    {SRV_TRACE_READ, RIGHT_VIEW, read},
};

RTS_RESULT CmpTraceSrv_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_TRACE, services, RTS_COUNT(services)) : ERR_OK;
}

#endif
