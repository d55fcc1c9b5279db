/*
 * CmpPlcShell.c - the PLC shell (group 0x11): commands and answers in words.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An answer may need several messages. The client asks for one after another by number, and the command is run again for
 * each: what has been sent already is left out. So nothing is kept from one to the next. A command that changes
 * something does so for the first message only.
 */
#include "CmpPlcShell.h"

#include <string.h>

#include "CMUtils.h"
#include "AppReason.h"
#include "CmpAppEmbedded.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpDevice.h"
#include "CmpIecTask.h"
#include "CmpOperationControl.h"
#include "CmpSrv.h"
#include "NodeName.h"
#include "SysExcept.h"
#include "SysTarget.h"
#include "rts_config.h"

/* Where the lines of an answer go: into one message, after those that went into the messages before. */
typedef struct {
    BTAG_WRITER *reply;
    RTS_UI32 skip; /* characters still to be left out */
    RTS_UI32 room; /* characters that still fit */
    bool more;     /* some do not fit */
} SHELL_OUTPUT;

typedef struct {
    const char *name;
    const char *help;
    RTS_UI16 right;     /* RIGHT_* */
    RTS_UI16 operation; /* OPERATION_* that a program may forbid; OPERATION_COUNT: none */
    RTS_RESULT (*change)(void);
    void (*print)(SHELL_OUTPUT *out);
} SHELL_COMMAND;

/* ---- output ---- */

static void put(SHELL_OUTPUT *out, const char *text, RTS_UI32 size)
{
    RTS_UI32 skipped = size < out->skip ? size : out->skip;

    out->skip -= skipped;
    size -= skipped;
    RTS_UI32 fits = size < out->room ? size : out->room;
    BTagAppend(out->reply, text + skipped, fits);
    out->room -= fits;
    out->more = out->more || fits < size;
}

RTS_FORMAT(2, 0) static void put_formatted(SHELL_OUTPUT *out, const char *format, va_list arguments)
{
    enum { PIECE_SIZE = 160 };
    char piece[PIECE_SIZE];

    put(out, piece, (RTS_UI32)CMUtlvsnprintf(piece, sizeof(piece), format, arguments));
}

/* A line, or the end of one. */
RTS_FORMAT(2, 3) static void print(SHELL_OUTPUT *out, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    put_formatted(out, format, arguments);
    va_end(arguments);
    put(out, "\r\n", 2);
}

/* A part of a line. */
RTS_FORMAT(2, 3) static void print_part(SHELL_OUTPUT *out, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    put_formatted(out, format, arguments);
    va_end(arguments);
}

/* ---- commands ---- */

static void print_device(SHELL_OUTPUT *out)
{
    const SYS_TARGET *target = SysTargetGet();

    print(out, "Device: %s", target->device_name);
    print(out, "Vendor: %s", target->vendor_name);
    print(out, "Node: %s", NodeNameOf(target));
    print(out, "Serial number: %s", target->serial_number);
    print(out, "Target: type 0x%X, id 0x%X, version 0x%X", (unsigned)target->type, (unsigned)target->id,
          (unsigned)target->version);
    print(out, "Runtime: 0x%X", (unsigned)RTS_VERSION);
}

static bool is_loaded(SHELL_OUTPUT *out, APP_STATUS *status)
{
    AppGetStatus(status);
    if (status->state == AS_NONE)
        print(out, "No Application loaded");
    return status->state != AS_NONE;
}

static void print_applications(SHELL_OUTPUT *out)
{
    APP_STATUS status;

    if (is_loaded(out, &status))
        print(out, "Application");
}

static void print_state(SHELL_OUTPUT *out)
{
    APP_STATUS status;

    if (!is_loaded(out, &status))
        return;
    print(out, "%s", status.state == AS_RUN ? "run" : "stop");
    if (status.exception.code != RTSEXCPT_NOEXCEPTION)
        print(out, "exception 0x%X", (unsigned)status.exception.code);
}

static void print_tasks(SHELL_OUTPUT *out)
{
    IEC_TASK_INFO info;

    for (RTS_UI32 i = 0; i < IecTaskGetCount(); i++)
        if (IecTaskGetInfo(i, &info) == ERR_OK)
            print(out, "%s: priority %u, interval %u us, cycles %u, last %u us, max %u us, jitter %u us", info.name,
                  (unsigned)info.priority, (unsigned)info.interval_us, (unsigned)info.cycles, (unsigned)info.last_us,
                  (unsigned)info.max_us, (unsigned)info.jitter_us);
}

static void print_load(SHELL_OUTPUT *out)
{
    print(out, "PLC load: %u%%", (unsigned)IecTaskGetLoad());
}

static void print_counters(SHELL_OUTPUT *out)
{
    const CHANNEL_COUNTERS *channel = ChannelGetCounters();
    const ROUTER_COUNTERS *router = RouterGetCounters();

    print(out, "Packets: %u, malformed %u, for others %u, ignored %u", (unsigned)router->handled,
          (unsigned)router->malformed, (unsigned)router->not_for_us, (unsigned)router->ignored);
    print(out, "Channels opened: %u, refused %u, failed %u", (unsigned)channel->opened, (unsigned)channel->refused,
          (unsigned)channel->failed);
    print(out, "Blocks: malformed %u, of another channel %u, repeated %u, lost %u; replies repeated: %u",
          (unsigned)channel->malformed, (unsigned)channel->foreign, (unsigned)channel->duplicates,
          (unsigned)channel->gaps, (unsigned)channel->repeats);
}

static void print_line(SHELL_OUTPUT *out, const BLK_COUNTERS *counters, RTS_UI32 line)
{
    const RTS_UI32 *values = counters->values + line * counters->count;

    print_part(out, "Line %s %u:", counters->driver, (unsigned)(line + 1));
    for (RTS_UI32 i = 0; i < counters->count; i++)
        print_part(out, "%s %s %u", i == 0 ? "" : ",", counters->names[i], (unsigned)values[i]);
    put(out, "\r\n", 2);
}

static void print_lines(SHELL_OUTPUT *out)
{
    for (const BLK_COUNTERS *const *counters = BlkCounters; *counters != NULL; counters++)
        for (RTS_UI32 line = 0; line < (*counters)->lines; line++)
            print_line(out, *counters, line);
}

static void print_channels(SHELL_OUTPUT *out)
{
    COMM_CLIENT *client;

    for (RTS_UI32 i = 0; (client = ChannelGetClient(i)) != NULL; i++)
        if (ChannelIsOpen(client))
            print(out, "Channel %u: %s, messages up to %u bytes", (unsigned)client->channel.id,
                  SrvIsLoggedIn(client) ? "logged in" : "no login", (unsigned)client->channel.limit);
    if (!COMM_COUNTERS)
        return;
    print_counters(out);
    print_lines(out);
}

static RTS_RESULT reset_warm(void)
{
    return AppReset(RESET_OPTION_WARM);
}

static RTS_RESULT reset_cold(void)
{
    return AppReset(RESET_OPTION_COLD);
}

#if CM_VERSIONS > 0
/* A line for each component: plctool reads it. */
static void print_components(SHELL_OUTPUT *out)
{
    for (RTS_SIZE i = 0; i < cmp_component_count; i++) {
        RTS_UI32 own = CMGetVersion(cmp_names[i].id);
        RTS_UI32 version = own != 0 ? own : RTS_VERSION;
        print(out, "%s: id 0x%X, version %u.%u.%u.%u", cmp_names[i].name, (unsigned)cmp_names[i].id,
              (unsigned)(version >> 24), (unsigned)(version >> 16 & 0xFF), (unsigned)(version >> 8 & 0xFF),
              (unsigned)(version & 0xFF));
    }
}
#endif

static void print_help(SHELL_OUTPUT *out);

static const SHELL_COMMAND commands[] = {
    {"?", "this list", RIGHT_VIEW, OPERATION_COUNT, NULL, print_help},
    {"rtsinfo", "device and runtime", RIGHT_VIEW, OPERATION_COUNT, NULL, print_device},
    {"applist", "applications", RIGHT_VIEW, OPERATION_COUNT, NULL, print_applications},
    {"getprgstat", "state of the application", RIGHT_VIEW, OPERATION_COUNT, NULL, print_state},
    {"startprg", "start the application", RIGHT_CONTROL, OPERATION_COUNT, AppStartApplication, NULL},
    {"stopprg", "stop the application", RIGHT_CONTROL, OPERATION_STOP, AppStopApplication, NULL},
    {"resetprg", "warm reset of the application", RIGHT_CONTROL, OPERATION_RESET, reset_warm, NULL},
    {"resetprgcold", "cold reset of the application", RIGHT_CONTROL, OPERATION_RESET, reset_cold, NULL},
    {"reload", "load and start the boot project again", RIGHT_CONTROL, OPERATION_STOP, AppReload, NULL},
    {"tasklist", "tasks and their times", RIGHT_VIEW, OPERATION_COUNT, NULL, print_tasks},
    {"channelinfo", "channels and lines, and what went wrong there", RIGHT_VIEW, OPERATION_COUNT, NULL, print_channels},
    {"plcload", "share of the time that tasks took since their start", RIGHT_VIEW, OPERATION_COUNT, NULL, print_load},
#if CM_VERSIONS > 0
    {"complist", "components and their versions", RIGHT_VIEW, OPERATION_COUNT, NULL, print_components},
#endif
};

static void print_help(SHELL_OUTPUT *out)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(commands); i++)
        print(out, "%s: %s", commands[i].name, commands[i].help);
}

/* ---- service ---- */

/* `name` need not have a NUL. */
static const SHELL_COMMAND *find_command(const BTAG *name)
{
    RTS_UI32 length = CMUtlStrNLen((const char *)name->data, name->size);

    for (RTS_UI32 i = 0; i < RTS_COUNT(commands); i++)
        if (strlen(commands[i].name) == length && memcmp(commands[i].name, name->data, length) == 0)
            return &commands[i];
    return NULL;
}

/* The error if it is refused. */
static RTS_RESULT run(const SHELL_COMMAND *command, const COMM_CLIENT *client, bool first, SHELL_OUTPUT *out)
{
    RTS_RESULT result = ERR_OK;

    if (command == NULL) {
        print(out, "There is no such command; ? lists them.");
        result = ERR_NO_OBJECT;
    } else if ((client->session.rights & command->right) == 0) {
        print(out, "You may not do this.");
        result = ERR_NO_ACCESS_RIGHTS;
    } else if (command->print != NULL) {
        command->print(out);
    } else if (first) {
        (void)AppTakeReason();
        result = OperationMay(command->operation);
        if (result == ERR_OK)
            result = command->change();
        const char *reason = AppTakeReason();
        if (result == ERR_OK)
            print(out, "%s: done", command->name);
        else if (reason[0] != '\0')
            print(out, "%s: %s", command->name, reason);
        else
            print(out, "%s: error 0x%X", command->name, (unsigned)result);
    }
    return result;
}

static RTS_RESULT execute(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    enum { OVERHEAD = 32 }; /* heads of the two elements, NUL, padding, result */
    BTAG name;
    BTAG_WRITER start = *reply;
    RTS_UI32 block = 0;
    RTS_RESULT result = BTagFind(&request->tags, TAG_SHELL_COMMAND, 1, SHELL_MAX_COMMAND, &name);

    if (result == ERR_OK)
        result = BTagFindOptional(&request->tags, TAG_SHELL_BLOCK, &block);
    if (result != ERR_OK)
        return result;
    if (BTagGetRoom(reply) <= OVERHEAD)
        return ERR_BUFFERSIZE;
    RTS_UI32 room = BTagGetRoom(reply) - OVERHEAD;
    SHELL_OUTPUT out = {reply, block < UINT32_MAX / room ? block * room : UINT32_MAX, room, false};
    BTagOpen(reply, TAG_SHELL_LAST, BTAG_ALIGN_0);
    BTagOpen(reply, TAG_SHELL_TEXT, BTAG_ALIGN_0);
    result = run(find_command(&name), request->client, block == 0, &out);
    BTagAppendZeros(reply, 1);
    BTagPad(reply);
    BTagClose(reply);
    if (result != ERR_OK)
        BTagWrite16(reply, TAG_SHELL_RESULT, (RTS_UI32)result);
    BTagClose(reply);
    if (out.more) /* the same, said to be a part */
        start.data[start.size] = TAG_SHELL_PART;
    return ERR_OK;
}

/* There is never one that runs on. */
static RTS_RESULT cancel(SRV_REQUEST *request, BTAG_WRITER *reply)
{
    RTS_UNUSED(request);
    BTagWrite16(reply, TAG_SERVICE_RESULT, ERR_OK);
    return ERR_OK;
}

static const SRV_SERVICE services[] = {
    {SRV_SHELL_EXECUTE, RIGHT_VIEW, execute},
    {SRV_SHELL_CANCEL, RIGHT_VIEW, cancel},
};

RTS_RESULT CmpPlcShell_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? SrvRegisterGroup(SG_PLCSHELL, services, RTS_COUNT(services)) : ERR_OK;
}
