/*
 * IoDrvBlank.c - a driver of inputs and outputs that does nothing: copy it for your hardware. Contract: IoDrv.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It has one device with 8 bytes of inputs (parameter 1) and 8 bytes of outputs (parameter 2).
 */
#include "IoDrvBlank.h"

#include <string.h>

#include "CmpIoMgrEmbedded.h"
#include "SysLock.h"

enum { BLANK_INPUTS = 1, BLANK_OUTPUTS = 2, BLANK_SIZE = 8 };

/* What was received, and what is to be sent. Written and read within SysLock. */
static struct {
    const IoConfigConnector *connector; /* NULL: the application has none of ours */
    RTS_UI8 inputs[BLANK_SIZE];
    RTS_UI8 outputs[BLANK_SIZE];
} blank;

static const ICmpIoDrv functions;
static IO_DRIVER blank_driver = {.functions = &functions};

/* Write here: the name that descriptions use (device.toml: driver), and who you are. */
static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvBlank", "Blank device", "Vendor", 0x00010000};

    return &info;
}

/* ---- an application is loaded ---- */

/* Write here: give back what the connector before had, then read parameters (IoMgrConfigGetParameter), and take the
 * hardware; when that is not possible, return IoMgrConfigRefuse with the reason. IoMgrConfigNoteData says that the
 * device is well: call it only when it is, and after each exchange. */
static RTS_RESULT take(const IoConfigConnector *connector)
{
    if (blank.connector != NULL)
        return IoMgrConfigRefuse(connector, ERR_DUPLICATE, "this board has one of them.");
    blank.connector = connector;
    IoMgrConfigNoteData(connector);
    return ERR_OK;
}

static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_RESULT result = ERR_OK;

    blank.connector = NULL;
    for (; count > 0 && result == ERR_OK; count--, connectors++) {
        if (IoMgrConfigIsMine(connectors, &blank_driver))
            result = take(connectors);
    }
    return result;
}

/* Write here: what parameters have channels, and how long each is. */
static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    RTS_UI32 parameter = type == IO_MAP_INPUTS ? BLANK_INPUTS : BLANK_OUTPUTS;

    if (channel->parameter == parameter && channel->parameter_bit + channel->bits <= 8 * BLANK_SIZE)
        return ERR_OK;
    return IoMgrConfigRefuse(connector, ERR_OUT_OF_LIMITS, "it has no bit %u of parameter %u.",
                             (unsigned)channel->parameter_bit, (unsigned)channel->parameter);
}

static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    return IoMgrConfigEachChannel(task_maps, count, &blank_driver, check_channel);
}

/* ---- cycles ---- */

/* Write here, before the lock: read registers that are fast enough (10 us). With a bus, that is what the bus cycle is
 * for, and here is only the copy of what came. */
static RTS_RESULT read_inputs(const IoConfigConnectorMap *maps, int count)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0; count--, maps++)
        IoMgrCopyInputs(IoMgrConfigGetChannelMaps(maps), maps->channel_map_count, blank.inputs);
    SysLockLeave(lock);
    return ERR_OK;
}

/* Write here, after the lock: write registers, or leave it to the bus cycle. */
static RTS_RESULT write_outputs(const IoConfigConnectorMap *maps, int count)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0; count--, maps++)
        IoMgrCopyOutputs(IoMgrConfigGetChannelMaps(maps), maps->channel_map_count, blank.outputs);
    SysLockLeave(lock);
    return ERR_OK;
}

/* Write here: begin the exchange with the device, and take what has come since the last time. When it came:
 * IoMgrConfigNoteData. When it was bad: IoMgrConfigNoteError; when the device is lost: IoMgrConfigSetDiagnosis with
 * CF_CONNECTOR_BUS_ERROR, and go on asking: it may come back. */
static RTS_RESULT start_bus_cycle(const IoConfigConnector *connector)
{
    IoMgrConfigNoteData(connector);
    return ERR_OK;
}

#if ONLINE_CHANGE
/* Write here: IoMgrConfigFollow for each pointer into the configuration that you keep. */
static void follow_configuration(const IoConfigTaskMap *task_maps, int count)
{
    RTS_UNUSED(task_maps);
    RTS_UNUSED(count);
    blank.connector = IoMgrConfigFollow(blank.connector);
}
#endif

static const ICmpIoDrv functions = {
    .IoDrvGetInfo = get_info,
    .IoDrvUpdateConfiguration = update_configuration,
    .IoDrvUpdateMapping = update_mapping,
    .IoDrvReadInputs = read_inputs,
    .IoDrvWriteOutputs = write_outputs,
    .IoDrvStartBusCycle = start_bus_cycle,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = follow_configuration,
#endif
};

/* Write here: what the hardware needs before any application, in CH_INIT2; what takes long, step by step, in
 * CH_COMM_CYCLE. */
RTS_RESULT IoDrvBlank_Hook(CMP_HOOK hook)
{
    switch (hook) {
    case CH_INIT:
        memset(&blank, 0, sizeof blank);
        break;
    case CH_INIT2:
        return IoMgrRegisterInstance(&blank_driver);
    case CH_EXIT2:
        return IoMgrUnregisterInstance(&blank_driver);
    default:
        break;
    }
    return ERR_OK;
}
