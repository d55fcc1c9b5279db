/*
 * AppAddress.h - finds addresses in the areas of the loaded application (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main, and from the phases of a cycle (CyclePhases.h).
 */
#ifndef APPADDRESS_H
#define APPADDRESS_H

#include "CmpErrors.h"
#include "CmpStd.h"

/*
 * Checks that [offset, offset + size) lies in area `index` of the loaded application and returns its address, NULL
 * otherwise. The only way anybody turns an area reference from outside into a pointer. APP_AREA_CODE may only be read.
 */
RTS_UI8 *AppGetAreaAddress(RTS_UI32 index, RTS_UI32 offset, RTS_UI32 size);
RTS_UI32 AppGetAreaSize(RTS_UI32 index); /* bytes, as the image asked for */
/* Finds what a pointer of the application leads to; false when that is in no area, as with NULL and temporary
 * variables. */
bool AppFindArea(uintptr_t address, RTS_UI32 *index, RTS_UI32 *offset);

#endif
