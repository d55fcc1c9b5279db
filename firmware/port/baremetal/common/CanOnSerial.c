/*
 * CanOnSerial.c - SysCan.h on a serial line (Slcan.h), for boards without a CAN controller.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The line is number CAN_SLCAN_LINE of SysCom.h, which no other driver may use: COM_MAX_LINES is not above it.
 */
#include "Slcan.h"
#include "SysCan.h"
#include "SysCom.h"
#include "SysTime.h"
#include "rts_config.h"

/* The line carries either frames of CAN or the protocol of plctool. */
RTS_STATIC_ASSERT(COM_MAX_LINES <= CAN_SLCAN_LINE, leave_CanOnSerial_c_out_or_set_COM_MAX_LINES_to_1);

static SLCAN slcan;
static bool is_open;

static RTS_UI32 read_line(RTS_UI8 *data, RTS_UI32 size)
{
    return SysComRead(CAN_SLCAN_LINE, data, size);
}

static RTS_UI32 write_line(const RTS_UI8 *data, RTS_UI32 size)
{
    return SysComWrite(CAN_SLCAN_LINE, data, size);
}

RTS_UI32 SysCanGetCount(void)
{
    return SysComGetCount() > CAN_SLCAN_LINE;
}

RTS_RESULT SysCanOpen(RTS_UI32 index, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    static const SLCAN_LINE line = {read_line, write_line};
    RTS_RESULT result = index < SysCanGetCount() ? SysComOpen(CAN_SLCAN_LINE) : ERR_DEVICE;

    if (result == ERR_OK)
        result = SlcanOpen(&slcan, line, bit_rate != 0 ? bit_rate : CAN_BIT_RATE, data_bit_rate);
    is_open = result == ERR_OK;
    return result;
}

void SysCanClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
    SysComClose(CAN_SLCAN_LINE);
    is_open = false;
}

bool SysCanIsFd(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return slcan.data_bit_rate != 0;
}

RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count)
{
    RTS_UNUSED(index);
    return SlcanSetFilters(&slcan, filters, count);
}

RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    return is_open ? SlcanSend(&slcan, frame) : ERR_DEVICE;
}

#if CAN_SHARED
static PF_CAN_URGENT urgent;

void SysCanSetUrgent(RTS_UI32 index, PF_CAN_URGENT handler)
{
    RTS_UNUSED(index);
    urgent = handler;
}

static RTS_RESULT receive(CAN_FRAME *frame)
{
    RTS_RESULT result;

    do {
        result = SlcanReceive(&slcan, frame);
    } while (result == ERR_OK && urgent != NULL && (frame->flags & CAN_FLAG_EXTENDED) == 0 && urgent(0, frame));
    return result;
}
#else
static RTS_RESULT receive(CAN_FRAME *frame)
{
    return SlcanReceive(&slcan, frame);
}
#endif

RTS_RESULT SysCanReceive(RTS_UI32 index, CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    RTS_RESULT result = is_open ? receive(frame) : ERR_NOTHING_TO_DO;
    if (result == ERR_OK)
        frame->time_us = 1000 * SysTimeGetMs();
    else if (is_open)
        SlcanAsk(&slcan, SysTimeGetMs());
    return result;
}

void SysCanGetState(RTS_UI32 index, CAN_STATE *state)
{
    RTS_UNUSED(index);
    SlcanGetState(&slcan, state);
    if (!is_open)
        state->bus = CAN_BUS_STOPPED;
}

void SysCanRestart(RTS_UI32 index)
{
    RTS_UNUSED(index);
    if (is_open)
        SlcanRestart(&slcan);
}
