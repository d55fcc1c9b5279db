/*
 * NodeName.c - the name that a tool gives this node.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "NodeName.h"

#include <string.h>

#include "CmpChecksum.h"
#include "CmpSrvNumbers.h"
#include "FileStore.h"

#if NODE_NAME_CAN_CHANGE

/* Characters up to the first that no name has. */
static RTS_UI32 length_of(const char *name, RTS_UI32 size)
{
    RTS_UI32 length = 0;

    while (length < size && name[length] >= ' ' && name[length] <= '~')
        length++;
    return length;
}

/* It is read each time: the file may be written or deleted like any other. */
const char *NodeNameOf(const SYS_TARGET *target)
{
    static char name[NS_MAX_NODE_NAME + 1];
    const FILE_ENTRY *file = FileStoreFind(FILE_NAME_NODE);
    RTS_UI32 size = file == NULL ? 0 : file->size;

    if (size > NS_MAX_NODE_NAME)
        size = NS_MAX_NODE_NAME;
    if (size == 0 || FileStoreRead(file, 0, name, size) != ERR_OK)
        return target->node_name;
    name[length_of(name, size)] = '\0';
    return name[0] != '\0' ? name : target->node_name;
}

static RTS_RESULT write_name(const char *name, RTS_UI32 size)
{
    RTS_RESULT result = FileStoreBegin(FILE_NAME_NODE, size, CRC32Update(0, name, size));

    if (result == ERR_OK)
        result = FileStoreWrite((const RTS_UI8 *)name, size);
    return result == ERR_OK ? FileStoreEnd() : result;
}

RTS_RESULT NodeNameSet(const char *name)
{
    RTS_SIZE length = strlen(name);

    if (length > NS_MAX_NODE_NAME || length_of(name, (RTS_UI32)length) != length)
        return ERR_PARAMETER;
    if (FileStoreIsWriting())
        return ERR_INVALID_STATE;
    if (length != 0)
        return write_name(name, (RTS_UI32)length);
    return FileStoreFind(FILE_NAME_NODE) == NULL ? (RTS_RESULT)ERR_OK : FileStoreDelete(FILE_NAME_NODE);
}

#endif
