/*
 * CmpMonitor2.c - the monitoring services (group 0x1B): reads and writes variables.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests carry programs of a stack machine. This is no interpreter: it recognises the two programs clients send
 * (address of a variable; copy to that address) and refuses everything else, so no request can compute, jump, call or
 * reach memory outside the areas.
 */
#include "CmpMonitor2.h"

#include <string.h>

#include "CmpAppEmbedded.h"
#include "CmpBytes.h"
#include "CmpSrv.h"

enum {
    ENTRY_HEAD = 6, /* u16 id, u32 size */
    ENTRY_FAILED = ENTRY_HEAD + 1,
};

typedef struct {
    RTS_UI32 area;
    RTS_UI32 offset;
} AREA_ADDRESS;

/* ---- programs ---- */

/* Recognises "Ld16/Ld32 offset, Rao area" and returns its length, 0 when it is something else. */
static RTS_UI32 parse_address(const RTS_UI8 *code, RTS_UI32 size, AREA_ADDRESS *address)
{
    RTS_UI32 used;

    if (size >= 5 && code[0] == MON2_OP_LD16) {
        address->offset = BytesGet16(code + 1);
        used = 3;
    } else if (size >= 7 && code[0] == MON2_OP_LD32) {
        address->offset = BytesGet32(code + 1);
        used = 5;
    } else {
        return 0;
    }
    if (code[used] != MON2_OP_RAO)
        return 0;
    address->area = code[used + 1];
    return used + 2;
}

static bool is_zero(const RTS_UI8 *data, RTS_UI32 size)
{
    while (size > 0)
        if (data[--size] != 0)
            return false;
    return true;
}

/* What may follow an address program: Halt or not, padding. */
static bool is_end(const RTS_UI8 *code, RTS_UI32 size)
{
    if (size > 0 && code[0] == MON2_OP_HALT) {
        code++;
        size--;
    }
    return is_zero(code, size);
}

static RTS_RESULT parse_read(const RTS_UI8 *code, RTS_UI32 size, AREA_ADDRESS *address)
{
    RTS_UI32 used = parse_address(code, size, address);

    return used != 0 && is_end(code + used, size - used) ? MONITORING_ERR_OK : MONITORING_ERR_UNSUPPORTED_OPERATOR;
}

/* The address alone, or the programming system's program: allocate a frame, address, and unless disabled copy to it. */
static RTS_RESULT parse_write(const RTS_UI8 *code, RTS_UI32 size, AREA_ADDRESS *address)
{
    static const RTS_UI8 head[] = {0x15, 0x0C, 0x00};
    static const RTS_UI8 tail[] = {0x17, 0x0C, 0x09, 0x04, 0x1B, 0x06, 0x00, 0x01, 0x00, 0x00,
                                   0x17, 0x04, 0x09, 0x04, 0x17, 0x08, 0x09, 0x04, MON2_OP_CPY};

    if (size < sizeof(head) || memcmp(code, head, sizeof(head)) != 0)
        return parse_read(code, size, address);
    code += sizeof(head);
    size -= sizeof(head);
    RTS_UI32 used = parse_address(code, size, address);
    if (used == 0 || size - used < sizeof(tail) || memcmp(code + used, tail, sizeof(tail)) != 0)
        return MONITORING_ERR_UNSUPPORTED_OPERATOR;
    used += sizeof(tail);
    return is_end(code + used, size - used) ? MONITORING_ERR_OK : MONITORING_ERR_UNSUPPORTED_OPERATOR;
}

/* ---- memory ---- */

static RTS_RESULT resolve(const AREA_ADDRESS *address, RTS_UI32 size, RTS_UI8 **memory)
{
    if (size == 0)
        return MONITORING_ERR_SIZE_0;
    if (address->area >= APP_AREA_COUNT || AppGetAreaSize(address->area) == 0)
        return MONITORING_ERR_INVALID_AREA;
    *memory = AppGetAreaAddress(address->area, address->offset, size);
    return *memory != NULL ? MONITORING_ERR_OK : MONITORING_ERR_INVALID_INDEX;
}

static bool is_aligned(const void *memory, RTS_UI32 size)
{
    return ((uintptr_t)memory & (size - 1)) == 0;
}

/* 64 bits that a task may change while they are read: on a 32-bit CPU in two halves, so read until they agree. */
static RTS_UI64 load64(const volatile RTS_UI64 *memory)
{
    RTS_UI64 value = *memory;
    RTS_UI64 again = *memory;

    for (int i = 0; i < 8 && value != again; i++) {
        value = again;
        again = *memory;
    }
    return again;
}

/* Copies a value out of the application's memory, in one access where the CPU can. */
static void load(RTS_UI8 *value, const RTS_UI8 *memory, RTS_UI32 size)
{
    if (size == 2 && is_aligned(memory, 2)) {
        RTS_UI16 v = *(const volatile RTS_UI16 *)(const void *)memory;
        memcpy(value, &v, sizeof(v));
    } else if (size == 4 && is_aligned(memory, 4)) {
        RTS_UI32 v = *(const volatile RTS_UI32 *)(const void *)memory;
        memcpy(value, &v, sizeof(v));
    } else if (size == 8 && is_aligned(memory, 8)) {
        RTS_UI64 v = load64((const volatile RTS_UI64 *)(const void *)memory);
        memcpy(value, &v, sizeof(v));
    } else {
        memcpy(value, memory, size);
    }
}

static void store(RTS_UI8 *memory, const RTS_UI8 *value, RTS_UI32 size)
{
    if (size == 2 && is_aligned(memory, 2)) {
        RTS_UI16 v;
        memcpy(&v, value, sizeof(v));
        *(volatile RTS_UI16 *)(void *)memory = v;
    } else if (size == 4 && is_aligned(memory, 4)) {
        RTS_UI32 v;
        memcpy(&v, value, sizeof(v));
        *(volatile RTS_UI32 *)(void *)memory = v;
    } else if (size == 8 && is_aligned(memory, 8)) {
        RTS_UI64 v;
        memcpy(&v, value, sizeof(v));
        *(volatile RTS_UI64 *)(void *)memory = v;
    } else {
        memcpy(memory, value, size);
    }
}

/* ---- requests ---- */

/* ERR_* below 0x100 never occur here, so the number says which list it is from. */
static RTS_RESULT check_application(const SRV_REQUEST *request, RTS_UI32 *error)
{
    APP_STATUS status;
    BTAG tag;
    RTS_RESULT result =
        BTagFind(&request->tags, TAG_MON2_APPLICATION, MON2_APPLICATION_SIZE, MON2_APPLICATION_SIZE, &tag);

    if (result != ERR_OK)
        return result;
    AppGetStatus(&status);
    if (status.state == AS_NONE)
        *error = ERR_APP_NOT_LOADED;
    else if (SrvGetAppSession() == 0 || BytesGet32(tag.data) != SrvGetAppSession())
        *error = ERR_APP_INVALID_SESSIONID;
    else if (BytesGet32(tag.data + 4) != status.image_crc)
        *error = ERR_APP_INVALID_DATAID;
    else
        *error = ERR_OK;
    return ERR_OK;
}

typedef struct {
    RTS_UI32 id;
    RTS_UI32 size;
    const RTS_UI8 *code;
    RTS_UI32 code_size;
} READ_VAR;

static RTS_RESULT parse_variable(const BTAG_READER *list, const BTAG *tag, READ_VAR *var)
{
    BTAG_READER fields;
    BTAG code;
    RTS_RESULT result = BTagReadContainer(list, tag, &fields);

    if (result == ERR_OK)
        result = BTagFindOptional(&fields, TAG_MON2_VAR_ID, &var->id);
    if (result == ERR_OK)
        result = BTagFindUnsigned(&fields, TAG_MON2_VAR_SIZE, &var->size);
    if (result == ERR_OK)
        result = BTagFind(&fields, TAG_MON2_VAR_CODE, 1, fields.size, &code);
    if (result != ERR_OK)
        return result;
    var->code = code.data;
    var->code_size = code.size;
    result = BTagFindOptional(&fields, TAG_MON2_VAR_CODE_SIZE, &var->code_size);
    if (result != ERR_OK)
        return result;
    return var->code_size <= code.size && var->id < MON2_ID_FAILED ? ERR_OK : ERR_PARAMETER;
}

/* Appends the entry of one variable; `reserved` bytes must stay free for the failures of those that follow. */
static void read_variable(BTAG_WRITER *reply, const READ_VAR *var, RTS_UI32 reserved)
{
    AREA_ADDRESS address;
    RTS_UI8 *memory = NULL;
    RTS_RESULT result = parse_read(var->code, var->code_size, &address);

    if (result == MONITORING_ERR_OK)
        result = resolve(&address, var->size, &memory);
    if (result == MONITORING_ERR_OK) {
        RTS_UI32 room = BTagGetRoom(reply);
        if (room < ENTRY_HEAD + reserved || var->size > room - ENTRY_HEAD - reserved)
            result = MONITORING_ERR_BUFFERSIZE_EXCEEDED;
    }
    BTagAppend16(reply, result == MONITORING_ERR_OK ? var->id : var->id | MON2_ID_FAILED);
    if (result == MONITORING_ERR_OK) {
        BTagAppend32(reply, var->size);
        RTS_UI8 *value = BTagReserve(reply, var->size);
        if (value != NULL)
            load(value, memory, var->size);
    } else {
        RTS_UI8 code = (RTS_UI8)result;
        BTagAppend32(reply, 1);
        BTagAppend(reply, &code, 1);
    }
}

static RTS_RESULT count_variables(BTAG_READER list, RTS_UI32 *count)
{
    BTAG tag;
    RTS_RESULT result;

    *count = 0;
    while ((result = BTagReadNext(&list, &tag)) == ERR_OK)
        if (tag.id == TAG_MON2_READ_VAR)
            ++*count;
    return result == ERR_END_OF_OBJECT ? ERR_OK : result;
}

static RTS_RESULT read_list(BTAG_READER *list, BTAG_WRITER *reply)
{
    BTAG tag;
    READ_VAR var;
    RTS_UI32 count;
    RTS_RESULT result = count_variables(*list, &count);

    BTagOpen(reply, TAG_MON2_VALUES, BTAG_ALIGN_0);
    for (RTS_UI32 i = 0; result == ERR_OK && i < count;) {
        result = BTagReadNext(list, &tag);
        if (result != ERR_OK || tag.id != TAG_MON2_READ_VAR)
            continue;
        var.id = i++;
        result = parse_variable(list, &tag, &var);
        if (result == ERR_OK)
            read_variable(reply, &var, (count - i) * ENTRY_FAILED);
    }
    BTagClose(reply);
    return result;
}

static RTS_RESULT mon_read(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG_READER list;
    RTS_UI32 error;
    RTS_RESULT result = check_application(request, &error);

    if (result == ERR_OK)
        result = BTagFindContainer(&request->tags, TAG_MON2_READ_LIST, &list);
    if (result != ERR_OK)
        return result;
    if (error == ERR_OK)
        return read_list(&list, reply);
    BTagWrite32(reply, TAG_MON2_ERROR, error);
    return ERR_OK;
}

typedef struct {
    const RTS_UI8 *value;
    RTS_UI32 size;
    const RTS_UI8 *code;
    RTS_UI32 code_size;
} WRITE_VAR;

/* Takes one entry off the list; false when the rest is too short for what it says. */
static bool next_write(const RTS_UI8 **data, RTS_UI32 *size, WRITE_VAR *var)
{
    if (*size < ENTRY_HEAD)
        return false;
    var->size = BytesGet32(*data + 2);
    var->value = *data + ENTRY_HEAD;
    RTS_UI32 rest = *size - ENTRY_HEAD;
    if (var->size > rest || rest - var->size < 2)
        return false;
    rest -= var->size + 2;
    var->code_size = BytesGet16(var->value + var->size);
    var->code = var->value + var->size + 2;
    if (var->code_size > rest)
        return false;
    *data = var->code + var->code_size;
    *size = rest - var->code_size;
    return true;
}

static RTS_RESULT write_variable(const WRITE_VAR *var, bool commit)
{
    AREA_ADDRESS address;
    RTS_UI8 *memory = NULL;
    RTS_RESULT result = parse_write(var->code, var->code_size, &address);

    if (result == MONITORING_ERR_OK)
        result = resolve(&address, var->size, &memory);
    if (result == MONITORING_ERR_OK && address.area == APP_AREA_CODE)
        result = MONITORING_ERR_OPERATION_DENIED;
    if (result == MONITORING_ERR_OK && commit)
        store(memory, var->value, var->size);
    return result;
}

/* One pass over the list; stops at the first bad entry. */
static RTS_RESULT write_list(const BTAG *list, bool commit, RTS_UI32 *error, RTS_UI32 *index)
{
    const RTS_UI8 *data = list->data;
    RTS_UI32 size = list->size;
    WRITE_VAR var;

    *error = MONITORING_ERR_OK;
    for (*index = 0; !(size < 4 && is_zero(data, size)); ++*index) {
        if (!next_write(&data, &size, &var))
            return ERR_L7_INCOMPLETE;
        *error = write_variable(&var, commit);
        if (*error != MONITORING_ERR_OK)
            break;
    }
    return ERR_OK;
}

static RTS_RESULT mon_write(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG list;
    RTS_UI32 error;
    RTS_UI32 index = 0;
    RTS_RESULT result = check_application(request, &error);

    if (result == ERR_OK)
        result = BTagFind(&request->tags, TAG_MON2_WRITE_LIST, 1, request->tags.size, &list);
    if (result == ERR_OK && error == ERR_OK)
        result = write_list(&list, false, &error, &index);
    if (result != ERR_OK)
        return result;
    if (error == ERR_OK)
        return write_list(&list, true, &error, &index);
    BTagWrite32(reply, TAG_MON2_ERROR, error);
    BTagWrite32(reply, TAG_MON2_ERROR_INDEX, index);
    return ERR_OK;
}

static const SRV_SERVICE services[] = {
    {SRV_MON2_READ, SRV_NEEDS_LOGIN, mon_read},
    {SRV_MON2_WRITE, SRV_NEEDS_LOGIN, mon_write},
};

RTS_RESULT CmpMonitor2_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_MONITORING2, services, RTS_COUNT(services)) : ERR_OK;
}
