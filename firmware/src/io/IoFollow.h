/*
 * IoFollow.h - an online change of the loaded I/O configuration, for the manager.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOFOLLOW_H
#define IOFOLLOW_H

#include "CmpIecAbi.h"
#include "IoConfig.h"
#include "rts_config.h"

#if ONLINE_CHANGE
/* True if drivers can go on with a checked configuration in place of the loaded one: connectors and parameters are the
 * same, and channels are at the same places. */
bool IoTablesCanFollow(const IO_CONFIG *config);

/* As IoTablesSet, for such a configuration; IoMgrConfigFollow leads to it from now on. */
void IoTablesFollow(const IO_CONFIG *config, const IEC_CONTEXT *context);
#endif

#endif
