/*
 * AppAddress.c - finds addresses in the areas of the loaded application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppAddress.h"

#include <string.h>

#include "../cycle/AppImage.h"
#include "AppLife.h"
#include "AppState.h"
#include "CompactDownload.h"

RTS_UI32 AppGetAreaSize(RTS_UI32 index)
{
    return index < APP_AREA_COUNT ? AppGetImage()->area_size[index] : 0;
}

RTS_UI8 *AppGetAreaAddress(RTS_UI32 index, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI32 area_size = AppGetAreaSize(index);

    if (size > area_size || offset > area_size - size || index >= APP_AREA_COUNT || AppGetState() == AS_NONE)
        return NULL;
    return AppGetContext()->area[index] + offset;
}

bool AppFindArea(uintptr_t address, RTS_UI32 *index, RTS_UI32 *offset)
{
    for (*index = 0; *index < APP_AREA_COUNT; ++*index) {
        uintptr_t distance = address - (uintptr_t)AppGetContext()->area[*index];
        if (distance < AppGetImage()->area_size[*index]) {
            *offset = (RTS_UI32)distance;
            return true;
        }
    }
    return AppImageFind(address, index, offset);
}

MON_RESULT AppAddressResolve(const AREA_ADDRESS *address, RTS_UI32 size, RTS_UI8 **memory)
{
    if (size == 0)
        return MONITORING_ERR_SIZE_0;
    if (AppGetAreaSize(address->area) == 0)
        return MONITORING_ERR_INVALID_AREA;
    *memory = AppGetAreaAddress(address->area, address->offset, size);
    return *memory != NULL ? MONITORING_ERR_OK : MONITORING_ERR_INVALID_INDEX;
}

MON_RESULT AppAddressFollow(AREA_ADDRESS *address)
{
    RTS_UI8 *memory;
    uintptr_t pointer;
    MON_RESULT result = AppAddressResolve(address, APP_POINTER_SIZE, &memory);

    if (result != MONITORING_ERR_OK)
        return result;
    memcpy(&pointer, memory, sizeof(pointer));
    return AppFindArea(pointer, &address->area, &address->offset) ? MONITORING_ERR_OK : MONITORING_ERR_INVALID_POINTER;
}

MON_RESULT AppPlaceCheck(const APP_PLACE *place)
{
    RTS_UI32 size = place->size;

    if (size == 0 || size > sizeof(RTS_UI64) || (size & (size - 1)) != 0 ||
        (place->mask != PLACE_ALL_BITS && size != 1))
        return MONITORING_ERR_UNSUPPORTED_DATATYPE;
    return place->pointers <= PLACE_POINTERS ? MONITORING_ERR_OK : MONITORING_ERR_NESTING_DEPTH;
}

MON_RESULT AppPlaceFind(const APP_PLACE *place, AREA_ADDRESS *address, RTS_UI8 **at)
{
    MON_RESULT result = MONITORING_ERR_OK;
    RTS_UI32 i;

    address->area = place->area;
    address->offset = place->offset[0];
    for (i = 1; i <= place->pointers && result == MONITORING_ERR_OK; i++) {
        result = AppAddressFollow(address);
        address->offset += place->offset[i];
    }
    return result == MONITORING_ERR_OK ? AppAddressResolve(address, place->size, at) : result;
}

#if TRACE_BUFFER > 0 || BP_MAX > 0
bool AppNumberKey(RTS_UI64 value, RTS_UI32 size, RTS_UI32 kind, RTS_I64 *key)
{
    const RTS_UI32 top = 0x80000000u;
    RTS_UI32 low = (RTS_UI32)value;
    RTS_UI32 high = (RTS_UI32)(value >> 32) & ~top;

    *key = size == 1 ? (RTS_I8)low : size == 2 ? (RTS_I16)low : size == 4 ? (RTS_I32)low : (RTS_I64)value;
    if (kind == NUMBER_UNSIGNED)
        *key = (RTS_I64)(value ^ (RTS_UI64)top << 32);
    if (kind != NUMBER_REAL)
        return true;
    if (*key < 0) /* the bits of a REAL are sign and magnitude */
        *key = size == 8 ? -(RTS_I64)(value << 1 >> 1) : -(RTS_I64)(low & ~top);
    if (size == 4)
        return (low & ~top) <= 0x7F800000u;
    return high < 0x7FF00000u || (high == 0x7FF00000u && low == 0);
}
#endif
