/*
 * CmpAppBPSrv.h - the services of breakpoints (group 0x12).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPAPPBPSRV_H
#define CMPAPPBPSRV_H

#include "CmpItf.h"

RTS_RESULT CmpAppBPSrv_Hook(CMP_HOOK hook);

#endif
