/*
 * CmpLogSrv.c - the log services (group 5).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpLogSrv.h"

#include "CmpBytes.h"
#include "CmpLog.h"
#include "CmpPackets.h"
#include "CmpSrv.h"

enum { COMPONENT_NAME_MAX = 31 };

static void write_entry(BTAG_WRITER *reply, const LOG_ENTRY *entry)
{
    RTS_UI64 time_ns = (RTS_UI64)entry->time_ns;
    LOG_RECORD record = {0};

    BTagOpen(reply, TAG_LOG_RECORD, BTAG_ALIGN_0);
    BTagWrite32(reply, TAG_LOG_HANDLE, entry->handle);
    BTagOpen(reply, TAG_LOG_TIME_NS, BTAG_ALIGN_0);
    BTagAppend32(reply, (RTS_UI32)time_ns);
    BTagAppend32(reply, (RTS_UI32)(time_ns >> 32));
    BTagClose(reply);
    BytesPut32(record.component, entry->component);
    BytesPut32(record.log_class, entry->log_class);
    BytesPut32(record.error, entry->error);
    BTagWrite(reply, TAG_LOG_ENTRY, BTAG_ALIGN_0, &record, sizeof(record));
    BTagWriteText(reply, TAG_LOG_TEXT, entry->text, LOG_TEXT_SIZE - 1);
    BTagWriteText(reply, TAG_LOG_COMPONENT_NAME, CMGetComponentName(entry->component), COMPONENT_NAME_MAX);
    BTagClose(reply);
}

static RTS_RESULT get_entries(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    LOG_ENTRY entry;
    RTS_UI32 handle = 0;
    RTS_UI32 count = LOG_MAX_ENTRIES;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_LOG_START_HANDLE, &handle);

    if (result == ERR_OK)
        result = BTagFindOptional(&request->tags, TAG_LOG_COUNT, &count);
    if (result != ERR_OK)
        return result;
    for (; count > 0 && LogGetEntry(handle, &entry) == ERR_OK; count--) {
        BTAG_WRITER before = *reply;
        write_entry(reply, &entry);
        if (reply->overflow) { /* the client asks again from here */
            *reply = before;
            break;
        }
        handle = entry.handle + 1;
    }
    return ERR_OK;
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

/* There is one log. */
static RTS_RESULT get_loggers(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    BTagWriteText(reply, TAG_LOG_NAME, "PlcLog", COMPONENT_NAME_MAX);
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
