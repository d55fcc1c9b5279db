/*
 * CmpIoMgrSrv.h - the services of inputs and outputs (group 0x0B).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPIOMGRSRV_H
#define CMPIOMGRSRV_H

#include "CmpItf.h"

RTS_RESULT CmpIoMgrSrv_Hook(CMP_HOOK hook);

#endif
