/*
 * SysSram.h - RAM that keeps its content while the power is off: battery, backup domain, FRAM that is memory.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Of a port with APP_RETAIN_SRAM. It is written like RAM, at any time, and not initialised at a start.
 */
#ifndef SYSSRAM_H
#define SYSSRAM_H

#include "CmpStd.h"

/* Where it is, aligned to 8 bytes, and how many bytes; 0: the device has none. From main. */
RTS_UI8 *SysSramGet(RTS_UI32 *size);

#endif
