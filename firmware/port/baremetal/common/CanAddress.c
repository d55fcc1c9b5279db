/*
 * CanAddress.c - number and base of a board's identifiers on CAN: its settings.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpSettingsEmbedded.h"
#include "CmpSrvNumbers.h"
#include "SysCan.h"

void SysCanGetAddress(RTS_UI32 index, CAN_ADDRESS *address)
{
    RTS_UNUSED(index);
    address->base = (RTS_UI32)SettgGetIntValue("CmpBlkDrvCan", "Base", CAN_ID_BASE);
    address->node = (RTS_UI32)SettgGetIntValue("CmpBlkDrvCan", "Node", CAN_NODE);
}
