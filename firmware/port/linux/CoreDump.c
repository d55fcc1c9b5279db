/*
 * CoreDump.c - a file with what is in memory when the program stops with an exception, for plctool inspect.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The file is the JSON document that `plctool dump` writes (host/plctool/dump_file.py), without symbols, which plctool
 * finds by the checksum of the program. It is written by main when the outputs have their safe state.
 */
#define _GNU_SOURCE
#include "CoreDump.h"

#include "AppAddress.h"
#include "AppEventIds.h"
#include "CmpAppEmbedded.h"
#include "CmpDevice.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "NewFile.h"
#include "SysExcept.h"
#include "SysTarget.h"
#include "rts_config.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OWN = 0600 }; /* what is in the memory of a program may be secret */

static const char *dump_path;

void CoreDumpSet(const char *path)
{
    dump_path = path;
}

/* ---- parts of the document ---- */

/* Names and messages are in Latin-1. */
static void put_text(FILE *out, const char *key, const char *text, const char *end)
{
    fprintf(out, "\"%s\":\"", key);
    for (; *text != '\0'; text++) {
        bool plain = *text >= ' ' && *text <= '~' && *text != '"' && *text != '\\';
        fprintf(out, plain ? "%c" : "\\u%04x", (unsigned char)*text);
    }
    fprintf(out, "\"%s", end);
}

static void put_version(FILE *out, const char *key, RTS_UI32 version, const char *end)
{
    fprintf(out, "\"%s\":\"%u.%u.%u.%u\"%s", key, (unsigned)(version >> 24), (unsigned)(version >> 16 & 0xFF),
            (unsigned)(version >> 8 & 0xFF), (unsigned)(version & 0xFF), end);
}

static void put_identity(FILE *out)
{
    const SYS_TARGET *target = SysTargetGet();
    fputs("\"identity\":{", out);
    put_text(out, "device_name", target->device_name, ",");
    put_text(out, "vendor_name", target->vendor_name, ",");
    put_text(out, "node_name", target->node_name, ",");
    put_text(out, "serial_number", target->serial_number, ",");
    fprintf(out, "\"target_type\":%u,\"target_id\":%u,", (unsigned)target->type, (unsigned)target->id);
    put_version(out, "version", target->version, ",");
    put_version(out, "runtime_version", RTS_VERSION, "},");
}

static void put_calls(FILE *out)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();
    const char *comma = "";
    long link = -1;
    fputs("\"words\":[", out);
    for (RTS_UI32 i = 0; i < trace->count; i++) {
        if (trace->call[i].distance == EXCEPT_LINK) {
            link = (long)trace->call[i].target;
            continue;
        }
        fprintf(out, "%s[%u,%u]", comma, (unsigned)trace->call[i].distance, (unsigned)trace->call[i].target);
        comma = ",";
    }
    fprintf(out, link < 0 ? "],\"link\":null" : "],\"link\":%ld", link);
}

static void put_exception(FILE *out, const APP_EXCEPTION *exception)
{
    fprintf(out, "\"exception\":{\"code\":%u,\"task\":%d,\"code_offset\":", (unsigned)exception->code,
            (int)exception->task);
    fprintf(out, exception->code_offset == APP_NO_CODE_OFFSET ? "null," : "%u,", (unsigned)exception->code_offset);
    put_calls(out);
    fputs("},", out);
}

static void put_registers(FILE *out)
{
    const EXCEPT_FRAME *registers = SysExceptGetRegisters();
    if (registers->kind == 0) {
        fputs("\"registers\":null,", out);
        return;
    }
    fprintf(out, "\"registers\":{\"kind\":%u,\"values\":[", (unsigned)registers->kind);
    for (size_t i = 0; i < EXCEPT_REGISTERS; i++) {
        fprintf(out, "%s%llu", i == 0 ? "" : ",", (unsigned long long)registers->value[i]);
    }
    fputs("]},", out);
}

static void put_task(FILE *out, const IEC_TASK_INFO *info)
{
    put_text(out, "name", info->name, ",");
    fprintf(out,
            "\"kind\":%u,\"priority\":%u,\"interval_us\":%u,\"cycles\":%u,\"last_us\":%u,\"avg_us\":%u,"
            "\"min_us\":%u,\"max_us\":%u,\"jitter_us\":%u,\"overruns\":%u}",
            (unsigned)info->kind, (unsigned)info->priority, (unsigned)info->interval_us, (unsigned)info->cycles,
            (unsigned)info->last_us, (unsigned)info->avg_us, (unsigned)info->min_us, (unsigned)info->max_us,
            (unsigned)info->jitter_us, (unsigned)info->overruns);
}

static void put_tasks(FILE *out)
{
    IEC_TASK_INFO info;
    fputs("\"tasks\":[", out);
    for (RTS_UI32 i = 0; IecTaskGetInfo(i, &info) == ERR_OK; i++) {
        fputs(i == 0 ? "{" : ",{", out);
        put_task(out, &info);
    }
    fputs("],", out);
}

static void put_log(FILE *out)
{
    LOG_ENTRY entry;
    fputs("\"log\":[", out);
    for (RTS_UI32 next = 1; LogGetEntry(next, &entry) == ERR_OK; next = entry.handle + 1) {
        fprintf(out, "%s{\"handle\":%u,\"time_ns\":%lld,\"log_class\":%u,\"error\":%u,", next == 1 ? "" : ",",
                (unsigned)entry.handle, (long long)entry.time_ns, (unsigned)entry.log_class, (unsigned)entry.error);
        put_text(out, "component", CMGetComponentName(entry.component), ",");
        put_text(out, "text", entry.text, "}");
    }
    fputs("],", out);
}

static void put_area(FILE *out, RTS_UI32 area, const RTS_UI8 *data, RTS_UI32 size)
{
    static const char digits[] = "0123456789abcdef";
    fprintf(out, "{\"area\":%u,\"address\":%llu,\"hex\":\"", (unsigned)area, (unsigned long long)(uintptr_t)data);
    for (RTS_UI32 i = 0; i < size; i++) {
        (void)putc(digits[data[i] >> 4], out);
        (void)putc(digits[data[i] & 15], out);
    }
    fputs("\"}", out);
}

static void put_areas(FILE *out)
{
    const char *comma = "";
    fputs("\"areas\":[", out);
    for (RTS_UI32 area = APP_AREA_DATA; area < APP_AREA_CODE; area++) {
        RTS_UI32 size = AppGetAreaSize(area);
        const RTS_UI8 *data = size != 0 ? AppGetAreaAddress(area, 0, size) : NULL;
        if (data != NULL) {
            fputs(comma, out);
            put_area(out, area, data, size);
            comma = ",";
        }
    }
    fputs("]", out);
}

static void put_document(FILE *out, const APP_STATUS *status)
{
    fprintf(out, "{\"format\":\"plctool dump\",\"version\":1,\"image_crc\":%u,\"pointer_size\":%u,",
            (unsigned)status->image_crc, (unsigned)sizeof(uintptr_t));
    put_identity(out);
    put_exception(out, &status->exception);
    put_registers(out);
    put_tasks(out);
    put_log(out);
    put_areas(out);
    fputs(",\"symbols\":null}\n", out);
}

/* ---- the file ---- */

/* Returns errno, 0 when it is there. */
static int write_dump(const APP_STATUS *status)
{
    int file = NewFileOpen(dump_path, OWN);
    char *text = NULL;
    size_t size = 0;
    if (file < 0) {
        return errno;
    }
    FILE *out = open_memstream(&text, &size);
    if (out == NULL) {
        return NewFileEnd(file, dump_path, errno);
    }
    put_document(out, status);
    int error = fclose(out) == 0 ? NewFileWrite(file, text, size) : errno;
    free(text);
    return NewFileEnd(file, dump_path, error);
}

static void dump(EVENT_PARAM *event)
{
    APP_STATUS status;
    RTS_UNUSED(event);
    AppGetStatus(&status);
    int error = write_dump(&status);
    if (error != 0) {
        LogAdd(CMPID_CmpMgr, LOG_WARNING, ERR_FAILED, "The dump is not written to %s: %s", dump_path, strerror(error));
    } else {
        LogAdd(CMPID_CmpMgr, LOG_INFO, ERR_OK, "A dump is in %s", dump_path);
    }
}

void CoreDumpBegin(void)
{
    if (dump_path != NULL) {
        (void)EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_CmpApp_Exception, dump, NULL);
    }
}
