/*
 * app_image.h - builds application images with hand-written x86-64 code, for tests of the runtime.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A test fills an APP_SPEC, adds code to it and builds the image. On other machines there is nothing to run: a test
 * that includes this starts main with NEEDS_X86_64.
 */
#ifndef APP_IMAGE_H
#define APP_IMAGE_H

#include <stdio.h>
#include <string.h>

#include "CmpAppEmbedded.h"
#include "CmpChecksum.h"
#include "CmpIecTask.h"
#include "CompactDownload.h"
#include "IoConfig.h"
#include "Sim.h"
#include "packer.h"
#include "rts_config.h"

/* Of the machine code here. */
#if defined(_WIN32)
#define OWN_TARGET_ID TARGET_ID_X86_64_WINDOWS
#else
#define OWN_TARGET_ID TARGET_ID_X86_64_LINUX
#endif

#if defined(__x86_64__)
#define NEEDS_X86_64
#else
#define NEEDS_X86_64 return puts("its applications are machine code of x86-64"), 77
#endif

enum { SPEC_NO_ENTRY = -1 };

typedef struct {
    const char *name;
    RTS_UI32 signature;
    RTS_UI32 version;
} SPEC_IMPORT;

typedef struct {
    CDL_KEPT variable;
    CDL_KEPT_RUN run; /* when `variable` says so */
} SPEC_KEPT;

enum { SPEC_MAX_KEPT = 8 };

typedef struct {
    RTS_UI8 code[8192];
    RTS_UI32 code_size;
    RTS_UI32 areas[APP_AREA_CODE]; /* bytes */
    RTS_I32 function[CDL_FUNCTION_COUNT];
    CDL_TASK tasks[APP_MAX_TASKS + 1];
    RTS_UI32 task_count;
    SPEC_IMPORT imports[APP_MAX_IMPORTS + 1];
    RTS_UI32 import_count;
    SPEC_KEPT kept[SPEC_MAX_KEPT];
    RTS_UI32 kept_count;                 /* 0: no blob */
    CDL_IMAGE images[2 * APP_MAX_TASKS]; /* what the tasks use of inputs and outputs */
    RTS_UI32 image_count;                /* 0: no blob */
    IO_CONFIG_PLACE io;                  /* size 0: no blob */
    CDL_CHANGE change;                   /* base 0: no blob */
    const void *exports;                 /* of CDL_BLOB_EXPORTS */
    RTS_UI32 exports_size;               /* 0: no blob */
    const char *info[5];
    const void *more_info; /* after the strings and the date */
    RTS_UI32 more_info_size;
} APP_SPEC;

typedef struct {
    RTS_UI8 bytes[16384];
    RTS_UI32 size;
} APP_BYTES;

/* ---- code ---- */

static inline void spec_init(APP_SPEC *spec)
{
    static const char *const info[5] = {"Project", "Author", "1.2.3", "Description", "Profile"};
    int i;

    memset(spec, 0, sizeof *spec);
    for (i = 0; i < CDL_FUNCTION_COUNT; i++)
        spec->function[i] = SPEC_NO_ENTRY;
    spec->areas[APP_AREA_DATA] = 64;
    spec->areas[APP_AREA_RETAIN] = 16;
    spec->areas[APP_AREA_OUTPUT] = 16;
    memcpy(spec->info, info, sizeof info);
}

static inline void emit(APP_SPEC *spec, const char *bytes, RTS_UI32 size)
{
    memcpy(spec->code + spec->code_size, bytes, size);
    spec->code_size += size;
}

static inline void emit_u32(APP_SPEC *spec, RTS_UI32 value)
{
    memcpy(spec->code + spec->code_size, &value, sizeof value);
    spec->code_size += (RTS_UI32)sizeof value;
}

/* Offset of what is emitted next. */
static inline RTS_UI32 here(const APP_SPEC *spec)
{
    return spec->code_size;
}

/* mov rax, [rdi + area] */
static inline void emit_load_area(APP_SPEC *spec, RTS_UI32 area)
{
    char displacement = (char)(offsetof(IEC_CONTEXT, area) + sizeof(RTS_UI8 *) * area);

    emit(spec, "\x48\x8B\x47", 3);
    emit(spec, &displacement, 1);
}

/* area[offset] += value, as DINT */
static inline void emit_add(APP_SPEC *spec, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 value)
{
    emit_load_area(spec, area);
    emit(spec, "\x81\x80", 2);
    emit_u32(spec, offset);
    emit_u32(spec, value);
}

/* area[offset] := value, as DINT */
static inline void emit_set(APP_SPEC *spec, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 value)
{
    emit_load_area(spec, area);
    emit(spec, "\xC7\x80", 2);
    emit_u32(spec, offset);
    emit_u32(spec, value);
}

/* area[offset] := area[offset], as DINT */
static inline void emit_copy(APP_SPEC *spec, RTS_UI32 to_area, RTS_UI32 to, RTS_UI32 from_area, RTS_UI32 from)
{
    emit_load_area(spec, from_area);
    emit(spec, "\x8B\x88", 2); /* mov ecx, [rax + from] */
    emit_u32(spec, from);
    emit_load_area(spec, to_area);
    emit(spec, "\x89\x88", 2); /* mov [rax + to], ecx */
    emit_u32(spec, to);
}

/* area[offset] := low word of the context's time_ms */
static inline void emit_store_time_ms(APP_SPEC *spec, RTS_UI32 area, RTS_UI32 offset)
{
    emit(spec, "\x8B\x4F\x08", 3); /* mov ecx, [rdi + 8] */
    emit_load_area(spec, area);
    emit(spec, "\x89\x88", 2); /* mov [rax + offset], ecx */
    emit_u32(spec, offset);
}

/* In GlobalInit: skips the next `size` bytes of code when retain variables are kept. */
static inline void emit_skip_unless_init_retains(APP_SPEC *spec, RTS_UI8 size)
{
    emit(spec, "\x85\xF6\x74", 3); /* test esi, esi; jz */
    emit(spec, (const char *)&size, 1);
}

/* Calls import `slot` with one UDINT; keeps the context. */
static inline void emit_call(APP_SPEC *spec, RTS_UI8 slot, RTS_UI32 argument)
{
    char displacement = (char)(slot * sizeof(RTS_PFN));

    emit(spec, "\x57\x48\x8B\x47\x40\xBF", 6); /* push rdi; mov rax, [rdi + 64]; mov edi, argument */
    emit_u32(spec, argument);
    emit(spec, "\xFF\x50", 2); /* call [rax + 8 * slot] */
    emit(spec, &displacement, 1);
    emit(spec, "\x5F", 1); /* pop rdi */
}

static inline void emit_ret(APP_SPEC *spec)
{
    emit(spec, "\xC3", 1);
}

static inline void emit_endless_loop(APP_SPEC *spec)
{
    emit(spec, "\xEB\xFE", 2);
}

static inline void emit_divide_by_zero(APP_SPEC *spec)
{
    emit(spec, "\x31\xC9\xF7\xF1", 4); /* xor ecx, ecx; div ecx */
}

static inline void emit_write_to_null(APP_SPEC *spec)
{
    emit(spec, "\x31\xC0\x89\x00", 4); /* xor eax, eax; mov [rax], eax */
}

static inline void emit_illegal_instruction(APP_SPEC *spec)
{
    emit(spec, "\x0F\x0B", 2); /* ud2 */
}

/* ---- tasks and imports ---- */

static inline CDL_TASK *add_task(APP_SPEC *spec, const char *name, RTS_UI8 kind, RTS_UI32 interval_us, RTS_UI32 entry)
{
    CDL_TASK *task = &spec->tasks[spec->task_count++];

    task->interval_us = interval_us;
    task->kind = kind;
    task->priority = 10;
    task->entry_offset = entry;
    task->event_area = APP_AREA_NONE;
    strncpy(task->name, name, sizeof task->name - 1);
    return task;
}

static inline void add_import(APP_SPEC *spec, const char *name, RTS_UI32 signature, RTS_UI32 version)
{
    SPEC_IMPORT import = {name, signature, version};

    spec->imports[spec->import_count++] = import;
}

/* A DINT that is kept; its hash is `name` alone. In the order of their names. */
static inline SPEC_KEPT *add_kept(APP_SPEC *spec, char name, RTS_UI32 offset, RTS_UI32 flags)
{
    SPEC_KEPT *kept = &spec->kept[spec->kept_count++];

    kept->variable.hash[0] = (RTS_UI8)name;
    kept->variable.place = offset << CDL_KEPT_OFFSET_SHIFT | flags | 2;
    return kept;
}

/* An array that is kept. */
static inline void add_kept_run(APP_SPEC *spec, char name, RTS_UI32 offset, RTS_UI32 flags, CDL_KEPT_RUN run)
{
    add_kept(spec, name, offset, flags | CDL_KEPT_IS_RUN)->run = run;
}

/* ---- the image ---- */

static inline void append(APP_BYTES *image, const void *data, RTS_UI32 size)
{
    memcpy(image->bytes + image->size, data, size);
    image->size += size;
}

static inline void pad(APP_BYTES *image, RTS_UI32 align)
{
    while (image->size % align != 0)
        image->bytes[image->size++] = 0;
}

static inline void append_blob(APP_BYTES *image, RTS_UI32 id, const void *data, RTS_UI32 size)
{
    CDL_BLOB blob = {CDL_BLOB_MAGIC, id, size};

    append(image, &blob, sizeof blob);
    append(image, data, size);
    pad(image, 4);
}

static inline void append_kept(APP_BYTES *image, const APP_SPEC *spec)
{
    RTS_UI8 table[SPEC_MAX_KEPT * sizeof(SPEC_KEPT)];
    RTS_UI32 size = 0;
    RTS_UI32 i;

    for (i = 0; i < spec->kept_count; i++) {
        const SPEC_KEPT *kept = &spec->kept[i];
        RTS_UI32 part = sizeof kept->variable;
        if ((kept->variable.place & CDL_KEPT_IS_RUN) != 0)
            part += (RTS_UI32)sizeof kept->run;
        memcpy(table + size, kept, part);
        size += part;
    }
    if (size > 0)
        append_blob(image, CDL_BLOB_RETAIN, table, size);
}

static inline void append_areas(APP_BYTES *image, const APP_SPEC *spec)
{
    RTS_UI16 i;

    for (i = 0; i < APP_AREA_CODE; i++) {
        AREA_INFO area = {spec->areas[i], i, AREA_TYPE_DATA};
        if (area.size != 0)
            append(image, &area, sizeof area);
    }
}

static inline void append_functions(APP_BYTES *image, const APP_SPEC *spec)
{
    int i;

    for (i = 0; i < CDL_FUNCTION_COUNT; i++) {
        POU_REF ref = {0, APP_AREA_NONE, 0};
        if (spec->function[i] != SPEC_NO_ENTRY) {
            ref.area = APP_AREA_CODE;
            ref.offset = (RTS_UI32)spec->function[i];
        }
        append(image, &ref, sizeof ref);
    }
}

static inline void append_imports(APP_BYTES *image, const APP_SPEC *spec)
{
    RTS_UI32 i;

    for (i = 0; i < spec->import_count; i++) {
        const SPEC_IMPORT *import = &spec->imports[i];
        EXT_REF_INFO ref = {import->signature, i, import->version, i * (RTS_UI32)sizeof(RTS_PFN), APP_AREA_NONE};
        append(image, &ref, EXT_REF_INFO_SIZE);
        append(image, import->name, (RTS_UI32)strlen(import->name) + 1);
        pad(image, 4);
    }
}

static inline void append_info(APP_BYTES *image, const APP_SPEC *spec)
{
    static const RTS_UI32 date;
    int i;

    for (i = 0; i < 5; i++) {
        append(image, spec->info[i], (RTS_UI32)strlen(spec->info[i]) + 1);
        pad(image, 4);
    }
    append(image, &date, sizeof date);
    if (spec->more_info_size > 0)
        append(image, spec->more_info, spec->more_info_size);
    pad(image, 4);
}

static inline CDL_HEADER image_header(const APP_BYTES *image)
{
    CDL_HEADER header;

    memcpy(&header, image->bytes, sizeof header);
    return header;
}

/* Puts a header into the image and makes its CRC right. */
static inline void image_set_header(APP_BYTES *image, CDL_HEADER header)
{
    header.crc = 0;
    memcpy(image->bytes, &header, sizeof header);
    header.crc = CRC32Update(0, image->bytes, image->size);
    memcpy(image->bytes, &header, sizeof header);
}

static inline void image_fix_crc(APP_BYTES *image)
{
    image_set_header(image, image_header(image));
}

static inline RTS_UI32 image_crc(const APP_BYTES *image)
{
    return image_header(image).crc;
}

/* Ends the segment that began at `start`. */
static inline CDL_SEGMENT end_segment(const APP_BYTES *image, RTS_UI32 start)
{
    CDL_SEGMENT segment = {start, image->size - start};

    if (segment.size == 0)
        segment.offset = 0;
    return segment;
}

static inline void build_image(APP_BYTES *image, const APP_SPEC *spec)
{
    CDL_HEADER h;

    memset(&h, 0, sizeof h);
    memset(image, 0, sizeof *image);
    image->size = CDL_HEADER_SIZE;
    append_info(image, spec);
    h.application_info = end_segment(image, CDL_HEADER_SIZE);
    append_areas(image, spec);
    h.area_table = end_segment(image, h.application_info.offset + h.application_info.size);
    append_functions(image, spec);
    h.function_table = end_segment(image, h.area_table.offset + h.area_table.size);
    append_imports(image, spec);
    h.external_function_table = end_segment(image, h.function_table.offset + h.function_table.size);
    h.blob.offset = image->size;
    append_blob(image, CDL_BLOB_TASKS, spec->tasks, spec->task_count * (RTS_UI32)sizeof(CDL_TASK));
    append_kept(image, spec);
    if (spec->image_count != 0)
        append_blob(image, CDL_BLOB_IMAGES, spec->images, spec->image_count * (RTS_UI32)sizeof(CDL_IMAGE));
    if (spec->io.size != 0)
        append_blob(image, CDL_BLOB_IO, &spec->io, sizeof spec->io);
    if (spec->exports_size != 0)
        append_blob(image, CDL_BLOB_EXPORTS, spec->exports, spec->exports_size);
    if (spec->change.base != 0)
        append_blob(image, CDL_BLOB_CHANGE, &spec->change, sizeof spec->change);
    h.blob = end_segment(image, h.blob.offset);
    pad(image, APP_CODE_ALIGN);
    h.code.offset = image->size;
    append(image, spec->code, spec->code_size);
    h.code.size = spec->code_size;
    h.header_tag = CDL_HEADER_TAG;
    h.header_version = CDL_HEADER_VERSION;
    h.header_size = CDL_HEADER_SIZE;
    h.total_size = image->size;
    h.device_type = TARGET_TYPE_PROGRAMMABLE;
    h.device_id = OWN_TARGET_ID;
    h.device_version = 0x01000000;
    h.code_area_size = h.code.size;
    h.code_area_index = APP_AREA_CODE;
    image_set_header(image, h);
}

/* ---- an application for all tests: a task of 10 ms that counts up by `step` ---- */

enum {
    COUNTER_OFFSET = 0,   /* data: DINT, counts */
    STEP_OFFSET = 4,      /* data: DINT, set to `step` by CodeInit */
    RETAIN_A_OFFSET = 0,  /* retain: DINT, starts at 100 * step and counts */
    RETAIN_B_OFFSET = 12, /* retain: the same number once more, at the other end of the area */
    OUTPUT_OFFSET = 0,    /* output: DINT, set to `step` */
};

static inline void spec_counter(APP_SPEC *spec, RTS_UI32 step)
{
    RTS_UI32 entry;

    spec_init(spec);
    add_kept(spec, 'A', RETAIN_A_OFFSET, 0);
    add_kept(spec, 'B', RETAIN_B_OFFSET, 0);
    spec->function[CDL_FUNCTION_CODE_INIT] = (RTS_I32)here(spec);
    emit_set(spec, APP_AREA_DATA, STEP_OFFSET, step);
    emit_set(spec, APP_AREA_RETAIN, RETAIN_A_OFFSET, 100 * step);
    emit_set(spec, APP_AREA_RETAIN, RETAIN_B_OFFSET, 100 * step);
    emit_ret(spec);
    entry = here(spec);
    emit_add(spec, APP_AREA_DATA, COUNTER_OFFSET, step);
    emit_add(spec, APP_AREA_RETAIN, RETAIN_A_OFFSET, step);
    emit_add(spec, APP_AREA_RETAIN, RETAIN_B_OFFSET, step);
    emit_set(spec, APP_AREA_OUTPUT, OUTPUT_OFFSET, step);
    emit_ret(spec);
    add_task(spec, "Main", KIND_CYCLIC, 10000, entry);
}

static inline void build_counter(APP_BYTES *image, RTS_UI32 step)
{
    APP_SPEC spec;

    spec_counter(&spec, step);
    build_image(image, &spec);
}

/* ---- talking to the runtime ---- */

/* Sends the first `size` bytes of an image in blocks, as if they were all of it. */
static inline RTS_RESULT send_part(const APP_BYTES *image, RTS_UI32 size)
{
    enum { BLOCK = 200 };
    RTS_RESULT result = AppDownloadBegin(size, image_crc(image));
    RTS_UI32 done;

    for (done = 0; result == ERR_OK && done < size; done += BLOCK)
        result = AppDownloadWrite(done, image->bytes + done, size - done < BLOCK ? size - done : BLOCK);
    return result;
}

/* Downloads the first `size` bytes of an image. */
static inline RTS_RESULT download_part(const APP_BYTES *image, RTS_UI32 size, APP_REFUSAL *refusal)
{
    RTS_RESULT result = send_part(image, size);

    return result == ERR_OK ? AppDownloadEnd(refusal) : result;
}

/* The same, packed, in blocks that copy from those before. */
static inline RTS_RESULT download_packed(const APP_BYTES *image)
{
    enum { BLOCK = 200 };
    RTS_UI8 packed[2 * BLOCK];
    APP_REFUSAL refusal;
    RTS_RESULT result = AppDownloadBegin(image->size, image_crc(image));

    for (RTS_UI32 done = 0; result == ERR_OK && done < image->size; done += BLOCK) {
        RTS_UI32 size = image->size - done < BLOCK ? image->size - done : BLOCK;
        result = AppDownloadUnpack(done, packed, pack(image->bytes, done, done + size, packed), size);
    }
    return result == ERR_OK ? AppDownloadEnd(&refusal) : result;
}

static inline RTS_RESULT download(const APP_BYTES *image)
{
    APP_REFUSAL refusal;

    return download_part(image, image->size, &refusal);
}

static inline RTS_UI32 read_u32(RTS_UI32 area, RTS_UI32 offset)
{
    const RTS_UI8 *address = AppGetAreaAddress(area, offset, 4);
    RTS_UI32 value = 0;

    if (address != NULL)
        memcpy(&value, address, sizeof value);
    return value;
}

static inline RTS_UI32 app_state(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.state;
}

static inline RTS_UI32 app_exception(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.exception.code;
}

static inline RTS_I64 ms(RTS_I64 n)
{
    return n * 1000000;
}

#endif
