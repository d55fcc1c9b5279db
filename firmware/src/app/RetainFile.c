/*
 * RetainFile.c - the retain variables as a file.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "RetainFile.h"

#include <string.h>

#include "../load/AppLoader.h"
#include "AppCommit.h"
#include "AppLife.h"
#include "AppState.h"
#include "CmpChecksum.h"
#include "CmpLog.h"
#include "CmpRetain.h"

#if FILE_STORE_FILES > 0

/* Little-endian, as all targets are. */
typedef struct {
    RTS_UI32 magic;
    RTS_UI32 tag;  /* of the records of its program */
    RTS_UI32 size; /* of the values */
    RTS_UI32 crc;  /* of the values */
} HEAD;

enum { MAGIC = 0x31544552 };

/* What the file is now; NULL: there is none. */
static const RTS_UI8 *find(HEAD *head)
{
    const RTS_UI8 *values;

    if (AppGetState() == AS_STOP)
        (void)RetainSave(false); /* what a tool has written since */
    values = RetainGetSaved(&head->size, &head->tag);
    if (values != NULL) {
        head->magic = MAGIC;
        head->crc = CRC32Update(0, values, head->size);
    }
    return values;
}

RTS_RESULT RetainFileFind(FILE_ENTRY *entry)
{
    HEAD head;
    const RTS_UI8 *values = find(&head);

    if (values == NULL)
        return ERR_NO_OBJECT;
    entry->start = RetainGetSequence();
    entry->size = (RTS_UI32)sizeof head + head.size;
    entry->crc = CRC32Update(CRC32Update(0, &head, sizeof head), values, head.size);
    return ERR_OK;
}

RTS_RESULT RetainFileRead(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size)
{
    HEAD head;
    const RTS_UI8 *values = find(&head);
    RTS_UI32 part = 0;

    if (values == NULL || entry->start != RetainGetSequence() || entry->size != sizeof head + head.size)
        return ERR_NO_CONSISTENCY;
    if (offset < sizeof head) {
        part = (RTS_UI32)sizeof head - offset < size ? (RTS_UI32)sizeof head - offset : size;
        memcpy(data, (const RTS_UI8 *)&head + offset, part);
        offset += part;
    }
    memcpy(data + part, values + offset - sizeof head, size - part);
    return ERR_OK;
}

RTS_RESULT RetainFileMayPut(void)
{
    HEAD head;

    if (AppGetState() == AS_RUN)
        return ERR_CALL_AGAIN;
    return find(&head) != NULL ? (RTS_RESULT)ERR_OK : ERR_APP_NOT_LOADED;
}

#if ONLINE_CHANGE
/* Finds the table of the program that the loaded one has replaced in an online change, if a file is of that. Not inlined:
 * an image and what checks it are large on the stack. */
static RTS_NOINLINE bool find_replaced(const HEAD *head, RETAIN_TABLE *table)
{
    RTS_UI32 other = AppCommitOtherSlot(AppGetSlot());
    const COMMIT_SLOT *slot = &AppCommitGet()->slot[other];
    APP_REFUSAL refusal;
    APP_IMAGE image;

    if (AppGetImage()->change.base != head->tag || AppCommitGet()->state[other] == SLOT_EMPTY ||
        slot->crc != head->tag || AppLoaderCheck(other, slot->size, slot->crc, &image, &refusal) != ERR_OK)
        return false;
    *table = image.kept;
    return head->size == table->area_size;
}

/* Variables that both programs have get the values of the file, the others stay as they are. */
static RTS_RESULT restore(bool valid, const RETAIN_TABLE *replaced)
{
    return valid && replaced->size != 0 ? RetainRestoreFrom(replaced) : RetainRestore(valid);
}
#else
#define find_replaced(head, table) false
#define restore(valid, replaced) RetainRestore(valid)
#endif

/* *replaced: the table of the program that saved the file; left as it is if that is the loaded one. */
static RTS_RESULT check(const FILE_ENTRY *file, const HEAD *own, HEAD *head, RETAIN_TABLE *replaced)
{
    RTS_UNUSED(replaced);
    if (file->size < sizeof *head || FileStoreRead(file, 0, head, sizeof *head) != ERR_OK || head->magic != MAGIC ||
        head->size != file->size - sizeof *head)
        return ERR_CRC_FAILED;
    return (head->tag == own->tag && head->size == own->size) || find_replaced(head, replaced) ? (RTS_RESULT)ERR_OK
                                                                                               : ERR_VERSION_MISMATCH;
}

RTS_RESULT RetainFilePut(const FILE_ENTRY *file)
{
    RTS_RESULT result = RetainFileMayPut();
    RETAIN_TABLE replaced = {0};
    RTS_UI8 *room;
    HEAD own;
    HEAD head;
    bool valid;

    if (result != ERR_OK)
        return result;
    (void)find(&own);
    result = check(file, &own, &head, &replaced);
    if (result != ERR_OK)
        return result;
    room = RetainGetRoom();
    valid = FileStoreRead(file, sizeof head, room, head.size) == ERR_OK && CRC32Update(0, room, head.size) == head.crc;
    result = restore(valid, &replaced);
    LogAdd(CMPID_CmpRetain, LOG_INFO, result, "Retain variables %s", valid ? "restored from a file" : "not restored");
    return valid ? result : (RTS_RESULT)ERR_CRC_FAILED;
}

#endif
