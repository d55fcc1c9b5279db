/*
 * AcmeLock.h - a component of a vendor for attacks: it denies events.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef ACMELOCK_H
#define ACMELOCK_H

#include "CmpItf.h"

enum { CMPID_AcmeLock = 0x8007 };

RTS_RESULT AcmeLock_Hook(CMP_HOOK hook);

#endif
