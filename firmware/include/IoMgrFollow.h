/*
 * IoMgrFollow.h - an online change: where drivers find what they keep of the I/O configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOMGRFOLLOW_H
#define IOMGRFOLLOW_H

#include "CmpStd.h"
#include "rts_config.h"

#if ONLINE_CHANGE
/* In IoDrvFollowConfiguration: returns where the connector, parameter, text or value now is that was at `place` before the
 * change. NULL, and a pointer to something else, is returned as it is. */
const void *IoMgrConfigFollow(const void *place);
#endif

#endif
