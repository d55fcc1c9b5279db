/*
 * CmpIoKeep.c - parameters of I/O devices that tools have written, kept over power-off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpIoKeep.h"

#if IO_KEEP_SIZE > 0

#include <string.h>

#include "CmpChecksum.h"
#include "CmpEventMgr.h"
#include "CmpIoMgrEmbedded.h"
#include "CmpLog.h"
#include "CmpSettings.h"
#include "CmpSettingsEmbedded.h"
#include "FileStore.h"
#include "IoMgrConfig.h"
#include "IoMgrRequests.h"
#include "SettingValues.h"
#include "SysTime.h"

enum {
    MAGIC = 0x31504F49,
    TRY_MS = 100,    /* between two tries */
    PATIENCE_S = 30, /* for devices that are not there yet */
    MAX_BITS = 8 * IO_KEEP_SIZE,
};

/* The file is MAGIC, and a record for each parameter then its data, in whole words. Little-endian, as all
 * targets are. */
typedef struct {
    RTS_UI32 device; /* CRC of what describes it */
    RTS_UI32 connector;
    RTS_UI32 id;
    RTS_UI32 bits;
    RTS_UI32 bit_offset;
    RTS_UI32 waits; /* 1: to be written to the device; in RAM only */
} RECORD;

static struct {
    RTS_UI32 size;   /* of the file */
    bool is_changed; /* since it was saved */
    bool waits;      /* records do */
    RTS_UI32 saved_ms;
    RTS_UI32 tried_ms;
    RTS_UI32 loaded_ms;
    union {
        RTS_UI32 magic;
        RTS_UI8 bytes[IO_KEEP_SIZE];
    } file;
} keep;

/* ---- records ---- */

static RTS_UI32 data_size(RTS_UI32 bits)
{
    return (bits + 31) / 32 * 4;
}

static RTS_UI32 length_of(const RECORD *record)
{
    return (RTS_UI32)sizeof(*record) + data_size(record->bits);
}

/* The record at an offset; NULL: none, or not a whole one. */
static RECORD *record_at(RTS_UI32 offset)
{
    RECORD *record = (RECORD *)(void *)(keep.file.bytes + offset);

    if (offset > keep.size || keep.size - offset < sizeof(*record) || record->bits > MAX_BITS)
        return NULL;
    return length_of(record) <= keep.size - offset ? record : NULL;
}

#define FOR_EACH_RECORD(record, at) \
    for (RTS_UI32 at = sizeof(RTS_UI32); (record = record_at(at)) != NULL; at += length_of(record))

static RTS_UI32 crc_of_text(RTS_UI32 crc, const char *text)
{
    return CRC32Update(crc, text, (RTS_UI32)strlen(text) + 1);
}

static RTS_UI32 device_of(const IoConfigConnector *connector)
{
    RTS_UI32 parameters = IoMgrConfigGetCrc(connector);
    RTS_UI32 crc = CRC32Update(0, &parameters, sizeof(parameters));

    return crc_of_text(crc_of_text(crc, IoMgrConfigGetName(connector)), IoMgrConfigGetDriverName(connector));
}

static bool is_of_loaded(const RECORD *record)
{
    const IoConfigConnector *connector = IoMgrConfigGetConnector(record->connector);

    return connector != NULL && record->bits != 0 && device_of(connector) == record->device;
}

/* Drops the records that are not of the loaded configuration. */
static void drop_others(void)
{
    RTS_UI32 at = sizeof(RTS_UI32);
    RECORD *record;

    while ((record = record_at(at)) != NULL) {
        RTS_UI32 length = length_of(record);
        if (is_of_loaded(record)) {
            at += length;
        } else {
            keep.size -= length;
            memmove(record, (RTS_UI8 *)record + length, keep.size - at);
        }
    }
}

/* ---- noting ---- */

static bool is_on(void)
{
    return SETTING(IoStoreChanged) != 0;
}

static void forget(void)
{
    keep.file.magic = MAGIC;
    keep.size = sizeof(RTS_UI32);
    keep.waits = false;
}

static RECORD *find(const RECORD *wanted)
{
    RECORD *record;

    FOR_EACH_RECORD(record, at)
    {
        if (record->device == wanted->device && record->connector == wanted->connector && record->id == wanted->id &&
            record->bits == wanted->bits && record->bit_offset == wanted->bit_offset)
            return record;
    }
    return NULL;
}

static RECORD *append(const RECORD *added)
{
    RECORD *record = (RECORD *)(void *)(keep.file.bytes + keep.size);

    if (added->bits > MAX_BITS || length_of(added) > IO_KEEP_SIZE - keep.size)
        return NULL;
    keep.size += length_of(added);
    *record = *added;
    memset(record + 1, 0, data_size(added->bits));
    return record;
}

void IoKeepNote(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    const IoConfigConnector *place = IoMgrConfigGetConnector(connector);
    RECORD *record;

    if (!is_on() || place == NULL)
        return;
    if (!keep.is_changed && FileStoreFind(IO_KEEP_FILE) == NULL)
        forget(); /* a user has deleted the file */
    const RECORD wanted = {device_of(place), connector, id, bits, bit_offset, 0};
    record = find(&wanted);
    if (record == NULL)
        record = append(&wanted);
    if (record == NULL) {
        drop_others();
        record = append(&wanted);
    }
    if (record == NULL) {
        LogAdd(CMPID_CmpIoKeep, LOG_WARNING, ERR_NOBUFFER, "Parameter %u of %s is not kept: too many are", (unsigned)id,
               IoMgrConfigGetName(place));
        return;
    }
    record->waits = 0;
    memcpy(record + 1, data, (bits + 7) / 8);
    keep.is_changed = true;
}

/* ---- the file ---- */

static RTS_RESULT write_file(void)
{
    RTS_RESULT result = FileStoreBegin(IO_KEEP_FILE, keep.size, CRC32Update(0, keep.file.bytes, keep.size));

    if (result == ERR_OK)
        result = FileStoreWrite(keep.file.bytes, keep.size);
    return result == ERR_OK ? FileStoreEnd() : result;
}

/* While a client writes a file it waits. A failure is logged once, and tried again when a parameter changes. */
static void save(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (!keep.is_changed || FileStoreIsWriting() || now_ms - keep.saved_ms < IO_KEEP_SAVE_MS)
        return;
    RTS_RESULT result = write_file();
    if (result != ERR_OK)
        LogAdd(CMPID_CmpIoKeep, LOG_ERROR, result, "Parameters of I/O devices not saved");
    keep.is_changed = false;
    keep.saved_ms = now_ms;
}

static bool read_file(void)
{
    const FILE_ENTRY *file = FileStoreFind(IO_KEEP_FILE);

    if (file == NULL || file->size > IO_KEEP_SIZE || file->size < sizeof(RTS_UI32))
        return file == NULL;
    const FILE_ENTRY copy = *file;
    if (FileStoreRead(&copy, 0, keep.file.bytes, copy.size) != ERR_OK || keep.file.magic != MAGIC)
        return false;
    keep.size = copy.size;
    return true;
}

/* ---- writing to the devices ---- */

static bool may_come_later(RTS_RESULT result)
{
    return result != ERR_OK && result != ERR_NO_OBJECT && result != ERR_OUT_OF_LIMITS && result != ERR_NOT_SUPPORTED &&
           result != ERR_PARAMETER && SysTimeGetMs() - keep.loaded_ms < PATIENCE_S * 1000u;
}

static void restore(RECORD *record)
{
    RTS_RESULT result =
        IoMgrWriteParameter(record->connector, record->id, record + 1, record->bits, record->bit_offset);

    if (may_come_later(result)) {
        keep.waits = true;
        return;
    }
    record->waits = 0;
    if (result != ERR_OK)
        LogAdd(CMPID_CmpIoKeep, LOG_WARNING, result, "Parameter %u of %s is not as it was saved", (unsigned)record->id,
               IoMgrConfigGetName(IoMgrConfigGetConnector(record->connector)));
}

static void restore_waiting(void)
{
    RECORD *record;

    keep.tried_ms = SysTimeGetMs();
    keep.waits = false;
    FOR_EACH_RECORD(record, at)
    {
        if (record->waits != 0)
            restore(record);
    }
}

/* Lets the records of the loaded configuration wait. Drops the end of a damaged file. */
static void check_records(void)
{
    RTS_UI32 end = sizeof(RTS_UI32);
    RTS_UI32 others = 0;
    RECORD *record;

    FOR_EACH_RECORD(record, at)
    {
        record->waits = is_of_loaded(record) ? 1 : 0;
        others += 1 - record->waits;
        end = at + length_of(record);
    }
    keep.size = end;
    if (others > 0)
        LogAdd(CMPID_CmpIoKeep, LOG_INFO, ERR_OK,
               "%u saved parameters are of devices that are described otherwise now: not used", (unsigned)others);
}

static void take_configuration(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    if (!is_on() || IoMgrConfigGetConnector(0) == NULL)
        return;
    if (!keep.is_changed) {
        forget();
        if (!read_file()) {
            forget();
            LogAdd(CMPID_CmpIoKeep, LOG_WARNING, ERR_CRC_FAILED, "%s is not a file of saved parameters: not used",
                   IO_KEEP_FILE);
        }
    }
    keep.loaded_ms = SysTimeGetMs();
    check_records();
    restore_waiting();
}

static void look_after(void)
{
    if (keep.waits && IoMgrConfigGetConnector(0) != NULL && SysTimeGetMs() - keep.tried_ms >= TRY_MS)
        restore_waiting();
    save();
    if (keep.waits || keep.is_changed)
        SysTimeWantPass(TRY_MS);
}

RTS_RESULT CmpIoKeep_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT) {
        CMP_CLEAR(keep);
        forget();
        keep.saved_ms = SysTimeGetMs() - IO_KEEP_SAVE_MS;
    } else if (hook == CH_INIT3) {
        return EventRegisterCallback(CMPID_CmpIoMgrEmbedded, EVT_DoneUpdateConfiguration, take_configuration, NULL);
    } else if (hook == CH_COMM_CYCLE) {
        look_after();
    } else if (hook == CH_EXIT3) {
        keep.saved_ms = SysTimeGetMs() - IO_KEEP_SAVE_MS;
        save();
    }
    return ERR_OK;
}

#endif
