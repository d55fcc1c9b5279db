/*
 * IoDrvGpio.c - driver of the board's own digital inputs and outputs.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A connector is a group of lines (SysGpio.h). A group whose lines stay the same over a download stays open, whatever its
 * place among the connectors, so that outputs that hold their value do so.
 *
 * Lines that are lost are looked for in a pass of main, in which tasks may use other groups: it takes long where all
 * chips are asked. IoDrvGetModuleDiagnosis, which has the driver for itself, only opens what was found.
 */
#include "IoDrvGpio.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpIoMgrEmbedded.h"
#include "SchedEvents.h"
#include "SysAtomic.h"
#include "SysGpio.h"
#include "SysLock.h"
#include "rts_config.h"

RTS_STATIC_ASSERT((int)IO_GPIO_LINES == 32, a_value_has_a_bit_for_each_line);
RTS_STATIC_ASSERT(SCHED_MAX_EXTERNAL_EVENTS <= 32, events_have_a_bit_each);

typedef enum { NOT_ADDED, TO_BE_ADDED, ADDED } LINES_STATE;

typedef struct {
    RTS_UI16 user;       /* index of its connector + 1; 0: the group is not in use now */
    RTS_UI8 state;       /* LINES_STATE of its lines in SysGpio.h; of main alone */
    RTS_UI32 outputs;    /* lines that are some */
    RTS_UI8 in[4];       /* as they were read */
    RTS_UI8 out[4];      /* to be written */
    RTS_UI32 lines;      /* CRC of what they are; 0: closed, and no task uses it */
    RTS_UI32 events;     /* handles of those that are registered for it, a bit each */
    RTS_UI32 has_failed; /* since it was opened; tasks and main say so */
} GROUP;

static GROUP groups[IO_GPIO_GROUPS];

static const ICmpIoDrv functions;
static IO_DRIVER gpio_driver = {.functions = &functions};

static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvGpio", "Lines of the board", "Open PLC runtime", 0x00010000};

    return &info;
}

/* ---- configuration ---- */

static RTS_UI32 user_of(const IoConfigConnector *connector)
{
    return IoMgrConfigGetIndex(connector) + 1;
}

static const IoConfigConnector *connector_of(const GROUP *group)
{
    return IoMgrConfigGetConnector(group->user - 1);
}

static void close_group(GROUP *group)
{
    RTS_HANDLE event;

    if (group->state == ADDED)
        SysGpioClose((RTS_UI32)(group - groups));
    for (event = 0; group->events != 0; event++, group->events >>= 1) {
        if ((group->events & 1) != 0)
            (void)SchedUnregisterExternalEvent(event);
    }
    group->state = NOT_ADDED;
    group->lines = 0;
    group->outputs = 0;
}

static const char *get_text(const IoConfigConnector *connector, RTS_UI32 id)
{
    return IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, id));
}

static RTS_UI32 get_options(const IoConfigConnector *connector, RTS_UI32 number)
{
    return IoMgrConfigGetParameterValueDword(IoMgrConfigGetParameter(connector, GPIO_OPTIONS + number), NULL);
}

/* What tells one set of lines from another. */
static RTS_UI32 crc_of_lines(const IoConfigConnector *connector)
{
    return IoMgrConfigGetCrc(connector) | 1;
}

static RTS_RESULT register_event(GROUP *group, const char *name, RTS_HANDLE *event)
{
    RTS_RESULT result = ERR_OK;

    *event = RTS_INVALID_HANDLE;
    if (name == NULL)
        return ERR_OK;
    *event = SchedRegisterExternalEvent(name, &result);
    if (result == ERR_OK)
        group->events |= 1u << *event;
    return result;
}

/* Why a line is refused; %s is the line, or its event. */
static const char *reason_of(RTS_RESULT result)
{
    switch (result) {
    case ERR_NO_OBJECT:
        return "this device has no line %s.";
    case ERR_OPERATION_DENIED:
        return "line %s is in use by something else.";
    case ERR_NOT_SUPPORTED:
        return "line %s cannot do what its options ask for.";
    case ERR_DUPLICATE:
        return "there is an event %s already.";
    default:
        return "line %s cannot be opened.";
    }
}

/* *bad: the line or event that is refused. */
static RTS_RESULT add_line(GROUP *group, RTS_UI32 number, const char **bad)
{
    const IoConfigConnector *connector = connector_of(group);
    const char *event = get_text(connector, GPIO_EVENT + number);
    SYS_GPIO_LINE line = {get_text(connector, GPIO_LINE + number), get_options(connector, number), 0};
    RTS_RESULT result;

    if (line.name == NULL)
        return ERR_OK;
    *bad = event;
    result = register_event(group, event, &line.event);
    if (result != ERR_OK)
        return result;
    *bad = line.name;
    if (line.event == RTS_INVALID_HANDLE)
        line.options &= ~(RTS_UI32)(GPIO_OPTION_RISING | GPIO_OPTION_FALLING);
    if ((line.options & GPIO_OPTION_OUT) != 0)
        group->outputs |= 1u << number;
    return SysGpioAdd((RTS_UI32)(group - groups), number, &line);
}

static RTS_RESULT add_lines(GROUP *group, const char **bad)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 n;

    group->state = ADDED;
    for (n = 0; n < IO_GPIO_LINES && result == ERR_OK; n++)
        result = add_line(group, n, bad);
    if (result != ERR_OK)
        close_group(group);
    return result;
}

/* With the lines that were added. */
static RTS_RESULT open_group(GROUP *group)
{
    const IoConfigConnector *connector = connector_of(group);
    RTS_RESULT result = SysGpioOpen((RTS_UI32)(group - groups), BytesGet32(group->out));

    if (result != ERR_OK) {
        close_group(group);
        return result;
    }
    group->lines = crc_of_lines(connector);
    SysAtomicStore(&group->has_failed, 0);
    IoMgrConfigNoteAlive(connector);
    return ERR_OK;
}

/* The group of a user; of 0, one that is free. NULL: there is none. */
static GROUP *find_group(RTS_UI32 user)
{
    GROUP *group = groups;

    while (group < groups + IO_GPIO_GROUPS && group->user != user)
        group++;
    return group < groups + IO_GPIO_GROUPS ? group : NULL;
}

/* A group that has the lines of a connector already becomes that of the connector. */
static RTS_RESULT keep_group(const IoConfigConnector *connector)
{
    RTS_UI32 lines = crc_of_lines(connector);
    RTS_UI32 i = 0;

    while (i < IO_GPIO_GROUPS && (groups[i].user != 0 || groups[i].lines != lines))
        i++;
    if (i < IO_GPIO_GROUPS) {
        groups[i].user = (RTS_UI16)user_of(connector);
        IoMgrConfigNoteAlive(connector);
    }
    return ERR_OK;
}

static RTS_RESULT take_group(const IoConfigConnector *connector)
{
    GROUP *group = find_group(0);
    const char *bad = "";
    RTS_RESULT result;

    if (find_group(user_of(connector)) != NULL)
        return ERR_OK;
    if (group == NULL)
        return IoMgrConfigRefuse(connector, ERR_NOMEMORY, "this device can have %u groups of lines.",
                                 (unsigned)IO_GPIO_GROUPS);
    memset(group->out, 0, sizeof group->out);
    group->user = (RTS_UI16)user_of(connector);
    result = add_lines(group, &bad);
    if (result == ERR_OK)
        result = open_group(group);
    if (result == ERR_OK)
        return ERR_OK;
    group->user = 0;
    return IoMgrConfigRefuse(connector, result, reason_of(result), bad);
}

/* Groups that the previous application had and this one has not, or that are refused. */
static void close_unused(void)
{
    RTS_UI32 i;

    for (i = 0; i < IO_GPIO_GROUPS; i++) {
        if (groups[i].user == 0)
            close_group(&groups[i]);
    }
}

static RTS_RESULT each_of_mine(const IoConfigConnector *connectors, int count,
                               RTS_RESULT (*visit)(const IoConfigConnector *connector))
{
    RTS_RESULT result = ERR_OK;

    for (; count > 0 && result == ERR_OK; count--, connectors++) {
        if (IoMgrConfigIsMine(connectors, &gpio_driver))
            result = visit(connectors);
    }
    return result;
}

/* What is not needed any more is given back before anything is taken: a line may have gone to another group. Without an
 * application (count 0) that is left to main: the next one, of the same download, may keep its lines. */
static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_UI32 i;

    for (i = 0; i < IO_GPIO_GROUPS; i++)
        groups[i].user = 0;
    if (count == 0)
        return ERR_OK;
    (void)each_of_mine(connectors, count, keep_group);
    close_unused();
    return each_of_mine(connectors, count, take_group);
}

static bool is_channel(const IoConfigChannelMap *channel, RTS_UI32 type)
{
    return channel->parameter == (type == IO_MAP_INPUTS ? GPIO_INPUTS : GPIO_OUTPUTS) &&
           channel->bits <= IO_GPIO_LINES && channel->parameter_bit <= (RTS_UI32)IO_GPIO_LINES - channel->bits;
}

static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    if (is_channel(channel, type))
        return ERR_OK;
    return IoMgrConfigRefuse(connector, ERR_OUT_OF_LIMITS, "it has no channel %u.%u.", (unsigned)channel->parameter,
                             (unsigned)channel->parameter_bit);
}

/* Connectors that are refused here, and optional, have no driver any more: their lines are given back here. */
static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    RTS_RESULT result = IoMgrConfigEachChannel(task_maps, count, &gpio_driver, check_channel);
    RTS_UI32 i;

    for (i = 0; i < IO_GPIO_GROUPS; i++) {
        if (groups[i].user != 0 && !IoMgrConfigIsMine(connector_of(&groups[i]), &gpio_driver))
            groups[i].user = 0;
    }
    return result;
}

/* ---- cycles ---- */

/* Its number. A connector that has channels has a group, open or not. */
static RTS_UI32 group_of(const IoConfigConnectorMap *map)
{
    RTS_UI32 number = 0;

    while (groups[number].user != map->connector + 1u)
        number++;
    return number;
}

static void note_failure(GROUP *group)
{
    SysAtomicStore(&group->has_failed, 1);
    IoMgrConfigSetDiagnosis(connector_of(group), CF_CONNECTOR_ERROR);
}

static RTS_RESULT read_inputs(const IoConfigConnectorMap *maps, int count)
{
    for (; count > 0; count--, maps++) {
        RTS_UI32 number = group_of(maps);
        GROUP *group = &groups[number];
        RTS_UI32 values;
        RTS_UI32 lock;
        RTS_RESULT result = group->lines != 0 ? SysGpioRead(number, &values) : (RTS_RESULT)ERR_DEVICE;

        if (result != ERR_OK) {
            note_failure(group);
            continue;
        }
        BytesPut32(group->in, values);
        lock = SysLockEnter();
        IoMgrCopyInputs(IoMgrConfigGetChannelMaps(maps), maps->channel_map_count, group->in);
        SysLockLeave(lock);
    }
    return ERR_OK;
}

static RTS_RESULT write_outputs(const IoConfigConnectorMap *maps, int count)
{
    for (; count > 0; count--, maps++) {
        RTS_UI32 number = group_of(maps);
        GROUP *group = &groups[number];
        RTS_UI32 lock = SysLockEnter();
        RTS_RESULT result;

        IoMgrCopyOutputs(IoMgrConfigGetChannelMaps(maps), maps->channel_map_count, group->out);
        SysLockLeave(lock);
        result =
            group->lines != 0 ? SysGpioWrite(number, group->outputs, BytesGet32(group->out)) : (RTS_RESULT)ERR_DEVICE;
        if (result != ERR_OK)
            note_failure(group);
    }
    return ERR_OK;
}

/* A chip that has gone (USB) is opened again when it is back, outputs with what they should be. */
static RTS_RESULT diagnose(const IoConfigConnector *connector)
{
    GROUP *group = find_group(user_of(connector));

    if (group == NULL || SysAtomicLoad(&group->has_failed) == 0)
        return ERR_OK;
    if (group->lines != 0)
        close_group(group);
    if (group->state == ADDED)
        return open_group(group);
    group->state = TO_BE_ADDED;
    return ERR_DEVICE;
}

/* Edges, and chips that have gone: without edges there may be no task that would notice. */
static void poll_group(GROUP *group)
{
    const char *bad;

    if (group->lines != 0 && SysGpioPoll((RTS_UI32)(group - groups)) != ERR_OK &&
        SysAtomicLoad(&group->has_failed) == 0)
        note_failure(group);
    if (group->state == TO_BE_ADDED)
        (void)add_lines(group, &bad);
}

static void poll_groups(void)
{
    RTS_UI32 i;

    for (i = 0; i < IO_GPIO_GROUPS; i++) {
        if (groups[i].user != 0)
            poll_group(&groups[i]);
    }
}

#if ONLINE_CHANGE
/* Groups know their connectors by number. */
static void follow_configuration(const IoConfigTaskMap *task_maps, int count)
{
    RTS_UNUSED(task_maps);
    RTS_UNUSED(count);
}
#endif

static const ICmpIoDrv functions = {
    .IoDrvGetInfo = get_info,
    .IoDrvUpdateConfiguration = update_configuration,
    .IoDrvUpdateMapping = update_mapping,
    .IoDrvReadInputs = read_inputs,
    .IoDrvWriteOutputs = write_outputs,
    .IoDrvGetModuleDiagnosis = diagnose,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = follow_configuration,
#endif
};

RTS_RESULT IoDrvGpio_Hook(CMP_HOOK hook)
{
    RTS_UI32 i;

    switch (hook) {
    case CH_INIT2:
        return IoMgrRegisterInstance(&gpio_driver);
    case CH_COMM_CYCLE:
        poll_groups();
        close_unused();
        break;
    case CH_EXIT2:
        for (i = 0; i < IO_GPIO_GROUPS; i++)
            close_group(&groups[i]);
        return IoMgrUnregisterInstance(&gpio_driver);
    default:
        break;
    }
    return ERR_OK;
}
