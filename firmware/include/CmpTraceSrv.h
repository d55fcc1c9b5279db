/*
 * CmpTraceSrv.h - the services of traces (group 0x60).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPTRACESRV_H
#define CMPTRACESRV_H

#include "CmpItf.h"

RTS_RESULT CmpTraceSrv_Hook(CMP_HOOK hook);

#endif
