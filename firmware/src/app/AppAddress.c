/*
 * AppAddress.c - finds addresses in the areas of the loaded application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppAddress.h"

#include "AppImage.h"
#include "AppLife.h"
#include "AppState.h"

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
