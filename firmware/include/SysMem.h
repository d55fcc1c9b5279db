/*
 * SysMem.h - memory that a port keeps apart from all else.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SYSMEM_H
#define SYSMEM_H

#include "CmpStd.h"

/*
 * The memory of the areas of the application, for ports that set APP_AREAS_FROM_PORT: `size` bytes, aligned to 16, with
 * guards before and after them, so that a program that writes beyond them meets an exception and no data of the
 * runtime. The same at each call of the process, with what it holds. NULL: there is no memory. From main, at CH_INIT.
 */
void *SysMemAllocArea(size_t size);

#endif
