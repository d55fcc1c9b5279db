/*
 * test_can_on_serial.c - CanOnSerial: the address that the settings of a board give.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpSettingsEmbedded.h"
#include "CmpSrvNumbers.h"
#include "SysCan.h"
#include "SysCom.h"
#include "SysTime.h"
#include "test.h"

static RTS_I32 node_setting;

RTS_I32 SettgGetIntValue(const char *component, const char *key, RTS_I32 otherwise)
{
    CHECK(strcmp(component, "CmpBlkDrvCan") == 0);
    return strcmp(key, "Node") == 0 ? node_setting : otherwise;
}

RTS_UI32 SysComGetCount(void)
{
    return 2;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    return index == CAN_SLCAN_LINE ? ERR_OK : ERR_DEVICE;
}

void SysComClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UNUSED(index);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return 0;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UNUSED(index);
    RTS_UNUSED(data);
    return size;
}

RTS_UI32 SysTimeGetMs(void)
{
    return 0;
}

/* 257 is not 1: the driver refuses it (test_comm_can.c). */
static void a_node_is_what_the_settings_say(void)
{
    static const RTS_I32 settings[] = {1, 127, 128, 257, -1};

    for (RTS_UI32 i = 0; i < RTS_COUNT(settings); i++) {
        CAN_ADDRESS address;
        node_setting = settings[i];
        SysCanGetAddress(0, &address);
        CHECK_EQUAL(address.node, (RTS_UI32)settings[i]);
        CHECK_EQUAL(address.base, CAN_ID_BASE);
    }
}

static void it_opens_a_line_of_its_own(void)
{
    CAN_STATE state;

    CHECK_EQUAL(SysCanGetCount(), 1);
    CHECK_EQUAL(SysCanOpen(0, 0, 0), ERR_OK);
    SysCanGetState(0, &state);
    CHECK(state.bus == CAN_BUS_ACTIVE && state.bit_rate == CAN_BIT_RATE);
    SysCanClose(0);
    SysCanGetState(0, &state);
    CHECK_EQUAL(state.bus, CAN_BUS_STOPPED);
}

int main(void)
{
    RUN(a_node_is_what_the_settings_say);
    RUN(it_opens_a_line_of_its_own);
    return test_result();
}
