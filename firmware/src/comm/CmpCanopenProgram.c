/*
 * CmpCanopenProgram.c - the manager of a CANopen network replaces, starts and stops the program of this device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCanopenProgram.h"

#include <stddef.h>
#include <string.h>

#include "AppPassword.h"
#include "Canopen.h"
#include "CanopenProgram.h"
#include "CmpAppEmbedded.h"
#include "CmpAppSrv.h"
#include "CmpBytes.h"
#include "CmpCan.h"
#include "CmpOperationControl.h"
#include "CompactDownload.h"
#include "IoDrvCanopenDevice.h"

#if CANOPEN_PROGRAM_DOWNLOAD

enum { NO_COMMAND = -1, ABORT_FIELD = 4 };

static struct {
    RTS_UI8 head[sizeof(CDL_HEADER)]; /* of the image: it says size and CRC, with which a download begins */
    RTS_UI32 done;                    /* bytes that have come */
    RTS_UI32 size;                    /* said by the manager, 0: not said */
    bool is_complete;                 /* the image waits for "start" */
    int command;                      /* to be carried out */
    PROGRAM_ERROR error;
    APP_REFUSAL refusal;
} download = {.command = NO_COMMAND};

static RTS_UI32 fail(PROGRAM_ERROR error, RTS_UI32 abort)
{
    download.error = error;
    return abort;
}

/* ---- download ---- */

static RTS_UI32 total_size(void)
{
    return BytesGet32(download.head + offsetof(CDL_HEADER, total_size));
}

static RTS_UI32 image_crc(void)
{
    return BytesGet32(download.head + offsetof(CDL_HEADER, crc));
}

static RTS_UI32 begin(bool has_size, RTS_UI32 size)
{
    download.done = 0;
    download.size = has_size ? size : 0;
    download.is_complete = false;
    download.error = PROGRAM_OK;
    download.refusal.text[0] = '\0';
    if (AppHasPassword() || OperationMay(OPERATION_DOWNLOAD) != ERR_OK)
        return fail(PROGRAM_SECURED, SDO_ABORT_LOCAL);
    return AppSrvHasDownload() ? SDO_ABORT_STATE : 0;
}

static RTS_UI32 check_head(void)
{
    if (BytesGet32(download.head + offsetof(CDL_HEADER, header_tag)) != CDL_HEADER_TAG)
        return fail(PROGRAM_UNKNOWN_FORMAT, SDO_ABORT_STORE);
    return download.size != 0 && download.size != total_size() ? fail(PROGRAM_BAD_IMAGE, SDO_ABORT_LENGTH) : 0;
}

static RTS_UI32 write_part(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    if (size == 0)
        return 0;
    if (!AppDownloadIsOf(total_size(), image_crc()))
        return SDO_ABORT_STATE; /* a tool has begun another one */
    switch (AppDownloadWrite(offset, data, size)) {
    case ERR_OK:
        return 0;
    case ERR_DEVICE:
        return fail(PROGRAM_FLASH_FAULT, SDO_ABORT_HARDWARE);
    case ERR_OUT_OF_LIMITS:
        return fail(PROGRAM_BAD_IMAGE, SDO_ABORT_TOO_LONG);
    default:
        return SDO_ABORT_STATE;
    }
}

static RTS_UI32 open_slot(void)
{
    RTS_UI32 abort = check_head();

    if (abort != 0)
        return abort;
    switch (AppDownloadBegin(total_size(), image_crc())) {
    case ERR_OK:
        return write_part(0, download.head, sizeof(download.head));
    case ERR_NOMEMORY:
        return fail(PROGRAM_BAD_ADDRESS, SDO_ABORT_MEMORY);
    case ERR_DEVICE:
        return fail(PROGRAM_FLASH_FAULT, SDO_ABORT_HARDWARE);
    default:
        return SDO_ABORT_STATE;
    }
}

static RTS_UI32 write(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 abort = 0;
    RTS_UI32 part = 0;

    if (download.done < sizeof(download.head)) {
        part = (RTS_UI32)sizeof(download.head) - download.done;
        part = size < part ? size : part;
        memcpy(download.head + download.done, data, part);
        download.done += part;
        if (download.done == sizeof(download.head))
            abort = open_slot();
    }
    if (abort == 0)
        abort = write_part(download.done, data + part, size - part);
    download.done += size - part;
    return abort;
}

static RTS_UI32 end(void)
{
    if (download.done < sizeof(download.head) || download.done != total_size())
        return fail(PROGRAM_BAD_IMAGE, SDO_ABORT_LENGTH);
    download.is_complete = true;
    return 0;
}

/* ---- commands ---- */

static RTS_UI32 control(RTS_UI8 command)
{
    if (AppHasPassword())
        return fail(PROGRAM_SECURED, SDO_ABORT_LOCAL);
    if (command > PROGRAM_CLEAR)
        return SDO_ABORT_VALUE;
    download.command = command;
    return CANOPEN_REPLIES_LATER;
}

static PROGRAM_ERROR get_error(RTS_RESULT result)
{
    switch (result) {
    case ERR_DEVICE:
        return PROGRAM_FLASH_FAULT;
    case ERR_NOMEMORY:
        return PROGRAM_BAD_ADDRESS;
    default:
        return PROGRAM_BAD_IMAGE;
    }
}

/* Checks the image and puts it in the place of the program. */
static RTS_UI32 commit(void)
{
    download.is_complete = false;
    if (OperationMay(OPERATION_DOWNLOAD) != ERR_OK)
        return fail(PROGRAM_SECURED, SDO_ABORT_LOCAL);
    if (!AppDownloadIsOf(total_size(), image_crc()))
        return SDO_ABORT_STATE;
    RTS_RESULT result = AppDownloadEnd(&download.refusal);
    if (result != ERR_OK)
        return fail(get_error(result), SDO_ABORT_STORE);
    return AppStartApplication() == ERR_OK ? 0 : SDO_ABORT_STATE;
}

static RTS_RESULT stop(void)
{
    RTS_RESULT result = OperationMay(OPERATION_STOP);

    return result == ERR_OK ? AppStopApplication() : result;
}

static RTS_RESULT restart(void)
{
    RTS_RESULT result = OperationMay(OPERATION_RESET);

    return result == ERR_OK ? AppReset(RESET_OPTION_WARM) : result;
}

/* "Clear" is a step before a download to other devices: here the program runs until the next one is whole. */
static RTS_UI32 carry_out(int command)
{
    RTS_RESULT result = ERR_OK;

    if (command == PROGRAM_CLEAR)
        download.is_complete = false;
    else if (command == PROGRAM_START && download.is_complete)
        return commit();
    else if (command == PROGRAM_START)
        result = AppStartApplication();
    else
        result = command == PROGRAM_STOP ? stop() : restart();
    if (result == ERR_OPERATION_DENIED)
        return SDO_ABORT_LOCAL;
    return result == ERR_OK ? 0 : SDO_ABORT_STATE;
}

/* The reply is made before: a program that is replaced takes the device with it. It is sent before the device boots. */
static void carry_out_waiting(void)
{
    CAN_FRAME reply;
    RTS_UI32 network = IoDrvCanopenDeviceMakeReply(&reply);
    RTS_UI32 abort = carry_out(download.command);

    download.command = NO_COMMAND;
    if (abort != 0) {
        reply.data[0] = SDO_ABORT;
        BytesPut32(reply.data + ABORT_FIELD, abort);
    }
    (void)CanSend(network, &reply);
}

/* ---- objects ---- */

static RTS_UI8 get_state(const APP_STATUS *status)
{
    if (status->state == AS_NONE)
        return PROGRAM_CLEAR;
    return status->state == AS_RUN ? PROGRAM_START : PROGRAM_STOP;
}

static void read(RTS_UI32 place, RTS_UI8 *data, RTS_UI32 *size)
{
    APP_STATUS status;

    AppGetStatus(&status);
    switch (place) {
    case PROGRAM_CONTROL:
        data[0] = get_state(&status);
        break;
    case PROGRAM_IDENTIFICATION:
        BytesPut32(data, status.image_crc);
        break;
    case PROGRAM_STATUS:
        BytesPut32(data, (RTS_UI32)download.error << 1);
        break;
    default: {
        RTS_UI32 length = (RTS_UI32)strlen(download.refusal.text);
        *size = length < *size ? length : *size;
        memcpy(data, download.refusal.text, *size);
        break;
    }
    }
}

RTS_RESULT CmpCanopenProgram_Hook(CMP_HOOK hook)
{
    static const CANOPEN_PROGRAM functions = {begin, write, end, control, read};

    if (hook == CH_INIT2) {
        memset(&download, 0, sizeof(download));
        download.command = NO_COMMAND;
        IoDrvCanopenDeviceSetProgram(&functions);
    } else if (hook == CH_COMM_CYCLE && download.command != NO_COMMAND) {
        carry_out_waiting();
    }
    return ERR_OK;
}

#endif
