/*
 * SimFiles.c - the files of the simulated device, for its host.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Sim.h"

#include <string.h>

#include "CmpChecksum.h"
#include "FileStore.h"
#include "rts_config.h"

RTS_RESULT SimPutFile(const char *name, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_RESULT result;

    if (FileStoreIsWriting())
        return ERR_INVALID_STATE;
    result = FileStoreBegin(name, size, CRC32Update(0, data, size));
    if (result == ERR_OK)
        result = FileStoreWrite(data, size);
    return result == ERR_OK ? FileStoreEnd() : result;
}

RTS_RESULT SimGetFile(RTS_UI32 index, char name[36], RTS_UI32 *size)
{
    const FILE_ENTRY *entry = FileStoreGet(index);

    if (index >= FILE_STORE_FILES)
        return ERR_OUT_OF_LIMITS;
    memset(name, 0, sizeof entry->name);
    *size = 0;
    if (entry == NULL)
        return ERR_OK;
    memcpy(name, entry->name, sizeof entry->name);
    *size = entry->size;
    return ERR_OK;
}

RTS_RESULT SimReadFile(const char *name, RTS_UI8 *data, RTS_UI32 size)
{
    const FILE_ENTRY *entry = FileStoreFind(name);

    if (entry == NULL)
        return ERR_NO_OBJECT;
    return entry->size == size ? FileStoreRead(entry, 0, data, size) : (RTS_RESULT)ERR_SIZE_MISMATCH;
}
