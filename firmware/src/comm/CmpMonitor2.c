/*
 * CmpMonitor2.c - the monitoring services (group 0x1B): reads, writes and forces variables.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests carry programs of a stack machine. This is not an interpreter: it recognises the programs clients send (address
 * of a variable, perhaps by way of pointers; copy to that address) and refuses everything else, so no request can
 * compute, jump, call or reach memory outside the areas. What a pointer holds is never used as an address: it is looked
 * up in the areas, and from there on an area and an offset as any other.
 */
#include "CmpMonitor2.h"

#include <string.h>

#include "AppAddress.h"
#include "CmpAppEmbedded.h"
#include "CmpBytes.h"
#include "CmpForce.h"
#include "CmpOperationControl.h"
#include "CmpIecTask.h"
#include "CmpPackets.h"
#include "CmpSrv.h"
#include "SysAtomic.h"
#include "SysLock.h"

enum {
    ENTRY_HEAD = sizeof(MON2_VALUE),
    CONSISTENT_SIZE = 8, /* its element, with the padding before it */
    SERIAL_SIZE = FORCE_MAX > 0 ? 8 : 0,
    ALL_BITS = 0xFF,
};

/* ---- programs ---- */

/* What is left of one. */
typedef struct {
    const RTS_UI8 *code;
    RTS_UI32 size;
} PROGRAM;

static void skip(PROGRAM *program, RTS_UI32 size)
{
    program->code += size;
    program->size -= size;
}

static bool goes_on_with(const PROGRAM *program, const RTS_UI8 *bytes, RTS_UI32 size)
{
    return program->size >= size && memcmp(program->code, bytes, size) == 0;
}

/* Takes a number of `size` bytes. A number that is cut off ends the program. */
static RTS_UI32 take(PROGRAM *program, RTS_UI32 size)
{
    RTS_UI32 value = 0;

    if (program->size < size) {
        program->size = 0;
        return 0xFFFFFFFF;
    }
    skip(program, size);
    for (RTS_UI32 i = 1; i <= size; i++)
        value = value << 8 | *(program->code - i);
    return value;
}

/* Goes on from the pointer at *address; where a force is parsed, notes it. */
static MON_RESULT take_pointer(AREA_ADDRESS *address, APP_PLACE *place)
{
    if (FORCE_MAX == 0 || place == NULL)
        return AppAddressFollow(address);
    if (place->pointers == PLACE_POINTERS)
        return MONITORING_ERR_NESTING_DEPTH;
    place->offset[place->pointers++] = address->offset;
    address->offset = 0;
    return MONITORING_ERR_OK;
}

/* Takes "Ld16/Ld32 offset, Rao area" and any number of "Der pointer, Ld16/Ld32 offset, Add". With `place` no pointer is
 * followed, and *address has the area, and the offset after the last one. */
static MON_RESULT take_address(PROGRAM *program, AREA_ADDRESS *address, APP_PLACE *place)
{
    static const RTS_UI8 der[] = {MON2_OP_DER, MON2_POINTER_SIZE};
    RTS_UI32 wanted = MON2_OP_RAO;

    address->offset = 0;
    for (;;) {
        RTS_UI32 load = take(program, 1);
        RTS_UI32 offset = take(program, load == MON2_OP_LD16 ? 2 : 4);
        if ((load != MON2_OP_LD16 && load != MON2_OP_LD32) || take(program, 1) != wanted)
            return MONITORING_ERR_UNSUPPORTED_OPERATOR;
        address->offset += offset;
        if (wanted == MON2_OP_RAO)
            address->area = take(program, 1);
        if (!goes_on_with(program, der, sizeof(der)))
            return MONITORING_ERR_OK;
        skip(program, sizeof(der));
        MON_RESULT result = take_pointer(address, place);
        if (result != MONITORING_ERR_OK)
            return result;
        wanted = MON2_OP_ADD;
    }
}

static bool is_zero(const RTS_UI8 *data, RTS_UI32 size)
{
    while (size > 0)
        if (data[--size] != 0)
            return false;
    return true;
}

/* What may follow: Halt or not, padding. */
static bool is_end(PROGRAM *program)
{
    if (program->size > 0 && program->code[0] == MON2_OP_HALT)
        skip(program, 1);
    return is_zero(program->code, program->size);
}

/* Takes "Mask bits" if that comes next. */
static RTS_UI32 take_mask(PROGRAM *program)
{
    if (program->size < 2 || program->code[0] != MON2_OP_MASK)
        return ALL_BITS;
    skip(program, 2);
    return *(program->code - 1);
}

/* What the programs of programming systems have around the address to write at: allocate a frame; unless disabled copy
 * to the address. For 32-bit CPUs, and as a published client has it for those of 64 bits. */
enum { COPY_HEAD = 3, COPY_TAIL = 19, COPY_SHAPES = SRV_OTHER_CLIENTS ? 2 : 1 };

/* clang-format off */
static const RTS_UI8 copy_shapes[COPY_SHAPES][COPY_HEAD + COPY_TAIL] = {
    {0x15, 0x0C, 0x00, 0x17, 0x0C, 0x09, 0x04, 0x1B, 0x06, 0x00, 0x01, 0x00, 0x00,
     0x17, 0x04, 0x09, 0x04, 0x17, 0x08, 0x09, 0x04, MON2_OP_CPY},
#if SRV_OTHER_CLIENTS
    {0x15, 0x10, 0x00, 0x17, 0x10, 0x09, 0x04, 0x1B, 0x06, 0x00, 0x01, 0x00, 0x00,
     0x17, 0x08, 0x09, 0x08, 0x17, 0x0C, 0x09, 0x04, MON2_OP_CPY},
#endif
};
/* clang-format on */

/* Takes the head of such a program; what its tail must be, or NULL. */
static const RTS_UI8 *take_copy_head(PROGRAM *program)
{
    for (RTS_UI32 i = 0; i < COPY_SHAPES; i++) {
        if (goes_on_with(program, copy_shapes[i], COPY_HEAD)) {
            skip(program, COPY_HEAD);
            return copy_shapes[i] + COPY_HEAD;
        }
    }
    return NULL;
}

/* The address alone; to write also some bits at it, or a program that copies to it. *mask: NULL when this is not to
 * write. *place: see take_address. */
static MON_RESULT parse(PROGRAM program, AREA_ADDRESS *address, RTS_UI32 *mask, APP_PLACE *place)
{
    const RTS_UI8 *tail = mask != NULL ? take_copy_head(&program) : NULL;
    MON_RESULT result = take_address(&program, address, place);

    if (result != MONITORING_ERR_OK)
        return result;
    if (tail != NULL && !goes_on_with(&program, tail, COPY_TAIL))
        return MONITORING_ERR_UNSUPPORTED_OPERATOR;
    if (tail != NULL)
        skip(&program, COPY_TAIL);
    if (mask != NULL)
        *mask = take_mask(&program);
    return is_end(&program) ? MONITORING_ERR_OK : MONITORING_ERR_UNSUPPORTED_OPERATOR;
}

/* ---- memory ---- */

/* Copies a number of 2, 4 or 8 bytes in one access where the CPU can, because a task may use it at the same time. */
static void copy(void *to, const void *from, RTS_UI32 size)
{
    uintptr_t misfit = ((uintptr_t)to | (uintptr_t)from) & (size - 1);

    if (size == 2 && misfit == 0)
        *(volatile RTS_UI16 *)to = *(const volatile RTS_UI16 *)from;
    else if (size == 4 && misfit == 0)
        *(volatile RTS_UI32 *)to = *(const volatile RTS_UI32 *)from;
    else if (size == 8 && misfit == 0)
        *(volatile RTS_UI64 *)to = *(const volatile RTS_UI64 *)from;
    else
        memcpy(to, from, size);
}

/* Copies between the application's memory and a message, where numbers are anywhere. */
static void load(RTS_UI8 *value, const RTS_UI8 *memory, RTS_UI32 size)
{
    RTS_UI64 number;

    if (size <= sizeof(number)) {
        copy(&number, memory, size);
        memory = (const RTS_UI8 *)&number;
    }
    memcpy(value, memory, size);
}

static void store(RTS_UI8 *memory, const RTS_UI8 *value, RTS_UI32 size)
{
    RTS_UI64 number;

    if (size <= sizeof(number))
        value = memcpy(&number, value, size);
    copy(memory, value, size);
}

/* ---- requests ---- */

/* Why a request is answered with an error alone. On the wire it shares its place with MON_RESULT; no such ERR_* is below
 * 0x100, so the number says which list it is from. */
static RTS_RESULT check_application(const SRV_REQUEST *request, RTS_RESULT *error)
{
    APP_STATUS status;
    const MON2_APPLICATION *application;
    BTAG tag;
    RTS_RESULT result =
        BTagFind(&request->tags, TAG_MON2_APPLICATION, sizeof(*application), sizeof(*application), &tag);

    if (result != ERR_OK)
        return result;
    application = (const MON2_APPLICATION *)tag.data;
    AppGetStatus(&status);
    if (status.state == AS_NONE)
        *error = ERR_APP_NOT_LOADED;
    else if (!SrvIsAppSession(request->client, BytesGet32(application->session)))
        *error = ERR_APP_INVALID_SESSIONID;
    else if (BytesGet32(application->data_guid) != status.image_crc)
        *error = ERR_APP_INVALID_DATAID;
    else
        *error = ERR_OK;
    return ERR_OK;
}

typedef struct {
    RTS_UI32 id;
    RTS_UI32 size;
    PROGRAM program;
    RTS_UI32 code_size; /* of which the program may be a part */
} READ_VAR;

static RTS_RESULT parse_field(const BTAG *field, READ_VAR *var)
{
    switch (field->id) {
    case TAG_MON2_VAR_ID:
        return BTagGetUnsigned(field, &var->id);
    case TAG_MON2_VAR_SIZE:
        return BTagGetUnsigned(field, &var->size);
    case TAG_MON2_VAR_CODE_SIZE:
        return BTagGetUnsigned(field, &var->program.size);
    case TAG_MON2_VAR_CODE:
        var->program.code = field->data;
        var->code_size = field->size;
        return field->size > 0 ? ERR_OK : ERR_SIZE_MISMATCH;
    default:
        return ERR_OK;
    }
}

/* In one pass over the fields. var->id is the default. */
static RTS_RESULT parse_variable(const BTAG_READER *list, const BTAG *tag, READ_VAR *var)
{
    enum { NEEDED = 1 << TAG_MON2_VAR_SIZE | 1 << TAG_MON2_VAR_CODE };
    BTAG_READER fields;
    BTAG field;
    RTS_UI32 found = 0;
    RTS_RESULT result = BTagReadContainer(list, tag, &fields);

    while (result == ERR_OK && (result = BTagReadNext(&fields, &field)) == ERR_OK) {
        found |= field.id < 32 ? 1u << field.id : 0;
        result = parse_field(&field, var);
    }
    if (result != ERR_END_OF_OBJECT)
        return result;
    if ((found & NEEDED) != NEEDED)
        return ERR_L7_TAG_MISSING;
    if ((found & 1 << TAG_MON2_VAR_CODE_SIZE) == 0)
        var->program.size = var->code_size;
    return var->program.size <= var->code_size && var->id < MON2_ID_FAILED ? ERR_OK : ERR_PARAMETER;
}

/* Appends the entry of one variable; `reserved` bytes must stay free for what follows. */
static void read_variable(BTAG_WRITER *reply, const READ_VAR *var, RTS_UI32 reserved)
{
    AREA_ADDRESS address;
    RTS_UI8 *memory = NULL;
    MON2_VALUE head;
    RTS_UI32 room = BTagGetRoom(reply);
    RTS_UI32 id = var->id;
    RTS_UI32 size = var->size;
    MON_RESULT result = parse(var->program, &address, NULL, NULL);

    if (result == MONITORING_ERR_OK)
        result = AppAddressResolve(&address, size, &memory);
    if (result == MONITORING_ERR_OK && (room < ENTRY_HEAD + reserved || size > room - ENTRY_HEAD - reserved))
        result = MONITORING_ERR_BUFFERSIZE_EXCEEDED;
    if (result != MONITORING_ERR_OK) {
        id |= MON2_ID_FAILED;
        size = result;
    }
    BytesPut16(head.id, id);
    BytesPut32(head.size, size);
    BTagAppend(reply, &head, sizeof(head));
    if (result != MONITORING_ERR_OK)
        return;
    RTS_UI8 *value = BTagReserve(reply, size);
    if (value != NULL)
        load(value, memory, size);
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
            read_variable(reply, &var, (count - i) * ENTRY_HEAD + CONSISTENT_SIZE + SERIAL_SIZE);
    }
    BTagPad(reply);
    BTagClose(reply);
    return result;
}

static RTS_RESULT mon_read(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG_READER list;
    RTS_RESULT error;
    bool busy;
    RTS_RESULT result = check_application(request, &error);

    if (result == ERR_OK)
        result = BTagFindContainer(&request->tags, TAG_MON2_READ_LIST, &list);
    if (result != ERR_OK)
        return result;
    if (error != ERR_OK) {
        BTagWrite32(reply, TAG_MON2_ERROR, error);
        return ERR_OK;
    }
    RTS_UI32 before = IecTaskGetActivity(&busy);
    result = read_list(&list, reply);
    if (!busy && IecTaskGetActivity(&busy) == before)
        BTagWrite16(reply, TAG_MON2_CONSISTENT, 1);
    if (ForceGetCount() > 0)
        BTagWrite32(reply, TAG_MON2_FORCE_SERIAL, ForceGetSerial());
    return result;
}

typedef struct {
    const RTS_UI8 *value;
#if FORCE_MAX > 0
    RTS_UI32 action; /* MON2_FORCE, MON2_UNFORCE */
#endif
    RTS_UI32 size;
    RTS_UI32 mask; /* ALL_BITS, or those to write of the first byte alone */
    PROGRAM program;
} WRITE_VAR;

/* Takes one entry off the list; false when the rest is too short for what it says. */
static bool next_write(const RTS_UI8 **data, RTS_UI32 *size, WRITE_VAR *var)
{
    const MON2_VALUE *head = (const MON2_VALUE *)*data;

    if (*size < sizeof(*head))
        return false;
#if FORCE_MAX > 0
    var->action = BytesGet16(head->id);
#endif
    var->size = BytesGet32(head->size);
    var->value = (const RTS_UI8 *)(head + 1);
    RTS_UI32 rest = *size - (RTS_UI32)sizeof(*head);
    if (var->size > rest || rest - var->size < 2)
        return false;
    rest -= var->size + 2;
    var->program.size = BytesGet16(var->value + var->size);
    var->program.code = var->value + var->size + 2;
    if (var->program.size > rest)
        return false;
    *data = var->program.code + var->program.size;
    *size = rest - var->program.size;
    return true;
}

/* In one step for the tasks, unless that would keep them waiting. */
static void write_memory(RTS_UI8 *memory, const WRITE_VAR *var)
{
    bool locked = var->size <= MON2_ONE_STEP_SIZE;
    RTS_UI32 lock = locked ? SysLockEnter() : 0;

    if (var->mask != ALL_BITS)
        SysAtomicSetBits(memory, (RTS_UI8)var->mask, var->value[0]);
    else
        store(memory, var->value, var->size);
    if (locked)
        SysLockLeave(lock);
}

static MON_RESULT write_variable(WRITE_VAR *var, bool commit)
{
    AREA_ADDRESS address;
    RTS_UI8 *memory = NULL;
    MON_RESULT result = parse(var->program, &address, &var->mask, NULL);

    if (result == MONITORING_ERR_OK)
        result = AppAddressResolve(&address, var->size, &memory);
    if (result == MONITORING_ERR_OK && address.area == APP_AREA_CODE)
        result = MONITORING_ERR_OPERATION_DENIED;
    if (result == MONITORING_ERR_OK && commit)
        write_memory(memory, var);
    return result;
}

/* ---- forced variables ---- */

#if FORCE_MAX > 0
static RTS_UI32 to_add; /* values that a request adds to the list, as far as it has been checked */

static MON_RESULT check_force(const APP_PLACE *place)
{
    MON_RESULT result = ForceCheck(place);

    if (OperationMay(OPERATION_FORCE) != ERR_OK)
        result = MONITORING_ERR_OPERATION_DENIED;
    if (result == MONITORING_ERR_OK && !ForceHas(place) && ForceGetCount() + ++to_add > ForceGetRoom())
        result = MONITORING_ERR_FORCE_FAILED;
    return result;
}

static MON_RESULT parse_force(WRITE_VAR *var, APP_PLACE *place)
{
    AREA_ADDRESS address;

    memset(place, 0, sizeof(*place));
    MON_RESULT result = parse(var->program, &address, &var->mask, place);
    if (result != MONITORING_ERR_OK)
        return result;
    place->area = (RTS_UI8)address.area;
    place->offset[place->pointers] = address.offset;
    place->size = var->size <= sizeof(RTS_UI64) ? (RTS_UI8)var->size : 0;
    place->mask = (RTS_UI8)var->mask;
    return MONITORING_ERR_OK;
}

/* A place whose force ends may be one that cannot be reached any more. */
static MON_RESULT force_variable(WRITE_VAR *var, bool commit)
{
    APP_PLACE place;
    RTS_UI64 value = 0;
    bool ends = var->action == MON2_UNFORCE;
    MON_RESULT result = parse_force(var, &place);

    if (!ends && var->action != MON2_FORCE)
        result = MONITORING_ERR_UNSUPPORTED_OPERATOR;
    if (result == MONITORING_ERR_OK && !ends && !commit)
        result = check_force(&place);
    if (result != MONITORING_ERR_OK || !commit)
        return result;
    if (ends) {
        ForceEnd(&place);
        return MONITORING_ERR_OK;
    }
    memcpy(&value, var->value, place.size);
    return ForceSet(&place, value);
}
#else
#define force_variable(var, commit) MONITORING_ERR_OK
#endif

/* ---- lists of changes ---- */

/* One pass over the list; stops at the first bad entry. */
static RTS_RESULT change_list(const BTAG *list, bool forces, bool commit, MON_RESULT *error, RTS_UI32 *index)
{
    const RTS_UI8 *data = list->data;
    RTS_UI32 size = list->size;
    WRITE_VAR var;

    *error = MONITORING_ERR_OK;
    for (*index = 0; !(size < 4 && is_zero(data, size)); ++*index) {
        if (!next_write(&data, &size, &var))
            return ERR_L7_INCOMPLETE;
        *error = forces ? force_variable(&var, commit) : write_variable(&var, commit);
        if (*error != MONITORING_ERR_OK)
            break;
    }
    return ERR_OK;
}

static void write_error(BTAG_WRITER *reply, RTS_UI32 error, RTS_UI32 index)
{
    BTagWrite32(reply, TAG_MON2_ERROR, error);
    BTagWrite32(reply, TAG_MON2_ERROR_INDEX, index);
}

/* Changes nothing if the check of one entry fails. */
static RTS_RESULT change_all(SRV_REQUEST *request, BTAG_WRITER *reply, bool forces)
{
    BTAG list;
    RTS_RESULT refused;
    MON_RESULT error = MONITORING_ERR_OK;
    RTS_UI32 index = 0;
    RTS_RESULT result = check_application(request, &refused);

    if (result == ERR_OK)
        result = BTagFind(&request->tags, TAG_MON2_WRITE_LIST, 1, request->tags.size, &list);
    if (result == ERR_OK && refused != ERR_OK) {
        write_error(reply, refused, index);
        return ERR_OK;
    }
    for (int commit = 0; result == ERR_OK && error == MONITORING_ERR_OK && commit <= 1; commit++)
        result = change_list(&list, forces, commit != 0, &error, &index);
    if (result == ERR_OK && error != MONITORING_ERR_OK)
        write_error(reply, error, index);
    return result;
}

static RTS_RESULT mon_write(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    if (OperationMay(OPERATION_WRITE) != ERR_OK) {
        write_error(reply, MONITORING_ERR_OPERATION_DENIED, 0);
        return ERR_OK;
    }
    return change_all(request, reply, false);
}

#if FORCE_MAX > 0
static RTS_RESULT mon_force(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    to_add = 0;
    return change_all(request, reply, true);
}

static void append_forced(BTAG_WRITER *reply, const FORCED_VALUE *forced)
{
    MON2_FORCED entry;

    entry.area = forced->place.area;
    entry.pointers = forced->place.pointers;
    entry.size = forced->place.size;
    entry.mask = forced->place.mask;
    for (RTS_UI32 i = 0; i <= PLACE_POINTERS; i++)
        BytesPut32(entry.offset + 4 * i, forced->place.offset[i]);
    BytesPut32(entry.value, (RTS_UI32)forced->value);
    BytesPut32(entry.value + 4, (RTS_UI32)(forced->value >> 32));
    BTagAppend(reply, &entry, sizeof(entry));
}

/* From an index on, as many as fit. */
static RTS_RESULT mon_force_list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    const FORCED_VALUE *forced;
    RTS_UI32 index = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_MON2_FORCE_START, &index);

    if (result != ERR_OK && result != ERR_L7_TAG_MISSING)
        return result;
    BTagWrite32(reply, TAG_MON2_FORCE_SERIAL, ForceGetSerial());
    BTagWrite32(reply, TAG_MON2_FORCE_MAX, ForceGetRoom());
    BTagOpen(reply, TAG_MON2_FORCED, BTAG_ALIGN_0);
    while ((forced = ForceGet(index++)) != NULL && BTagGetRoom(reply) >= sizeof(MON2_FORCED))
        append_forced(reply, forced);
    BTagClose(reply);
    return ERR_OK;
}
#endif

static const SRV_SERVICE services[] = {
    {SRV_MON2_READ, RIGHT_VIEW, mon_read},
    {SRV_MON2_WRITE, RIGHT_WRITE, mon_write},
#if FORCE_MAX > 0
    {SRV_MON2_FORCE, RIGHT_WRITE, mon_force},
    {SRV_MON2_FORCE_LIST, RIGHT_VIEW, mon_force_list},
#endif
};

RTS_RESULT CmpMonitor2_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_MONITORING2, services, RTS_COUNT(services)) : ERR_OK;
}
