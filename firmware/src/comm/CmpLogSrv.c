/*
 * CmpLogSrv.c - the log services (group 5).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpLogSrv.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpLogKeep.h"
#include "CmpPackets.h"
#include "CmpSrv.h"
#include "SysTime.h"
#include "SysTimeRtc.h"

enum { COMPONENT_NAME_MAX = 31 };

static void write_64(BTAG_WRITER *reply, RTS_UI32 tag, RTS_I64 value)
{
    BTagOpen(reply, tag, BTAG_ALIGN_0);
    BTagAppend32(reply, (RTS_UI32)value);
    BTagAppend32(reply, (RTS_UI32)((RTS_UI64)value >> 32));
    BTagClose(reply);
}

static void write_entry(BTAG_WRITER *reply, const LOG_ENTRY *entry, const LOG_KEPT_FROM *from)
{
    LOG_RECORD record = {0};

    BTagOpen(reply, TAG_LOG_RECORD, BTAG_ALIGN_0);
    BTagWrite32(reply, TAG_LOG_HANDLE, entry->handle);
    write_64(reply, TAG_LOG_TIME_NS, entry->time_ns);
    BytesPut32(record.component, entry->component);
    BytesPut32(record.log_class, entry->log_class);
    BytesPut32(record.error, entry->error);
    BTagWrite(reply, TAG_LOG_ENTRY, BTAG_ALIGN_0, &record, sizeof(record));
    BTagWriteText(reply, TAG_LOG_TEXT, entry->text, LOG_TEXT_SIZE - 1);
    BTagWriteText(reply, TAG_LOG_COMPONENT_NAME, CMGetComponentName(entry->component), COMPONENT_NAME_MAX);
    if (LOG_KEEP > 0 && from->start != 0) {
        BTagWrite32(reply, TAG_LOG_START, from->start);
        write_64(reply, TAG_LOG_UTC_NS, from->utc_ns);
    }
    BTagClose(reply);
}

#if LOG_KEEP > 0
/* Whether the request names the log that is kept. */
static bool wants_kept(const SRV_REQUEST *request)
{
    BTAG name;

    return BTagFind(&request->tags, TAG_LOG_NAME, 0, request->tags.size, &name) == ERR_OK &&
           name.size >= sizeof LOG_KEPT_NAME - 1 && memcmp(name.data, LOG_KEPT_NAME, sizeof LOG_KEPT_NAME - 1) == 0;
}

/* UTC of the moment at which the time of entries was 0, for a request that has this element. */
static void write_clock(const SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 wanted = 0;
    RTS_I64 utc_ns;

    if (BTagFindUnsigned(&request->tags, TAG_LOG_CLOCK, &wanted) == ERR_OK && SysTimeRtcGet(&utc_ns) == ERR_OK)
        write_64(reply, TAG_LOG_CLOCK, utc_ns - SysTimeGetNs());
}

/* The elements before the entries: the name of the kept log, whose clients look for it, or the clock. */
static void write_head(BTAG_WRITER *reply, const SRV_REQUEST *request, bool kept)
{
    if (kept)
        BTagWriteText(reply, TAG_LOG_NAME, LOG_KEPT_NAME, COMPONENT_NAME_MAX);
    else
        write_clock(request, reply);
}

static RTS_RESULT next_entry(bool kept, RTS_UI32 handle, LOG_ENTRY *entry, LOG_KEPT_FROM *from)
{
    from->start = 0;
    return kept ? LogKeepGet(handle, entry, from) : LogGetEntry(handle, entry);
}
#else
#define wants_kept(request) false
#define write_head(reply, request, kept) ((void)(kept))
#define next_entry(kept, handle, entry, from) LogGetEntry(handle, entry)
#endif

static RTS_RESULT get_entries(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    bool kept = wants_kept(request);
    LOG_KEPT_FROM from;
    LOG_ENTRY entry;
    RTS_UI32 handle = 0;
    RTS_UI32 count = LOG_MAX_ENTRIES > LOG_KEEP ? LOG_MAX_ENTRIES : LOG_KEEP;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_LOG_START_HANDLE, &handle);

    if (result == ERR_OK)
        result = BTagFindOptional(&request->tags, TAG_LOG_COUNT, &count);
    if (result != ERR_OK)
        return result;
    write_head(reply, request, kept);
    for (; count > 0 && (result = next_entry(kept, handle, &entry, &from)) == ERR_OK; count--) {
        BTAG_WRITER before = *reply;
        write_entry(reply, &entry, &from);
        if (reply->overflow) { /* the client asks again from here */
            *reply = before;
            break;
        }
        handle = entry.handle + 1;
    }
    return LOG_KEEP == 0 || result == ERR_END_OF_OBJECT ? (RTS_RESULT)ERR_OK : result;
}

#if SRV_OTHER_CLIENTS
static RTS_RESULT get_component(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 component = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_LOG_COMPONENT_NAME, &component);

    if (result == ERR_OK)
        BTagWriteText(reply, TAG_LOG_COMPONENT_NAME, CMGetComponentName(component), COMPONENT_NAME_MAX);
    return result;
}

static RTS_RESULT get_loggers(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    BTagWriteText(reply, TAG_LOG_NAME, "PlcLog", COMPONENT_NAME_MAX);
    if (LOG_KEEP > 0)
        BTagWriteText(reply, TAG_LOG_NAME, LOG_KEPT_NAME, COMPONENT_NAME_MAX);
    return ERR_OK;
}
#endif

static const SRV_SERVICE services[] = {
    {SRV_LOG_GET_ENTRIES, RIGHT_STATE, get_entries},
#if SRV_OTHER_CLIENTS
    {SRV_LOG_GET_COMPONENT, RIGHT_STATE, get_component},
    {SRV_LOG_GET_LOGGERS, RIGHT_STATE, get_loggers},
#endif
};

RTS_RESULT CmpLogSrv_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_LOG, services, RTS_COUNT(services)) : ERR_OK;
}
