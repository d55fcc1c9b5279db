/*
 * NodeName.h - the name of this node: that of its target, or the one that a tool has given it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The given one is the content of a file (FileStore.h), so it lasts. From main.
 */
#ifndef NODENAME_H
#define NODENAME_H

#include "CmpErrors.h"
#include "SysTarget.h"
#include "rts_config.h"

#define NODE_NAME_CAN_CHANGE (SRV_OTHER_CLIENTS && FILE_STORE_FILES > 0)
#define FILE_NAME_NODE "NodeName.txt"

#if NODE_NAME_CAN_CHANGE
/* Valid until the next call; NS_MAX_NODE_NAME characters at most if it was given. `target` is SysTargetGet. */
const char *NodeNameOf(const SYS_TARGET *target);

/* 1 to NS_MAX_NODE_NAME printable characters of ASCII, or "" for that of the target. ERR_PARAMETER: not a name;
 * ERR_INVALID_STATE: a client is writing a file; ERR_DISK_FULL; ERR_DEVICE. After an error the name is what it was. */
RTS_RESULT NodeNameSet(const char *name);
#else
static inline const char *NodeNameOf(const SYS_TARGET *target)
{
    return target->node_name;
}

static inline RTS_RESULT NodeNameSet(const char *name)
{
    RTS_UNUSED(name);
    return ERR_NOT_SUPPORTED;
}
#endif

#endif
