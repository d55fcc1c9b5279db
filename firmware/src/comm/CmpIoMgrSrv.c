/*
 * CmpIoMgrSrv.c - the services of inputs and outputs (group 0x0B).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpIoMgrSrv.h"

#include "CmpBytes.h"
#include "CmpIoKeep.h"
#include "CmpIoMgrEmbedded.h"
#include "CmpPackets.h"
#include "CmpSrv.h"

/* ---- list ---- */

static void write_connector(BTAG_WRITER *reply, const IoConfigConnector *connector)
{
    RTS_UI32 index = IoMgrConfigGetIndex(connector);
    IO_DEVICE_STATE now;
    IO_STATE state;

    (void)IoMgrGetState(index, &now);
    BytesPut16(state.index, index);
    BytesPut16(state.parent, connector->parent);
    BytesPut16(state.type, connector->type);
    BytesPut16(state.flags, now.flags);
    BytesPut32(state.errors, now.errors);
    BytesPut32(state.age_ms, now.age_ms);
    BytesPut32(state.skipped, IoMgrGetSkipped(index));
    BTagOpen(reply, TAG_IO_ENTRY, BTAG_ALIGN_0);
    BTagWrite(reply, TAG_IO_STATE, BTAG_ALIGN_0, &state, sizeof(state));
    BTagWriteText(reply, TAG_IO_NAME, IoMgrConfigGetName(connector), IO_CONFIG_MAX_NAME);
    BTagWriteText(reply, TAG_IO_DRIVER, IoMgrConfigGetDriverName(connector), IO_CONFIG_MAX_NAME);
    BTagClose(reply);
}

static RTS_RESULT list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    const IoConfigConnector *connector;
    RTS_UI32 index = 0;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_IO_START, &index);

    for (; result == ERR_OK && (connector = IoMgrConfigGetConnector(index)) != NULL; index++) {
        BTAG_WRITER before = *reply;
        write_connector(reply, connector);
        if (reply->overflow) { /* the client asks again from here */
            *reply = before;
            break;
        }
    }
    return result;
}

/* ---- parameters ---- */

typedef struct {
    RTS_UI32 connector;
    RTS_UI32 id;
    RTS_UI32 bits;
    RTS_UI32 bit_offset;
    RTS_UI32 size; /* bytes that the bits take */
} PARAMETER;

static RTS_RESULT find_parameter(const SRV_REQUEST *request, PARAMETER *parameter)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_IO_PARAMETER, sizeof(IO_PARAMETER), request->tags.size, &tag);

    if (result == ERR_OK) {
        const IO_PARAMETER *content = (const IO_PARAMETER *)tag.data;
        parameter->connector = BytesGet16(content->connector);
        parameter->id = BytesGet32(content->id);
        parameter->bits = BytesGet32(content->bits);
        parameter->bit_offset = BytesGet32(content->bit_offset);
        parameter->size = parameter->bits / 8 + (parameter->bits % 8 != 0);
        result = parameter->bits == 0 ? ERR_PARAMETER : ERR_OK;
    }
    return result;
}

static RTS_RESULT read_parameter(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG_WRITER before = *reply;
    RTS_UI8 *data;
    PARAMETER p;
    RTS_RESULT result = find_parameter(request, &p);

    if (result != ERR_OK)
        return result;
    BTagWrite16(reply, TAG_IO_RESULT, ERR_OK);
    BTagOpen(reply, TAG_IO_DATA, BTAG_ALIGN_0);
    data = BTagReserve(reply, p.size);
    if (data == NULL)
        return ERR_BUFFERSIZE;
    result = IoMgrReadParameter(p.connector, p.id, data, p.bits, p.bit_offset);
    if (result == ERR_OK) {
        BTagClose(reply);
    } else {
        *reply = before;
        BTagWrite16(reply, TAG_IO_RESULT, result);
    }
    return ERR_OK;
}

static RTS_RESULT write_parameter(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG data;
    PARAMETER p;
    RTS_RESULT result = find_parameter(request, &p);

    if (result == ERR_OK)
        result = BTagFind(&request->tags, TAG_IO_DATA, p.size, request->tags.size, &data);
    if (result != ERR_OK)
        return result;
    RTS_RESULT written = IoMgrWriteParameter(p.connector, p.id, data.data, p.bits, p.bit_offset);
    if (written == ERR_OK)
        IoKeepNote(p.connector, p.id, data.data, p.bits, p.bit_offset);
    BTagWrite16(reply, TAG_IO_RESULT, written);
    return ERR_OK;
}

/* ---- identify, scan ---- */

static RTS_RESULT identify(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 connector = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_IO_CONNECTOR, &connector);

    if (result == ERR_OK)
        BTagWrite16(reply, TAG_IO_RESULT, IoMgrIdentify(connector));
    return result;
}

static void write_module(BTAG_WRITER *reply, const IoDrvModule *found)
{
    IO_MODULE module;

    BytesPut32(module.vendor, found->vendor);
    BytesPut32(module.product, found->product);
    BytesPut32(module.revision, found->revision);
    BytesPut32(module.slot, found->slot);
    BTagOpen(reply, TAG_IO_MODULE, BTAG_ALIGN_0);
    BTagAppend(reply, &module, sizeof(module));
    BTagAppendText(reply, found->name, IO_MODULE_NAME_SIZE - 1);
    BTagClose(reply);
}

static RTS_RESULT scan(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 connector = 0;
    RTS_UI32 index = 0;
    RTS_RESULT found = ERR_OK;
    IoDrvModule module;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_IO_CONNECTOR, &connector);

    if (result == ERR_OK)
        result = BTagFindOptional(&request->tags, TAG_IO_START, &index);
    if (result != ERR_OK)
        return result;
    while (BTagGetRoom(reply) > 2 * (sizeof(IO_MODULE) + IO_MODULE_NAME_SIZE) &&
           (found = IoMgrScanModules(connector, index, &module)) == ERR_OK) {
        write_module(reply, &module);
        index++;
    }
    BTagWrite16(reply, TAG_IO_RESULT, found);
    return ERR_OK;
}

static const SRV_SERVICE services[] = {
    {SRV_IO_SCAN, RIGHT_CONTROL, scan},
    {SRV_IO_IDENTIFY, RIGHT_CONTROL, identify},
    {SRV_IO_LIST, RIGHT_VIEW, list},
    {SRV_IO_READ_PARAMETER, RIGHT_VIEW, read_parameter},
    {SRV_IO_WRITE_PARAMETER, RIGHT_WRITE, write_parameter},
};

RTS_RESULT CmpIoMgrSrv_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_IOMGR, services, RTS_COUNT(services)) : ERR_OK;
}
