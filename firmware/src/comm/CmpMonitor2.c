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

/* Takes "Ld16/Ld32 offset, Rao area" and any number of "Der pointer, Ld16/Ld32 offset, Add", and follows the pointers. */
static MON_RESULT take_address(PROGRAM *program, AREA_ADDRESS *address)
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
        MON_RESULT result = AppAddressFollow(address);
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
 * write. */
static MON_RESULT parse(PROGRAM program, AREA_ADDRESS *address, RTS_UI32 *mask)
{
    const RTS_UI8 *tail = mask != NULL ? take_copy_head(&program) : NULL;
    MON_RESULT result = take_address(&program, address);

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
    MON_RESULT result = parse(var->program, &address, NULL);

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
    MON_RESULT result = parse(var->program, &address, &var->mask);

    if (result == MONITORING_ERR_OK)
        result = AppAddressResolve(&address, var->size, &memory);
    if (result == MONITORING_ERR_OK && address.area == APP_AREA_CODE)
        result = MONITORING_ERR_OPERATION_DENIED;
    if (result == MONITORING_ERR_OK && commit)
        write_memory(memory, var);
    return result;
}

/* One pass over the list; stops at the first bad entry. */
static RTS_RESULT write_list(const BTAG *list, bool commit, RTS_RESULT *error, RTS_UI32 *index)
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

static void write_error(BTAG_WRITER *reply, RTS_UI32 error, RTS_UI32 index)
{
    BTagWrite32(reply, TAG_MON2_ERROR, error);
    BTagWrite32(reply, TAG_MON2_ERROR_INDEX, index);
}

/* Finds the list of a request for the application that runs; its size is a multiple of `unit`. *refused: the request is
 * for another application. */
static RTS_RESULT find_list(const SRV_REQUEST *request, RTS_UI32 id, RTS_UI32 unit, BTAG *list, RTS_RESULT *refused)
{
    RTS_RESULT result = check_application(request, refused);

    if (result == ERR_OK)
        result = BTagFind(&request->tags, id, unit, request->tags.size, list);
    return result == ERR_OK && list->size % unit != 0 ? (RTS_RESULT)ERR_SIZE_MISMATCH : result;
}

/* Writes nothing if the check of one entry fails. */
static RTS_RESULT mon_write(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG list;
    RTS_RESULT refused = MONITORING_ERR_OPERATION_DENIED;
    RTS_UI32 index = 0;
    RTS_RESULT result = ERR_OK;

    if (OperationMay(OPERATION_WRITE) == ERR_OK)
        result = find_list(request, TAG_MON2_WRITE_LIST, 1, &list, &refused);
    for (int commit = 0; result == ERR_OK && refused == ERR_OK && commit <= 1; commit++)
        result = write_list(&list, commit != 0, &refused, &index);
    if (result == ERR_OK && refused != ERR_OK)
        write_error(reply, refused, index);
    return result;
}

/* ---- forced variables ---- */

#if FORCE_MAX > 0
RTS_STATIC_ASSERT(sizeof(FORCED_VALUE) == sizeof(MON2_FORCED), forced_values_are_listed_as_they_are);

typedef enum { CHECK_FORCE, SET_FORCE, END_FORCE } FORCE_WORK;

/* Stops at the first bad entry. A place whose force ends may be one that cannot be reached any more. */
static MON_RESULT change_entries(const BTAG *list, FORCE_WORK work, RTS_UI32 *index)
{
    MON_RESULT result = MONITORING_ERR_OK;
    RTS_UI32 added = 0;
    FORCED_VALUE forced;

    for (*index = 0; *index < list->size / sizeof(forced); ++*index) {
        memcpy(&forced, list->data + *index * sizeof(forced), sizeof(forced));
        if (work == CHECK_FORCE)
            result = ForceCheck(&forced.place, &added);
        else if (work == SET_FORCE)
            result = ForceSet(&forced);
        else
            ForceEnd(&forced.place);
        if (result != MONITORING_ERR_OK)
            break;
    }
    return result;
}

static RTS_RESULT change_forces(SRV_REQUEST *request, BTAG_WRITER *reply, FORCE_WORK first, FORCE_WORK last)
{
    BTAG list;
    RTS_RESULT refused;
    RTS_UI32 index = 0;
    RTS_RESULT result = find_list(request, TAG_MON2_FORCED, sizeof(MON2_FORCED), &list, &refused);

    if (result != ERR_OK)
        return result;
    if (refused == ERR_OK && first == CHECK_FORCE && OperationMay(OPERATION_FORCE) != ERR_OK)
        refused = MONITORING_ERR_OPERATION_DENIED;
    for (; refused == ERR_OK && first <= last; first++)
        refused = change_entries(&list, first, &index);
    if (refused != ERR_OK)
        write_error(reply, refused, index);
    return ERR_OK;
}

/* Forces nothing if the check of one entry fails. */
static RTS_RESULT mon_force(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return change_forces(request, reply, CHECK_FORCE, SET_FORCE);
}

static RTS_RESULT mon_unforce(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return change_forces(request, reply, END_FORCE, END_FORCE);
}

/* From an index on, as many as fit. */
static RTS_RESULT mon_force_list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    const FORCED_VALUE *forced;
    RTS_UI32 index = 0;
    RTS_RESULT result = BTagFindOptional(&request->tags, TAG_MON2_FORCE_START, &index);

    if (result != ERR_OK)
        return result;
    BTagWrite32(reply, TAG_MON2_FORCE_SERIAL, ForceGetSerial());
    BTagWrite32(reply, TAG_MON2_FORCE_MAX, ForceGetRoom());
    BTagOpen(reply, TAG_MON2_FORCED, BTAG_ALIGN_0);
    while ((forced = ForceGet(index++)) != NULL && BTagGetRoom(reply) >= sizeof(*forced))
        BTagAppend(reply, forced, sizeof(*forced));
    BTagClose(reply);
    return ERR_OK;
}
#endif

static const SRV_SERVICE services[] = {
    {SRV_MON2_READ, RIGHT_VIEW, mon_read},
    {SRV_MON2_WRITE, RIGHT_WRITE, mon_write},
#if FORCE_MAX > 0
    {SRV_MON2_FORCE, RIGHT_WRITE, mon_force},
    {SRV_MON2_UNFORCE, RIGHT_WRITE, mon_unforce},
    {SRV_MON2_FORCE_LIST, RIGHT_VIEW, mon_force_list},
#endif
};

RTS_RESULT CmpMonitor2_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_MONITORING2, services, RTS_COUNT(services)) : ERR_OK;
}
