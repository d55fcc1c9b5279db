/*
 * CmpAppSrv.c - the application services (group 2): login, start, stop, reset, status, tasks, download.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppSrv.h"

#include "AppAddress.h"
#include "AppReason.h"
#include "CmpAppEmbedded.h"
#include "CmpBytes.h"
#include "CmpForce.h"
#include "CmpIecTask.h"
#include "CmpTaskLoad.h"
#include "CmpOperationControl.h"
#include "CmpPackets.h"
#include "CmpSrv.h"
#include "SysExcept.h"
#include "rts_config.h"

/* ---- login ---- */

/* Creates an application session; `needs_app`: not when there is no application. */
static RTS_RESULT write_login_reply(COMM_CLIENT *client, BTAG_WRITER *reply, bool needs_app)
{
    APP_LOGIN_REPLY login = {0};
    APP_STATUS status;

    AppGetStatus(&status);
    RTS_UI32 session = needs_app && status.state == AS_NONE ? 0 : SrvCreateAppSession(client);
    BytesPut16(login.result, session == 0 ? ERR_APP_NOT_EXIST : ERR_OK);
    BytesPut32(login.session, session);
    BytesPut32(login.code_guid, status.image_crc);
    BytesPut32(login.data_guid, status.image_crc);
    BTagOpen(reply, TAG_APP_DESCRIPTOR, BTAG_ALIGN_0);
    BTagWrite(reply, TAG_APP_OPTION, BTAG_ALIGN_2, &login, sizeof(login));
    BTagClose(reply);
    return ERR_OK;
}

static RTS_RESULT login_app(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG name;
    RTS_RESULT result = BTagFind(&request->tags, TAG_APP_LOGIN_NAME, 1, APP_NAME_SIZE, &name);

    return result == ERR_OK ? write_login_reply(request->client, reply, true) : result;
}

static RTS_RESULT create_app(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG_READER descriptor;
    BTAG name;
    RTS_RESULT result = BTagFindContainer(&request->tags, TAG_APP_DESCRIPTOR, &descriptor);

    if (result == ERR_OK)
        result = BTagFind(&descriptor, TAG_APP_OPTION, 1, APP_NAME_SIZE, &name);
    return result == ERR_OK ? write_login_reply(request->client, reply, false) : result;
}

static RTS_RESULT check_app_session(const COMM_CLIENT *client, RTS_UI32 session)
{
    return SrvIsAppSession(client, session) ? ERR_OK : ERR_APP_INVALID_SESSIONID;
}

static RTS_RESULT logout_app(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 session = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_APP_LOGOUT, &session);

    if (result != ERR_OK)
        return result;
    result = check_app_session(request->client, session);
    if (result == ERR_OK)
        SrvEndAppSession(request->client);
    BTagWrite16(reply, TAG_APP_LOGOUT, result);
    return ERR_OK;
}

/* ---- start, stop, reset ---- */

/* Finds the descriptor and the application session in it; *verdict says whether that is the right one. */
static RTS_RESULT read_descriptor(const SRV_REQUEST *request, BTAG_READER *descriptor, RTS_RESULT *verdict)
{
    RTS_UI32 session = 0;
    RTS_RESULT result = BTagFindContainer(&request->tags, TAG_APP_DESCRIPTOR, descriptor);

    if (result == ERR_OK)
        result = BTagFindUnsigned(descriptor, TAG_APP_SESSION, &session);
    *verdict = check_app_session(request->client, session);
    return result;
}

/* The result of a service, and the words of a component that denied it. */
static void write_verdict(BTAG_WRITER *reply, RTS_RESULT verdict)
{
    enum { REASON_SIZE = 96 };
    const char *reason = AppTakeReason();

    BTagWrite16(reply, TAG_SERVICE_RESULT, verdict);
    if (verdict != ERR_OK && reason[0] != '\0')
        BTagWriteText(reply, TAG_APP_REASON, reason, REASON_SIZE);
}

static RTS_RESULT control(SRV_REQUEST *request, BTAG_WRITER *reply, RTS_RESULT (*action)(void))
{
    BTAG_READER descriptor;
    RTS_RESULT verdict;
    RTS_RESULT result = read_descriptor(request, &descriptor, &verdict);

    (void)AppTakeReason();
    if (result == ERR_OK)
        write_verdict(reply, verdict == ERR_OK ? action() : verdict);
    return result;
}

/* A reset to the origin is the way out of a program that always forbids all. */
static RTS_RESULT reset_if_allowed(RTS_UI32 option)
{
    RTS_RESULT result = option == RESET_OPTION_ORIGIN ? ERR_OK : OperationMay(OPERATION_RESET);

    return result == ERR_OK ? AppReset(option) : result;
}

static RTS_RESULT stop_if_allowed(void)
{
    RTS_RESULT result = OperationMay(OPERATION_STOP);

    return result == ERR_OK ? AppStopApplication() : result;
}

static RTS_RESULT start(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return control(request, reply, AppStartApplication);
}

static RTS_RESULT stop(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return control(request, reply, stop_if_allowed);
}

static RTS_RESULT reset(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    BTAG_READER descriptor;
    RTS_RESULT verdict;
    RTS_UI32 option = 0;
    RTS_RESULT result = read_descriptor(request, &descriptor, &verdict);

    if (result == ERR_OK)
        result = BTagFindUnsigned(&descriptor, TAG_APP_OPTION, &option);
    if (result != ERR_OK)
        return result;
    (void)AppTakeReason();
    if (verdict == ERR_OK)
        verdict = option <= RESET_OPTION_ORIGIN ? reset_if_allowed(option) : ERR_NOT_SUPPORTED;
    write_verdict(reply, verdict);
    return ERR_OK;
}

#if FORCE_MAX > 0
static RTS_RESULT end_forces(void)
{
    ForceEndAll();
    return ERR_OK;
}

static RTS_RESULT release_force_list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return control(request, reply, end_forces);
}
#endif

#if BOOT_ON_DEMAND
static RTS_RESULT create_boot_project(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 session = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_APP_SESSION, &session);

    if (result == ERR_OK)
        result = check_app_session(request->client, session);
    if (result == ERR_OK)
        write_verdict(reply, AppCreateBootProject());
    return result;
}
#endif

#if SRV_OTHER_CLIENTS || EXCEPT_REGISTERS > 0
static void append_word(BTAG_WRITER *reply, uintptr_t word)
{
    BTagAppend32(reply, (RTS_UI32)word);
    if (sizeof(word) > sizeof(RTS_UI32))
        BTagAppend32(reply, (RTS_UI32)((RTS_UI64)word >> 32));
}
#endif

#if SRV_OTHER_CLIENTS
static RTS_RESULT single_cycle(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return control(request, reply, AppSingleCycle);
}

static RTS_RESULT reset_origin(void)
{
    return AppReset(RESET_OPTION_ORIGIN);
}

/* The application in flash and the one in RAM are one. */
static RTS_RESULT delete_app(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return control(request, reply, reset_origin);
}

/* Where an area is in memory. It says what each pointer in a variable says, and is good for comparing it with those: no
 * service takes an address. */
static RTS_RESULT get_area_address(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UI32 session = 0;
    RTS_UI32 area = 0;
    RTS_RESULT result = BTagFindUnsigned(&request->tags, TAG_APP_SESSION, &session);

    if (result == ERR_OK)
        result = BTagFindUnsigned(&request->tags, TAG_APP_AREA, &area);
    if (result == ERR_OK)
        result = check_app_session(request->client, session);
    if (result != ERR_OK)
        return result;
    uintptr_t address = (uintptr_t)AppGetAreaAddress(area, 0, 1);
    if (address == 0)
        return ERR_APP_MAPPED_AREA_NOT_FOUND;
    BTagOpen(reply, TAG_APP_AREA_ADDRESS, BTAG_ALIGN_0);
    append_word(reply, address);
    BTagClose(reply);
    return ERR_OK;
}
#endif

/* ---- what is there ---- */

static void write_exception(BTAG_WRITER *reply, const APP_EXCEPTION *exception)
{
    APP_LAST_EXCEPTION last;

    if (exception->code != RTSEXCPT_NOEXCEPTION && exception->code_offset != APP_NO_CODE_OFFSET) {
        APP_POSITION position;
        BytesPut16(position.area, APP_AREA_CODE);
        BytesPut32(position.offset, exception->code_offset);
        BTagWrite(reply, TAG_APP_EXECUTION_POSITION, BTAG_ALIGN_2, &position, sizeof(position));
    }
    BytesPut32(last.code, exception->code);
    BytesPut32(last.code_offset, exception->code_offset);
    BytesPut32(last.task, (RTS_UI32)exception->task);
    BTagWrite(reply, TAG_APP_LAST_EXCEPTION, BTAG_ALIGN_0, &last, sizeof(last));
}

#if EXCEPT_MAX_CALLS > 0
/* As many as the message has room for, the nearest first. */
static void write_calls(BTAG_WRITER *reply)
{
    enum { CALL_SIZE = 8 };
    const EXCEPT_TRACE *trace = SysExceptGetTrace();
    RTS_UI32 room = BTagGetRoom(reply) / CALL_SIZE; /* one is for the head of the element */

    if (SRV_OTHER_CLIENTS && room != 0)
        room--; /* for the operation mode after it */

    if (room == 0)
        return;
    BTagOpen(reply, TAG_APP_CALLS, BTAG_ALIGN_0);
    for (RTS_UI32 i = 0; i < trace->count && i + 1 < room; i++) {
        BTagAppend32(reply, trace->call[i].target);
        BTagAppend32(reply, trace->call[i].distance);
    }
    BTagClose(reply);
}
#else
static void write_calls(BTAG_WRITER *reply)
{
    RTS_UNUSED(reply);
}
#endif

static RTS_RESULT read_status(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    APP_STATUS status;
    APP_STATE state;
    APP_IMAGE_IDENTITY image;

    RTS_UNUSED(request);
    AppGetStatus(&status);
    BytesPut16(state.result, ERR_OK);
    BytesPut32(state.state, status.state);
    BytesPut32(state.op_state, status.op_state);
    BytesPut32(image.crc, status.image_crc);
    BytesPut32(image.size, status.image_size);
    BTagOpen(reply, TAG_APP_STATUS, BTAG_ALIGN_0);
    BTagWrite(reply, TAG_APP_STATE, BTAG_ALIGN_2, &state, sizeof(state));
    write_exception(reply, &status.exception);
    BTagWrite(reply, TAG_APP_IMAGE, BTAG_ALIGN_0, &image, sizeof(image));
    if (status.exception.code != RTSEXCPT_NOEXCEPTION) /* else a task may have one just now */
        write_calls(reply);
    if (OperationForbidden() != 0)
        BTagWrite32(reply, TAG_APP_FORBIDDEN, OperationForbidden());
    BTagClose(reply);
    if (SRV_OTHER_CLIENTS)
        BTagWrite32(reply, TAG_APP_OPERATION_MODE, DEV_MODE_DEBUG);
    return ERR_OK;
}

#if EXCEPT_REGISTERS > 0
/* Without an element if they are not known. */
static RTS_RESULT read_registers(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    const EXCEPT_FRAME *registers = SysExceptGetRegisters();
    APP_STATUS status;

    RTS_UNUSED(request);
    AppGetStatus(&status);
    if (status.exception.code == RTSEXCPT_NOEXCEPTION || registers->kind == 0)
        return ERR_OK;
    BTagOpen(reply, TAG_APP_REGISTERS, BTAG_ALIGN_0);
    BTagAppend32(reply, registers->kind);
    for (RTS_UI32 i = 0; i < EXCEPT_REGISTERS; i++)
        append_word(reply, registers->value[i]);
    BTagClose(reply);
    return ERR_OK;
}
#endif

#if SRV_INFORMATION
static RTS_RESULT read_application_list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    APP_STATUS status;
    BTAG range;
    RTS_UI32 first = 0;
    RTS_UI32 max = 1;
    RTS_RESULT result = BTagFind(&request->tags, TAG_APP_LIST_RANGE, 8, 9, &range);

    if (result == ERR_OK) {
        first = BytesGet32(range.data);
        max = BytesGet32(range.data + 4);
    } else if (result != ERR_L7_TAG_MISSING) {
        return result;
    }
    AppGetStatus(&status);
    BTagOpen(reply, TAG_APP_LIST, BTAG_ALIGN_0);
    BTagWrite32(reply, TAG_APP_LIST_START, first);
    if (status.state != AS_NONE && first == 0 && max > 0)
        BTagWriteText(reply, TAG_APP_LIST_NAME, "Application", APP_NAME_SIZE);
    BTagClose(reply);
    return ERR_OK;
}

static RTS_RESULT read_application_info(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    /* Tags in the order of AppGetInfo. */
    static const RTS_UI8 tags[] = {TAG_APP_INFO_PROJECT, TAG_APP_INFO_AUTHOR, TAG_APP_INFO_VERSION,
                                   TAG_APP_INFO_DESCRIPTION, TAG_APP_INFO_PROFILE};
    enum { MAX_TEXT = 255 };
    APP_STATUS status;

    RTS_UNUSED(request);
    AppGetStatus(&status);
    if (status.state == AS_NONE)
        return ERR_APP_NOT_LOADED;
    for (RTS_UI32 i = 0; i < RTS_COUNT(tags); i++)
        BTagWriteText(reply, tags[i], AppGetInfo(i), MAX_TEXT);
    return ERR_OK;
}

static void write_task(BTAG_WRITER *reply, const IEC_TASK_INFO *info)
{
    TASK_INFO numbers;

    BytesPut32(numbers.kind, info->kind);
    BytesPut32(numbers.priority, info->priority);
    BytesPut32(numbers.interval_us, info->interval_us);
    BytesPut32(numbers.cycles, info->cycles);
    BytesPut32(numbers.last_us, info->last_us);
    BytesPut32(numbers.avg_us, info->avg_us);
    BytesPut32(numbers.min_us, info->min_us);
    BytesPut32(numbers.max_us, info->max_us);
    BytesPut32(numbers.jitter_us, info->jitter_us);
    BytesPut32(numbers.overruns, info->overruns);
    BTagOpen(reply, TAG_TASK_INFO, BTAG_ALIGN_0);
    BTagAppend(reply, &numbers, sizeof(numbers));
    BTagAppendText(reply, info->name, sizeof(info->name) - 1);
    BTagClose(reply);
}

#if TASK_LOAD
static void write_load(BTAG_WRITER *reply, RTS_UI32 task)
{
    BTagWrite32(reply, TAG_TASK_LOAD, TaskLoadGet(task));
}
#else
#define write_load(reply, task) ((void)0)
#endif

static RTS_RESULT read_task_info(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    IEC_TASK_INFO info;

    RTS_UNUSED(request);
    for (RTS_UI32 i = 0; i < IecTaskGetCount(); i++)
        if (IecTaskGetInfo(i, &info) == ERR_OK) {
            write_task(reply, &info);
            write_load(reply, i);
        }
    return ERR_OK;
}
#endif

#if SRV_INFORMATION && IEC_LATENESS
static void append_lateness(BTAG_WRITER *reply, const IEC_LATENESS_COUNT *lateness)
{
    TASK_LATENESS numbers;

    BytesPut32(numbers.below_ns, lateness->below_ns);
    BytesPut32(numbers.count, lateness->count);
    BTagAppend(reply, &numbers, sizeof(numbers));
}

static RTS_RESULT read_task_lateness(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    IEC_LATENESS_COUNT lateness;

    RTS_UNUSED(request);
    for (RTS_UI32 i = 0; i < IecTaskGetCount(); i++) {
        BTagOpen(reply, TAG_TASK_LATENESS, BTAG_ALIGN_0);
        for (RTS_UI32 number = 0; IecCycleGetLateness(i, number, &lateness) == ERR_OK; number++) {
            if (lateness.count != 0)
                append_lateness(reply, &lateness);
        }
        BTagClose(reply);
    }
    return ERR_OK;
}
#endif

/* ---- download ---- */

/* The session that began the download which is open. */
static struct {
    const COMM_CLIENT *client;
    RTS_UI32 session;
} downloader;

/* A download belongs to its session as long as that lasts; another client can neither continue nor replace it. */
static bool is_anothers(const COMM_CLIENT *client)
{
    return COMM_MAX_CLIENTS > 1 && AppDownloadIsOpen() && downloader.client != client &&
           downloader.client->session.id == downloader.session;
}

bool AppSrvHasDownload(void)
{
    return downloader.client != NULL && is_anothers(NULL);
}

typedef struct {
    RTS_UI32 flags;
    RTS_UI32 offset;
    RTS_UI32 total;
    RTS_UI32 crc;
    const RTS_UI8 *data;
    RTS_UI32 size; /* of this part of the image */
#if APP_UNPACK_SIZE > 0
    RTS_UI32 packed_size; /* of the data, if they are packed; 0 */
#endif
} DOWNLOAD_BLOCK;

#if APP_UNPACK_SIZE > 0
static RTS_RESULT read_packed(const SRV_REQUEST *request, DOWNLOAD_BLOCK *block)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_CDL_PACKED, sizeof(CDL_PACKED) + 1, request->tags.size, &tag);

    if (result != ERR_OK)
        return result;
    block->data = tag.data + sizeof(CDL_PACKED);
    block->packed_size = tag.size - (RTS_UI32)sizeof(CDL_PACKED);
    block->size = BytesGet32(((const CDL_PACKED *)tag.data)->unpacked);
    return block->size == 0 || block->size > APP_UNPACK_SIZE ? ERR_OUT_OF_LIMITS : ERR_OK;
}

static RTS_RESULT write_packed(const DOWNLOAD_BLOCK *block, RTS_UI32 known)
{
    if (known != 0)
        return ERR_INVALID_SEQUENCE; /* which part of the data is new is not known */
    return AppDownloadUnpack(block->offset, block->data, block->packed_size, block->size);
}

#endif

static RTS_RESULT read_block(const SRV_REQUEST *request, DOWNLOAD_BLOCK *block)
{
    const CDL_POSITION *position;
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_CDL_POSITION, sizeof(*position), sizeof(*position), &tag);

    if (result != ERR_OK)
        return result;
    position = (const CDL_POSITION *)tag.data;
    block->flags = BytesGet32(position->flags);
    block->offset = BytesGet32(position->offset);
    block->total = BytesGet32(position->total_size);
    block->crc = BytesGet32(position->crc);
    result = BTagFind(&request->tags, TAG_CDL_DATA, 1, request->tags.size, &tag);
    block->data = result == ERR_OK ? tag.data : NULL;
    block->size = result == ERR_OK ? tag.size : 0;
#if APP_UNPACK_SIZE > 0
    block->packed_size = 0;
    if (result == ERR_L7_TAG_MISSING)
        result = read_packed(request, block);
#endif
    return result == ERR_L7_TAG_MISSING ? ERR_OK : result;
}

static bool is_installed(const DOWNLOAD_BLOCK *block)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.state != AS_NONE && status.image_crc == block->crc && status.image_size == block->total;
}

static bool is_under_way(const DOWNLOAD_BLOCK *block)
{
    return AppDownloadIsOf(block->total, block->crc);
}

static RTS_UI32 bytes_received(const DOWNLOAD_BLOCK *block, bool under_way)
{
    if (under_way)
        return AppDownloadOffset();
    return is_installed(block) ? block->total : 0;
}

/* Writes what of the block is new. Parts that are there already are a repetition after a lost reply. */
static RTS_RESULT write_new_part(const DOWNLOAD_BLOCK *block)
{
    RTS_UI32 next = AppDownloadOffset();

    if (block->offset > next)
        return ERR_INVALID_SEQUENCE;
    RTS_UI32 known = next - block->offset;
    if (known >= block->size)
        return ERR_OK;
#if APP_UNPACK_SIZE > 0
    if (block->packed_size != 0)
        return write_packed(block, known);
#endif
    return AppDownloadWrite(next, block->data + known, block->size - known);
}

static RTS_RESULT begin(const COMM_CLIENT *client, const DOWNLOAD_BLOCK *block)
{
    if (COMM_MAX_CLIENTS > 1) {
        downloader.client = client;
        downloader.session = client->session.id;
    }
    return AppDownloadBegin(block->total, block->crc);
}

#if ONLINE_CHANGE
static bool is_change(const DOWNLOAD_BLOCK *block)
{
    return (block->flags & DLF_CHANGE) != 0;
}
#else
#define is_change(block) false
#endif

#if BOOT_ON_DEMAND
/* Whether an image is not to boot: a client says so, or else a setting. */
static bool is_try(const DOWNLOAD_BLOCK *block)
{
    if ((block->flags & (DLF_TRY | DLF_WRITEBOOTAPPLICATION)) == 0)
        return AppDownloadTriesAll();
    return (block->flags & DLF_TRY) != 0;
}
#else
#define is_try(block) false
#define AppDownloadTry(refusal) AppDownloadEnd(refusal)
#endif

static RTS_RESULT take_block(const COMM_CLIENT *client, const DOWNLOAD_BLOCK *block, APP_REFUSAL *refusal)
{
    RTS_RESULT result = ERR_OK;

    if (OperationMay(is_change(block) ? OPERATION_ONLINE_CHANGE : OPERATION_DOWNLOAD) != ERR_OK)
        return APP_REFUSE(refusal, ERR_OPERATION_DENIED,
                          "The running program forbids it (PlcOperationControlInstance).");
#if BOOT_ON_DEMAND && ONLINE_CHANGE
    if (is_change(block) && AppDownloadIsTried())
        return APP_REFUSE(refusal, ERR_INVALID_STATE,
                          "The program is not the boot project; make it one first (plctool boot).");
#endif
    if (is_anothers(client))
        return APP_REFUSE(refusal, ERR_INVALID_STATE, "Another tool is downloading; try again when it is done.");
    if (block->offset > block->total || block->size > block->total - block->offset)
        return ERR_OUT_OF_LIMITS;
    if (block->offset == 0 && (block->flags & DLF_CONTINUEDOWNLOAD) == 0)
        result = begin(client, block);
    if (result != ERR_OK)
        return result;
    if (!is_under_way(block))
        return is_installed(block) ? ERR_OK : ERR_INVALID_SEQUENCE;
    return write_new_part(block);
}

/* The start is part of the download, so a client that ends after its last block leaves a running plant. It shows in the
 * status, also why there was none. */
static RTS_RESULT install(const DOWNLOAD_BLOCK *block, APP_REFUSAL *refusal)
{
    RTS_RESULT result;

#if ONLINE_CHANGE
    if (is_change(block))
        return AppDownloadChange(refusal);
#endif
    result = is_try(block) ? AppDownloadTry(refusal) : AppDownloadEnd(refusal);
    if (result == ERR_OK && (block->flags & DLF_START) != 0)
        (void)AppStartApplication();
    return result;
}

/* On a bus replies take the time of what is sent to the device. A question has its reply in any case. */
static void let_reply_wait(const SRV_REQUEST *request, const DOWNLOAD_BLOCK *block, RTS_RESULT result)
{
#if COMM_ENDPOINTS
    request->client->reply_may_wait = result == ERR_OK && block->size != 0 && (block->flags & DLF_REPLYMAYWAIT) != 0;
#endif
    RTS_UNUSED(request);
    RTS_UNUSED(block);
    RTS_UNUSED(result);
}

static RTS_RESULT download_compact(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    enum { REASON_OVERHEAD = 8 }; /* head of the element, NUL, padding; the smallest message has room for more */
    DOWNLOAD_BLOCK block;
    APP_REFUSAL refusal;
    RTS_RESULT result = read_block(request, &block);

    if (result != ERR_OK)
        return result;
    refusal.text[0] = '\0';
    if (block.size != 0)
        result = take_block(request->client, &block, &refusal);
    bool under_way = is_under_way(&block);
    RTS_UI32 next = bytes_received(&block, under_way);
    if (result == ERR_OK && under_way && next == block.total)
        result = install(&block, &refusal);
    let_reply_wait(request, &block, result);
    BTagWrite16(reply, TAG_SERVICE_RESULT, result);
    BTagWrite32(reply, TAG_CDL_NEXT, next);
#if APP_UNPACK_SIZE > 0
    if (block.size == 0) /* a question */
        BTagWrite32(reply, TAG_CDL_UNPACKS, APP_UNPACK_SIZE);
#endif
#if ONLINE_CHANGE
    if (block.size == 0)
        BTagWrite32(reply, TAG_CDL_CHANGES, 1);
#endif
#if BOOT_ON_DEMAND
    if (block.size == 0)
        BTagWrite32(reply, TAG_CDL_TRIES, 1);
#endif
    if (APP_REFUSAL_TEXT_SIZE > 1 && result != ERR_OK && refusal.text[0] != '\0')
        BTagWriteText(reply, TAG_CDL_REASON, refusal.text, BTagGetRoom(reply) - REASON_OVERHEAD);
    return ERR_OK;
}

static const SRV_SERVICE services[] = {
    {SRV_APP_LOGIN, RIGHT_VIEW, login_app},
    {SRV_APP_LOGOUT, RIGHT_VIEW, logout_app},
    {SRV_APP_CREATE, RIGHT_DOWNLOAD, create_app},
    {SRV_APP_START, RIGHT_CONTROL, start},
    {SRV_APP_STOP, RIGHT_CONTROL, stop},
    {SRV_APP_RESET, RIGHT_CONTROL, reset},
    {SRV_APP_READ_STATUS, RIGHT_STATE, read_status},
    {SRV_APP_DOWNLOAD_COMPACT, RIGHT_DOWNLOAD, download_compact},
#if FORCE_MAX > 0
    {SRV_APP_RELEASE_FORCE_LIST, RIGHT_WRITE, release_force_list},
#endif
#if SRV_INFORMATION
    {SRV_APP_READ_APPLICATION_LIST, RIGHT_STATE, read_application_list},
    {SRV_APP_READ_APPLICATION_INFO, RIGHT_STATE, read_application_info},
    {SRV_APP_READ_TASK_INFO, RIGHT_STATE, read_task_info},
#if IEC_LATENESS
    {SRV_APP_READ_TASK_LATENESS, RIGHT_STATE, read_task_lateness},
#endif
#endif
#if EXCEPT_REGISTERS > 0
    {SRV_APP_READ_REGISTERS, RIGHT_VIEW, read_registers},
#endif
#if BOOT_ON_DEMAND
    {SRV_APP_CREATE_BOOTPROJECT, RIGHT_DOWNLOAD, create_boot_project},
#endif
#if SRV_OTHER_CLIENTS
    {SRV_APP_DELETE, RIGHT_DOWNLOAD, delete_app},
    {SRV_APP_SINGLE_CYCLE, RIGHT_CONTROL, single_cycle},
    {SRV_APP_GET_AREA_ADDRESS, RIGHT_VIEW, get_area_address},
#endif
};

RTS_RESULT CmpAppSrv_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_APPLICATION, services, RTS_COUNT(services)) : ERR_OK;
}
