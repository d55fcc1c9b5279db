/*
 * CmpFileTransfer.c - the file services (group 8).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpFileTransfer.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpAppEmbedded.h"
#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpChecksum.h"
#include "CmpLog.h"
#include "CmpPackets.h"
#include "CmpSettings.h"
#include "CmpSrv.h"
#include "FileStore.h"
#include "RetainFile.h"
#include "SysTarget.h"
#include "rts_config.h"

#if FILE_STORE_FILES > 0

typedef struct FILE_KIND FILE_KIND;

/* What a file is: `entry` has its name, size and CRC, and for its kind where it is. */
typedef struct {
    const FILE_KIND *kind;
    FILE_ENTRY entry;
} SOURCE;

struct FILE_KIND {
    const char *name; /* NULL: those of the store */
    /* Fills in size and CRC; ERR_NO_OBJECT there is no such file. */
    RTS_RESULT (*find)(FILE_ENTRY *entry);
    /* Within its size. ERR_NO_CONSISTENCY: it is another file now. */
    RTS_RESULT (*read)(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size);
    /* Whether a client may write and delete it; NULL: no. */
    bool (*may_change)(void);
    /* For one that the device takes and does not keep: whether a client may put it now, and what it does with it. */
    RTS_RESULT (*may_put)(void);
    RTS_RESULT (*put)(const FILE_ENTRY *file);
};

/* A file that a client reads; session 0: none. */
typedef struct {
    RTS_UI32 session;
    RTS_UI32 handle;
    RTS_UI32 position;
    SOURCE source;
} READER;

static struct {
    READER reader[COMM_MAX_CLIENTS];
    const COMM_CLIENT *writer; /* NULL: none */
    RTS_UI32 writer_session;
    RTS_UI32 writer_handle;
    const FILE_KIND *writer_kind;
} files;

/* ---- the program ---- */

static RTS_RESULT find_image(FILE_ENTRY *entry)
{
    APP_STATUS status;

    AppGetStatus(&status);
    entry->size = status.image_size;
    entry->start = status.image_crc; /* the one in its header */
    if (status.state == AS_NONE)
        return ERR_NO_OBJECT;
    RTS_UI8 part[64];
    entry->crc = 0;
    for (RTS_UI32 done = 0; done < entry->size; done += sizeof(part)) {
        RTS_UI32 size = entry->size - done < sizeof(part) ? entry->size - done : (RTS_UI32)sizeof(part);
        if (AppReadImage(done, part, size) != ERR_OK)
            return ERR_DEVICE;
        entry->crc = CRC32Update(entry->crc, part, size);
    }
    return ERR_OK;
}

static RTS_RESULT read_image(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size)
{
    APP_STATUS status;

    AppGetStatus(&status);
    if (status.state == AS_NONE || status.image_crc != entry->start || status.image_size != entry->size)
        return ERR_NO_CONSISTENCY;
    return AppReadImage(offset, data, size);
}

/* ---- the log ---- */

/* A part of the log in lines: what of it comes between `skip` and the end of `data`. Size and CRC are those of all. */
typedef struct {
    RTS_UI8 *data;
    RTS_UI32 room;
    RTS_UI32 skip;
    RTS_UI32 size;
    RTS_UI32 crc;
} LOG_PART;

static void add_line(LOG_PART *part, const char *line, RTS_UI32 size)
{
    RTS_UI32 skipped = size < part->skip ? size : part->skip;

    part->crc = CRC32Update(part->crc, line, size);
    part->size += size;
    part->skip -= skipped;
    size -= skipped;
    if (size > part->room)
        size = part->room;
    if (size == 0)
        return;
    memcpy(part->data, line + skipped, size);
    part->data += size;
    part->room -= size;
}

/* All entries up to handle `last`, 0: to the newest. Returns the handle of the last one. */
static RTS_UI32 render_log(LOG_PART *part, RTS_UI32 last)
{
    char line[LOG_TEXT_SIZE + 64];
    LOG_ENTRY entry;
    RTS_UI32 handle = 0;

    while (LogGetEntry(handle + 1, &entry) == ERR_OK && entry.handle > handle && (last == 0 || entry.handle <= last)) {
        handle = entry.handle;
        RTS_I64 time_ms = entry.time_ns / 1000000; /* more than 32 bits after 49 days */
        add_line(part, line,
                 (RTS_UI32)CMUtlsnprintf(line, sizeof(line), "%u s %u ms %s: %s\n", (unsigned)(time_ms / 1000),
                                         (unsigned)(time_ms % 1000), CMGetComponentName(entry.component), entry.text));
    }
    return handle;
}

static RTS_RESULT find_log(FILE_ENTRY *entry)
{
    LOG_PART all = {0};

    entry->start = render_log(&all, 0);
    entry->size = all.size;
    entry->crc = all.crc;
    return ERR_OK;
}

static RTS_RESULT read_log(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size)
{
    LOG_PART part = {data, size, offset, 0, 0};

    if (entry->size == 0)
        return ERR_OK;
    (void)render_log(&part, entry->start);
    return part.size == entry->size && part.crc == entry->crc ? ERR_OK : ERR_NO_CONSISTENCY; /* entries were dropped */
}

/* ---- those of the store ---- */

static RTS_RESULT find_stored(FILE_ENTRY *entry)
{
    const FILE_ENTRY *file = FileStoreFind(entry->name);

    if (file == NULL)
        return ERR_NO_OBJECT;
    *entry = *file;
    return ERR_OK;
}

static RTS_RESULT read_stored(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size)
{
    return FileStoreRead(entry, offset, data, size);
}

static bool always(void)
{
    return true;
}

/* ---- the settings ---- */

#if SETTINGS
/* Those that the device started with, as plcrt has them from a file of its machine; else those of the store, which
 * are there, empty, also before they are put. */
static RTS_RESULT find_settings(FILE_ENTRY *entry)
{
    INI_PART given;

    if (!SettingsGiven(&given)) {
        (void)find_stored(entry);
        return ERR_OK;
    }
    entry->size = given.size;
    entry->crc = CRC32Update(0, given.text, given.size);
    return ERR_OK;
}

static RTS_RESULT read_settings(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size)
{
    INI_PART given;

    if (!SettingsGiven(&given))
        return read_stored(entry, offset, data, size);
    memcpy(data, given.text + offset, size);
    return ERR_OK;
}

static bool are_not_given(void)
{
    INI_PART given;

    return !SettingsGiven(&given);
}
#endif

static const FILE_KIND kinds[] = {
    {FILE_NAME_IMAGE, find_image, read_image, NULL, NULL, NULL},
    {FILE_NAME_LOG, find_log, read_log, NULL, NULL, NULL},
    {FILE_NAME_RETAIN, RetainFileFind, RetainFileRead, NULL, RetainFileMayPut, RetainFilePut},
#if SETTINGS
    {SETTINGS_FILE_NAME, find_settings, read_settings, are_not_given, NULL, NULL},
#endif
    {NULL, find_stored, read_stored, always, NULL, NULL},
};

static const FILE_KIND *kind_of(const char *name)
{
    const FILE_KIND *kind = kinds;

    while (kind->name != NULL && strcmp(kind->name, name) != 0)
        kind++;
    return kind;
}

/* Whether a client may write and delete files of this kind. */
static bool may_change(const FILE_KIND *kind)
{
    return kind->may_change != NULL && kind->may_change();
}

/* ---- what requests say ---- */

/* A name with or without NUL, of a file or of a folder. */
static RTS_RESULT read_path(const SRV_REQUEST *request, FILE_ENTRY *entry)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_FILE_NAME, 0, request->tags.size, &tag);

    if (result != ERR_OK)
        return result;
    memset(entry, 0, sizeof(*entry));
    RTS_UI32 length = CMUtlStrNLen((const char *)tag.data, tag.size);
    for (RTS_UI32 i = length; i < tag.size; i++)
        if (tag.data[i] != 0)
            return ERR_PARAMETER;
    if (length > FILE_NAME_MAX)
        return ERR_PARAMETER;
    memcpy(entry->name, tag.data, length);
    return ERR_OK;
}

/* ERR_PARAMETER if no file can have it. */
static RTS_RESULT read_name(const SRV_REQUEST *request, FILE_ENTRY *entry)
{
    RTS_RESULT result = read_path(request, entry);

    return result != ERR_OK || FileStoreIsName(entry->name) ? result : (RTS_RESULT)ERR_PARAMETER;
}

static RTS_RESULT find_source(const SRV_REQUEST *request, SOURCE *source)
{
    RTS_RESULT result = read_name(request, &source->entry);

    if (result != ERR_OK)
        return result;
    source->kind = kind_of(source->entry.name);
    return source->kind->find(&source->entry);
}

/* A name that may be written. */
static RTS_RESULT read_name_to_put(const SRV_REQUEST *request, FILE_ENTRY *entry)
{
    RTS_RESULT result = read_name(request, entry);
    const FILE_KIND *kind;

    if (result != ERR_OK)
        return result;
    kind = kind_of(entry->name);
    if (kind->may_put != NULL)
        return kind->may_put();
    return may_change(kind) ? (RTS_RESULT)ERR_OK : ERR_OPERATION_DENIED;
}

/* A malformed request is refused as a whole, all else in TAG_FILE_RESULT. */
static bool is_malformed(RTS_RESULT result)
{
    return result == ERR_L7_TAG_MISSING || result == ERR_SIZE_MISMATCH ||
           (result >= ERR_BTAG_TAGOVERLAP && result <= ERR_BTAG_ALIGNMENT);
}

static RTS_RESULT write_result(BTAG_WRITER *reply, RTS_RESULT result)
{
    if (is_malformed(result))
        return result;
    BTagWrite16(reply, TAG_FILE_RESULT, result);
    return ERR_OK;
}

static void write_content(BTAG_WRITER *reply, RTS_UI32 tag, const FILE_ENTRY *entry)
{
    FILE_CONTENT content;

    BytesPut32(content.crc, entry->crc);
    BytesPut32(content.size, entry->size);
    BTagWrite(reply, tag, BTAG_ALIGN_0, &content, sizeof(content));
}

/* ---- what there is ---- */

static RTS_RESULT get_info(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    SOURCE source;
    RTS_RESULT result = find_source(request, &source);

    if (result != ERR_OK)
        return write_result(reply, result);
    BTagOpen(reply, TAG_FILE_DESCRIPTION, BTAG_ALIGN_0);
    BTagWriteText(reply, TAG_FILE_NAME, source.entry.name, FILE_NAME_MAX);
    write_content(reply, TAG_FILE_CONTENT, &source.entry);
    BTagClose(reply);
    return ERR_OK;
}

/* Entry `index` of the list: first what the device makes itself. ERR_NO_OBJECT there is none of that index. */
static RTS_RESULT find_by_index(RTS_UI32 index, SOURCE *source)
{
    enum { MADE = RTS_COUNT(kinds) - 1 };

    memset(source, 0, sizeof(*source));
    source->kind = &kinds[index < MADE ? index : MADE];
    if (index < MADE) {
        memcpy(source->entry.name, source->kind->name, strlen(source->kind->name));
        RTS_RESULT result = source->kind->find(&source->entry);
        bool is_put = result == ERR_OK && may_change(source->kind); /* listed when it is */
        return is_put && source->entry.size == 0 ? ERR_NO_OBJECT : result;
    }
    const FILE_ENTRY *file = FileStoreGet(index - MADE);
    if (file == NULL || kind_of(file->name)->name != NULL) /* that was listed */
        return ERR_NO_OBJECT;
    source->entry = *file;
    return ERR_OK;
}

/* False when it does not fit. */
static bool write_entry(BTAG_WRITER *reply, const SOURCE *source)
{
    enum { NEEDED = 2 * FILE_NAME_MAX + 32 };

    if (BTagGetRoom(reply) < NEEDED)
        return false;
    BTagOpen(reply, TAG_FILE_ENTRY, BTAG_ALIGN_0);
    BTagWriteText(reply, TAG_FILE_ENTRY_NAME, source->entry.name, FILE_NAME_MAX);
    write_content(reply, TAG_FILE_ENTRY_CONTENT, &source->entry);
    BTagWrite32(reply, TAG_FILE_ENTRY_FIXED, !may_change(source->kind));
    BTagClose(reply);
    return true;
}

/* There is one folder. */
static bool is_the_folder(const BTAG *path)
{
    RTS_UI32 length = CMUtlStrNLen((const char *)path->data, path->size);

    return length == 0 || (length == 1 && (path->data[0] == '/' || path->data[0] == '.'));
}

static RTS_RESULT list(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    enum { MOST = FILE_STORE_FILES + RTS_COUNT(kinds) - 1 };
    BTAG path = {0, NULL, 0};
    SOURCE source;
    RTS_UI32 index = 0;
    RTS_RESULT result = BTagFind(&request->tags, TAG_FILE_PATH, 0, request->tags.size, &path);

    if (result == ERR_OK && !is_the_folder(&path))
        return write_result(reply, ERR_NO_OBJECT);
    if (result == ERR_OK || result == ERR_L7_TAG_MISSING)
        result = BTagFindOptional(&request->tags, TAG_FILE_START, &index);
    if (result != ERR_OK)
        return result;
    BTagWrite32(reply, TAG_FILE_ROOM, FileStoreRoom());
    RTS_UI32 next = BTagGetRoom(reply) < 16 ? MOST : index; /* room for the index, which comes first */
    BTAG_WRITER head = *reply;
    BTagWrite32(reply, TAG_FILE_START, 0);
    BTagOpen(reply, TAG_FILE_LIST, BTAG_ALIGN_0);
    for (; next < MOST; next++)
        if (find_by_index(next, &source) == ERR_OK && !write_entry(reply, &source))
            break;
    BTagClose(reply);
    BTagWrite32(&head, TAG_FILE_START, next < MOST ? next : 0);
    return ERR_OK;
}

/* ---- to the client ---- */

static READER *reader_of(const COMM_CLIENT *client)
{
    RTS_UI32 index = 0;

    while (ChannelGetClient(index) != client)
        index++;
    return &files.reader[index];
}

/* What a handle names, with bit 31 so that it is never 0. */
static RTS_UI32 new_handle(void)
{
    return SysTargetRandom() | 0x80000000u;
}

static void write_started(BTAG_WRITER *reply, const FILE_ENTRY *entry, RTS_UI32 handle)
{
    BTagOpen(reply, TAG_FILE_STARTED, BTAG_ALIGN_0);
    BTagWrite16(reply, TAG_FILE_RESULT, ERR_OK);
    BTagWriteText(reply, TAG_FILE_NAME, entry->name, FILE_NAME_MAX);
    write_content(reply, TAG_FILE_CONTENT, entry);
    BTagWrite32(reply, TAG_FILE_HANDLE, handle);
    BTagClose(reply);
}

static RTS_RESULT write_not_started(BTAG_WRITER *reply, RTS_RESULT result)
{
    if (is_malformed(result))
        return result;
    BTagOpen(reply, TAG_FILE_STARTED, BTAG_ALIGN_0);
    BTagWrite16(reply, TAG_FILE_RESULT, result);
    BTagClose(reply);
    return ERR_OK;
}

static RTS_RESULT start_upload(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    READER *reader = reader_of(request->client);
    RTS_RESULT result;

    reader->session = 0;
    result = find_source(request, &reader->source);
    if (result != ERR_OK)
        return write_not_started(reply, result);
    reader->session = request->client->session.id;
    reader->handle = new_handle();
    reader->position = 0;
    write_started(reply, &reader->source.entry, reader->handle);
    return ERR_OK;
}

static bool is_reading(const COMM_CLIENT *client, RTS_UI32 handle)
{
    const READER *reader = reader_of(client);

    return reader->session != 0 && reader->session == client->session.id && reader->handle == handle;
}

/* Clients of others always ask for offset 0, and mean the next part. */
static RTS_RESULT read_part(READER *reader, RTS_UI32 offset, BTAG_WRITER *reply, RTS_UI32 *count)
{
    enum { OVERHEAD = 32 }; /* heads of the elements, padding, count, result */
    const SOURCE *source = &reader->source;
    RTS_UI32 room = BTagGetRoom(reply);

    if (room <= OVERHEAD)
        return ERR_BUFFERSIZE;
    if (offset > source->entry.size)
        return ERR_OUT_OF_LIMITS;
    if (offset != 0)
        reader->position = offset;
    *count = source->entry.size - reader->position;
    if (*count > room - OVERHEAD)
        *count = room - OVERHEAD;
    if (*count == 0)
        return ERR_OK;
    BTAG_WRITER before = *reply;
    BTagOpen(reply, TAG_FILE_POSITION, BTAG_ALIGN_0);
    RTS_UI8 *data = BTagReserve(reply, *count);
    BTagPad(reply);
    BTagClose(reply);
    RTS_RESULT result = source->kind->read(&source->entry, reader->position, data, *count);
    if (result == ERR_OK)
        reader->position += *count;
    else
        *reply = before;
    return result;
}

static RTS_RESULT read_position(const SRV_REQUEST *request, FILE_POSITION *position, BTAG *tag)
{
    RTS_RESULT result = BTagFind(&request->tags, TAG_FILE_POSITION, sizeof(*position), request->tags.size, tag);

    if (result == ERR_OK)
        memcpy(position, tag->data, sizeof(*position));
    return result;
}

static RTS_RESULT upload(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    FILE_POSITION position;
    BTAG tag;
    RTS_UI32 count = 0;
    RTS_RESULT result = read_position(request, &position, &tag);

    if (result != ERR_OK)
        return result;
    if (is_reading(request->client, BytesGet32(position.handle)))
        result = read_part(reader_of(request->client), BytesGet32(position.offset), reply, &count);
    else
        result = ERR_INVALID_HANDLE;
    if (result != ERR_OK)
        return write_result(reply, result);
    BTagWrite32(reply, TAG_FILE_COUNT, count);
    return ERR_OK;
}

/* ---- to the device ---- */

static bool is_writing(const COMM_CLIENT *client)
{
    return files.writer == client && files.writer_session == client->session.id;
}

/* A file belongs to its session as long as that lasts. */
static bool is_anothers(const COMM_CLIENT *client)
{
    return files.writer != NULL && files.writer != client && files.writer->session.id == files.writer_session;
}

static RTS_RESULT begin(const COMM_CLIENT *client, const FILE_ENTRY *entry)
{
    if (is_anothers(client) || (files.writer == NULL && FileStoreIsWriting()))
        return ERR_INVALID_STATE;
    files.writer = NULL;
    RTS_RESULT result = FileStoreBegin(entry->name, entry->size, entry->crc);
    if (result != ERR_OK)
        return result;
    files.writer = client;
    files.writer_session = client->session.id;
    files.writer_handle = new_handle();
    files.writer_kind = kind_of(entry->name);
    return ERR_OK;
}

/* What a client has begun ends with its session. */
static void drop_orphan(void)
{
    if (files.writer == NULL || files.writer->session.id == files.writer_session)
        return;
    files.writer = NULL;
    FileStoreAbort();
}

static RTS_RESULT start_download(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    FILE_ENTRY entry;
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_FILE_CONTENT, sizeof(FILE_CONTENT), request->tags.size, &tag);

    if (result != ERR_OK)
        return result;
    result = read_name_to_put(request, &entry);
    if (result == ERR_OK) {
        const FILE_CONTENT *content = (const FILE_CONTENT *)tag.data;
        entry.crc = BytesGet32(content->crc);
        entry.size = BytesGet32(content->size);
        result = begin(request->client, &entry);
    }
    if (result != ERR_OK)
        return write_not_started(reply, result);
    write_started(reply, &entry, files.writer_handle);
    return ERR_OK;
}

/* What comes again after a lost reply is left out. */
static RTS_RESULT write_part(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 known;

    if (offset > FileStorePosition())
        return ERR_INVALID_SEQUENCE;
    known = FileStorePosition() - offset;
    return known >= size ? ERR_OK : FileStoreWrite(data + known, size - known);
}

static RTS_RESULT download(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    FILE_POSITION position;
    BTAG tag;
    RTS_RESULT result = read_position(request, &position, &tag);

    if (result != ERR_OK)
        return result;
    if (!is_writing(request->client) || BytesGet32(position.handle) != files.writer_handle)
        return write_result(reply, ERR_INVALID_HANDLE);
    result =
        write_part(BytesGet32(position.offset), tag.data + sizeof(position), tag.size - (RTS_UI32)sizeof(position));
    BytesPut32(position.offset, FileStorePosition());
    BTagWrite(reply, TAG_FILE_POSITION, BTAG_ALIGN_0, &position, sizeof(position));
    BTagWrite16(reply, TAG_FILE_RESULT, result);
    return ERR_OK;
}

/* A file that the device does not keep was in the store until now. */
static RTS_RESULT put_file(const FILE_KIND *kind)
{
    const FILE_ENTRY *stored = FileStoreFind(kind->name);
    FILE_ENTRY file;
    RTS_RESULT result;

    if (stored == NULL)
        return ERR_DEVICE;
    file = *stored;
    result = kind->put(&file);
    (void)FileStoreDelete(kind->name);
    return result;
}

static RTS_RESULT end_file(const COMM_CLIENT *client, RTS_UI32 handle, bool cancel)
{
    if (is_reading(client, handle)) {
        reader_of(client)->session = 0;
        return ERR_OK;
    }
    if (!is_writing(client) || handle != files.writer_handle)
        return ERR_INVALID_HANDLE;
    files.writer = NULL;
    if (!cancel) {
        RTS_RESULT result = FileStoreEnd();
        return result == ERR_OK && files.writer_kind->put != NULL ? put_file(files.writer_kind) : result;
    }
    FileStoreAbort();
    return ERR_OK;
}

static RTS_RESULT end_or_cancel(const SRV_REQUEST *request, BTAG_WRITER *reply, bool cancel)
{
    BTAG tag;
    RTS_RESULT result = BTagFind(&request->tags, TAG_FILE_END, sizeof(WIRE_UI32), request->tags.size, &tag);

    if (result != ERR_OK)
        return result;
    RTS_UI32 handle = BytesGet32(tag.data);
    result = end_file(request->client, handle, cancel);
    BTagWrite32(reply, TAG_FILE_END, handle);
    BTagWrite16(reply, TAG_FILE_RESULT, result);
    return ERR_OK;
}

static RTS_RESULT end(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return end_or_cancel(request, reply, false);
}

static RTS_RESULT cancel(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    return end_or_cancel(request, reply, true);
}

/* A folder has its name as the list shows it, with a `/` at the end. */
static RTS_RESULT delete_entry(char *name)
{
    RTS_SIZE length = strlen(name);

    if (length > 0 && name[length - 1] == '/') {
        name[length - 1] = '\0';
        return FileStoreDeleteFolder(name, false);
    }
    if (!FileStoreIsName(name))
        return ERR_PARAMETER;
    return may_change(kind_of(name)) ? FileStoreDelete(name) : (RTS_RESULT)ERR_OPERATION_DENIED;
}

static RTS_RESULT delete_file(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    FILE_ENTRY entry;
    RTS_RESULT result = read_path(request, &entry);

    return write_result(reply, result == ERR_OK ? delete_entry(entry.name) : result);
}

static const SRV_SERVICE services[] = {
    {SRV_FILE_INFO, RIGHT_VIEW, get_info},
    {SRV_FILE_DIRECTORY, RIGHT_VIEW, list},
    {SRV_FILE_START_UPLOAD, RIGHT_VIEW, start_upload},
    {SRV_FILE_UPLOAD, RIGHT_VIEW, upload},
    {SRV_FILE_START_DOWNLOAD, RIGHT_DOWNLOAD, start_download},
    {SRV_FILE_DOWNLOAD, RIGHT_DOWNLOAD, download},
    {SRV_FILE_END, RIGHT_VIEW, end},
    {SRV_FILE_CANCEL, RIGHT_VIEW, cancel},
    {SRV_FILE_DELETE, RIGHT_DOWNLOAD, delete_file},
};

/* Power failed before the device had taken such a file. */
static void drop_not_kept(void)
{
    for (const FILE_KIND *kind = kinds; kind->name != NULL; kind++)
        if (kind->put != NULL && FileStoreFind(kind->name) != NULL)
            (void)FileStoreDelete(kind->name);
}

RTS_RESULT CmpFileTransfer_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT) {
        memset(&files, 0, sizeof(files));
        FileStoreOpen();
        drop_not_kept();
    } else if (hook == CH_COMM_CYCLE) {
        drop_orphan();
    }
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_FILE_TRANSFER, services, RTS_COUNT(services)) : ERR_OK;
}

#endif
