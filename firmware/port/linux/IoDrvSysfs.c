/*
 * IoDrvSysfs.c - driver of what the kernel has as files with one number: analog values (IIO) and PWM.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * To read such a file may take as long as a conversion (125 ms at 8 samples a second) or a time-out of the bus. So each
 * device has a thread that does nothing else: tasks and main copy from and to DEVICE.value only. What the thread works on
 * (`work`) is its own; it takes over what main wants (`setup`) between two rounds, and is never waited for but at the end
 * of the runtime. Before it takes over another set-up it writes what the outputs of its own have become (`last`): a slow
 * device may still have what they were before they were made safe, and nothing writes them after that.
 * A device that is pulled is lost with its first error, and back with the first round without one.
 */
#define _GNU_SOURCE
#include "IoDrvSysfs.h"

#include "CmpIoMgrEmbedded.h"
#include "SysAtomic.h"
#include "SysLock.h"
#include "SysTime.h"
#include "SysfsFiles.h"
#include "rts_config.h"

#include <errno.h>
#include <pthread.h>
#include <poll.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

enum { DEVICES = 8, TIMEOUT_MS = 3000, LAST_TRIES = 3 };

typedef struct {
    RTS_UI32 user;     /* index of its connector + 1; 0: not in use */
    SYSFS_SETUP setup; /* what main wants; with what follows, up to `last`, within SysLock */
    RTS_UI32 serial;   /* of `setup` */
    RTS_UI32 taken;    /* of `work` */
    RTS_UI32 value[IO_SYSFS_CHANNELS];
    RTS_UI32 last[IO_SYSFS_CHANNELS]; /* values of `work` at its end, while `setup` is another one */
    RTS_UI32 rounds;                  /* good ones of this setup, and bad ones: the thread counts */
    RTS_UI32 errors;
    RTS_UI32 rounds_seen; /* by the cycle */
    RTS_UI32 errors_seen;
    RTS_UI32 heard_ms; /* when it last saw a round, good or bad */
    RTS_UI32 is_awake; /* `wake` was sent */
    RTS_UI32 is_ending;
    RTS_UI32 has_thread;
    int wake; /* events: to the thread, and that it has ended */
    int ended;
    pthread_t thread;
    /* the thread's */
    SYSFS_SETUP work; /* changed within SysLock */
    char folder[SYSFS_PATH_SIZE];
    RTS_UI32 written[IO_SYSFS_CHANNELS];
    RTS_UI32 is_written; /* a bit for each channel: the device has `written` */
} DEVICE;

RTS_STATIC_ASSERT((int)IO_SYSFS_CHANNELS == 32, a_word_has_a_bit_for_each_channel);

static DEVICE devices[DEVICES];

static const ICmpIoDrv functions;
static IO_DRIVER sysfs_driver = {.functions = &functions};

static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvSysfs", "Analog values and PWM of the kernel", "Open PLC runtime", 0x00010000};

    return &info;
}

/* ---- the thread of a device ---- */

/* Whether main wants another set-up. One that is given again, as by a download of the same program, goes on. */
static bool is_replaced(DEVICE *device)
{
    RTS_UI32 lock = SysLockEnter();
    bool is_other = memcmp(&device->work, &device->setup, sizeof device->work) != 0;

    SysLockLeave(lock);
    return is_other;
}

/* What main wants, if that is new. */
static void take_setup(DEVICE *device)
{
    RTS_UI32 lock = SysLockEnter();

    if (device->taken != device->serial) {
        device->taken = device->serial;
        device->work = device->setup;
        device->is_written = 0;
    }
    SysLockLeave(lock);
}

/* Of the channels of `work`. */
static void get_values(const DEVICE *device, RTS_UI32 value[IO_SYSFS_CHANNELS])
{
    RTS_UI32 lock = SysLockEnter();

    memcpy(value, device->taken == device->serial ? device->value : device->last, sizeof device->value);
    SysLockLeave(lock);
}

static bool is_output(const DEVICE *device, RTS_UI32 n)
{
    return (device->work.channel[n].options & SYSFS_OPTION_OUT) != 0;
}

static bool write_output(DEVICE *device, RTS_UI32 n, RTS_UI32 value)
{
    if ((device->is_written >> n & 1) != 0 && device->written[n] == value)
        return true;
    if (!SysfsWrite(&device->work, n, device->folder, value))
        return false;
    device->written[n] = value;
    device->is_written |= 1u << n;
    return true;
}

/* One that fails keeps no other from being switched off. */
static bool write_all(DEVICE *device, const RTS_UI32 *value)
{
    bool is_good = true;
    RTS_UI32 n;

    for (n = 0; n < device->work.count; n++) {
        if (is_output(device, n))
            is_good = write_output(device, n, value[n]) && is_good;
    }
    return is_good;
}

static bool read_all(DEVICE *device, RTS_UI32 *value)
{
    bool is_good = true;
    RTS_UI32 n;

    for (n = 0; n < device->work.count && is_good; n++)
        is_good = is_output(device, n) || SysfsRead(&device->work, n, device->folder, &value[n]);
    return is_good;
}

/* All channels once. Outputs come first, so that an input that fails keeps none from being switched off; inputs come to
 * the tasks together. */
static void do_round(DEVICE *device)
{
    RTS_UI32 value[IO_SYSFS_CHANNELS];
    bool is_good = SysfsFind(&device->work, device->folder);
    RTS_UI32 lock;
    RTS_UI32 n;

    get_values(device, value);
    is_good = is_good && write_all(device, value) && read_all(device, value);
    lock = SysLockEnter();
    for (n = 0; is_good && device->taken == device->serial && n < device->work.count; n++) {
        if (!is_output(device, n))
            device->value[n] = value[n];
    }
    if (device->taken == device->serial)
        (void)SysAtomicAdd(is_good ? &device->rounds : &device->errors, 1);
    SysLockLeave(lock);
    if (!is_good)
        device->is_written = 0; /* it may have been away */
}

/* Nothing writes the outputs of `work` after this: an error that passes is no reason to leave one on. */
static void end_work(DEVICE *device)
{
    RTS_UI32 value[IO_SYSFS_CHANNELS];
    RTS_UI32 tries = device->work.count > 0 ? LAST_TRIES : 0;

    get_values(device, value);
    while (tries > 0 && SysfsFind(&device->work, device->folder) && !write_all(device, value))
        tries--;
}

/* Until an event was sent, or a time is over. */
static bool await_event(int event, RTS_UI32 ms)
{
    struct pollfd wanted = {.fd = event, .events = POLLIN};
    eventfd_t count;
    int found;

    do
        found = poll(&wanted, 1, (int)ms);
    while (found < 0 && errno == EINTR);
    return found > 0 && eventfd_read(event, &count) == 0;
}

static void *run(void *arg)
{
    DEVICE *device = arg;
    bool is_ending = false;

    while (!is_ending) {
        is_ending = SysAtomicLoad(&device->is_ending) != 0; /* before it is looked what outputs have become */
        if (is_replaced(device))
            end_work(device);
        take_setup(device);
        if (is_ending) {
            end_work(device);
        } else {
            if (device->work.count > 0)
                do_round(device);
            (void)await_event(device->wake, device->work.count > 0 ? device->work.every_ms : 1000);
            SysAtomicStore(&device->is_awake, 0);
        }
    }
    (void)eventfd_write(device->ended, 1);
    return NULL;
}

static void wake(DEVICE *device)
{
    if (SysAtomicReplace(&device->is_awake, 0, 1))
        (void)eventfd_write(device->wake, 1);
}

static void close_events(DEVICE *device)
{
    if (device->wake >= 0)
        (void)close(device->wake);
    if (device->ended >= 0)
        (void)close(device->ended);
}

static RTS_RESULT start_thread(DEVICE *device)
{
    if (device->has_thread)
        return ERR_OK;
    device->wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    device->ended = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    device->has_thread =
        device->wake >= 0 && device->ended >= 0 && pthread_create(&device->thread, NULL, run, device) == 0;
    if (device->has_thread)
        return ERR_OK;
    close_events(device);
    return ERR_FAILED;
}

/* One that hangs in the kernel is not waited for: the process ends. */
static void await_end(DEVICE *device, RTS_UI32 ms)
{
    if (!await_event(device->ended, ms)) {
        (void)pthread_detach(device->thread);
        device->has_thread = 0;
        return;
    }
    (void)pthread_join(device->thread, NULL);
    close_events(device);
    memset(device, 0, sizeof *device);
}

/* All at once: each writes its outputs, and as long as a device may take that is waited for. */
static void end_threads(void)
{
    RTS_UI32 started_ms = SysTimeGetMs();
    DEVICE *device;

    for (device = devices; device < devices + DEVICES; device++) {
        if (!device->has_thread)
            continue;
        SysAtomicStore(&device->is_ending, 1);
        (void)eventfd_write(device->wake, 1);
    }
    for (device = devices; device < devices + DEVICES; device++) {
        RTS_UI32 passed_ms = SysTimeGetMs() - started_ms;
        if (device->has_thread)
            await_end(device, passed_ms < TIMEOUT_MS ? TIMEOUT_MS - passed_ms : 0);
    }
}

/* ---- configuration ---- */

static RTS_UI32 get_number(const IoConfigConnector *connector, RTS_UI32 id)
{
    return IoMgrConfigGetParameterValueDword(IoMgrConfigGetParameter(connector, id), NULL);
}

static const char *get_text(const IoConfigConnector *connector, RTS_UI32 id)
{
    return IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, id));
}

/* A name that leads out of the folder of its device is none. */
static bool take_name(char to[SYSFS_NAME_SIZE], const char *name)
{
    if (name == NULL || name[0] == '\0' || name[0] == '.' || strchr(name, '/') != NULL ||
        strlen(name) >= SYSFS_NAME_SIZE)
        return false;
    (void)strcpy(to, name);
    return true;
}

/* Its channels; false: the configuration has no sense. */
static bool read_setup(const IoConfigConnector *connector, SYSFS_SETUP *setup)
{
    memset(setup, 0, sizeof *setup);
    setup->kind = get_number(connector, SYSFS_KIND);
    setup->every_ms = get_number(connector, SYSFS_EVERY);
    if (!take_name(setup->device, get_text(connector, SYSFS_DEVICE)) || setup->every_ms == 0 ||
        (setup->kind != SYSFS_IIO && setup->kind != SYSFS_PWM))
        return false;
    while (setup->count < IO_SYSFS_CHANNELS &&
           IoMgrConfigGetParameter(connector, SYSFS_CHANNEL + setup->count) != NULL) {
        SYSFS_FILE *channel = &setup->channel[setup->count];
        if (!take_name(channel->name, get_text(connector, SYSFS_CHANNEL + setup->count)))
            return false;
        channel->options = get_number(connector, SYSFS_OPTIONS + setup->count);
        channel->period_ns = get_number(connector, SYSFS_PERIOD + setup->count);
        if (setup->kind == SYSFS_PWM && ((channel->options & SYSFS_OPTION_OUT) == 0 || channel->period_ns == 0 ||
                                         strncmp(channel->name, "pwm", strlen("pwm")) != 0))
            return false;
        setup->count++;
    }
    return setup->count > 0;
}

/* How well it fits. What a thread has not ended yet counts as well: of two threads with one device the older one might
 * write last. */
static RTS_UI32 rank_of(DEVICE *device, const char *name)
{
    RTS_UI32 lock = SysLockEnter();
    bool is_same = strcmp(device->setup.device, name) == 0 || strcmp(device->work.device, name) == 0;
    bool is_free = device->setup.count == 0 && device->work.count == 0;

    SysLockLeave(lock);
    return is_same ? 2 : is_free;
}

/* The device that a connector had before the download, else one that is free: a thread that still hangs in an old device
 * keeps no other waiting. */
static DEVICE *choose(const SYSFS_SETUP *setup)
{
    DEVICE *best = NULL;
    DEVICE *device;

    for (device = devices; device < devices + DEVICES; device++) {
        if (device->user == 0 && (best == NULL || rank_of(device, setup->device) > rank_of(best, setup->device)))
            best = device;
    }
    return best;
}

/* Outputs of a device that stays the same keep their values until a task writes them. A set-up that the thread has not
 * taken has written nothing, so what is `last` stays that of the one it has. */
static void give_setup(DEVICE *device, const SYSFS_SETUP *setup)
{
    RTS_UI32 lock = SysLockEnter();

    if (memcmp(&device->work, &device->setup, sizeof device->work) == 0)
        memcpy(device->last, device->value, sizeof device->last);
    if (memcmp(&device->setup, setup, sizeof *setup) != 0)
        memset(device->value, 0, sizeof device->value);
    device->setup = *setup;
    device->serial++;
    device->rounds = device->rounds_seen = 0;
    device->errors = device->errors_seen = 0;
    device->heard_ms = SysTimeGetMs();
    SysLockLeave(lock);
    wake(device);
}

static RTS_RESULT configure(const IoConfigConnector *connector)
{
    static SYSFS_SETUP setup;
    char folder[SYSFS_PATH_SIZE];
    const char *missing;
    DEVICE *device;

    if (!read_setup(connector, &setup))
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "its description is incomplete.");
    if (!SysfsFind(&setup, folder))
        return IoMgrConfigRefuse(connector, ERR_NO_OBJECT, "the kernel has no device %s.", setup.device);
    missing = SysfsFindMissing(&setup, folder);
    if (missing != NULL)
        return IoMgrConfigRefuse(connector, ERR_NO_OBJECT, "%s has no channel %s.", setup.device, missing);
    device = choose(&setup);
    if (device == NULL)
        return IoMgrConfigRefuse(connector, ERR_NOMEMORY, "there can be %u such devices.", (unsigned)DEVICES);
    if (start_thread(device) != ERR_OK)
        return IoMgrConfigRefuse(connector, ERR_FAILED, "the system gives no thread for it.");
    give_setup(device, &setup);
    device->user = IoMgrConfigGetIndex(connector) + 1;
    return ERR_OK;
}

static bool is_taken(const DEVICE *device)
{
    RTS_UI32 lock = SysLockEnter();
    bool result = device->taken == device->serial;

    SysLockLeave(lock);
    return result;
}

/* What is not used any more is not touched any more, once its outputs are as they were left. */
static void release_unused(void)
{
    static const SYSFS_SETUP none;
    DEVICE *device;

    for (device = devices; device < devices + DEVICES; device++) {
        if (device->user == 0 && device->setup.count > 0 && is_taken(device))
            give_setup(device, &none);
    }
}

static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_RESULT result = ERR_OK;
    DEVICE *device;

    for (device = devices; device < devices + DEVICES; device++)
        device->user = 0;
    if (count == 0)
        return ERR_OK; /* the next application, of the same download, may keep its devices */
    for (; count > 0 && result == ERR_OK; count--, connectors++) {
        if (IoMgrConfigIsMine(connectors, &sysfs_driver))
            result = configure(connectors);
    }
    release_unused();
    return result;
}

static DEVICE *find_device(RTS_UI32 connector)
{
    DEVICE *device = devices;

    while (device < devices + DEVICES && device->user != connector + 1)
        device++;
    return device < devices + DEVICES ? device : NULL;
}

static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    const DEVICE *device = find_device(IoMgrConfigGetIndex(connector));
    RTS_UI32 n = channel->parameter - SYSFS_VALUE;

    if (device != NULL && n < device->setup.count && channel->bits <= 32 &&
        channel->parameter_bit <= 32u - channel->bits &&
        ((device->setup.channel[n].options & SYSFS_OPTION_OUT) != 0) == (type == IO_MAP_OUTPUTS))
        return ERR_OK;
    return IoMgrConfigRefuse(connector, ERR_OUT_OF_LIMITS, "it has no channel %u.%u.", (unsigned)channel->parameter,
                             (unsigned)channel->parameter_bit);
}

/* Connectors that are refused here, and optional, have no driver any more. */
static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    RTS_RESULT result = IoMgrConfigEachChannel(task_maps, count, &sysfs_driver, check_channel);
    DEVICE *device;

    for (device = devices; device < devices + DEVICES; device++) {
        if (device->user != 0 && !IoMgrConfigIsMine(IoMgrConfigGetConnector(device->user - 1), &sysfs_driver))
            device->user = 0;
    }
    return result;
}

/* ---- cycles ---- */

static RTS_RESULT read_inputs(const IoConfigConnectorMap *maps, int count)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0; count--, maps++) {
        const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(maps);
        const DEVICE *device = find_device(maps->connector);
        RTS_UI32 channels = device != NULL ? maps->channel_map_count : 0;
        for (; channels > 0; channels--, channel++)
            IoMgrCopyInputLE(channel, &device->value[channel->parameter - SYSFS_VALUE]);
    }
    SysLockLeave(lock);
    return ERR_OK;
}

/* Copies, and says whether one has changed. */
static bool copy_outputs(DEVICE *device, const IoConfigConnectorMap *map)
{
    const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
    RTS_UI32 channels = map->channel_map_count;
    bool has_changed = false;

    for (; channels > 0; channels--, channel++) {
        RTS_UI32 *value = &device->value[channel->parameter - SYSFS_VALUE];
        RTS_UI32 before = *value;
        IoMgrCopyOutputLE(channel, value);
        has_changed = has_changed || *value != before;
    }
    return has_changed;
}

static RTS_RESULT write_outputs(const IoConfigConnectorMap *maps, int count)
{
    for (; count > 0; count--, maps++) {
        DEVICE *device = find_device(maps->connector);
        RTS_UI32 lock = SysLockEnter();
        bool has_changed = device != NULL && copy_outputs(device, maps);
        SysLockLeave(lock);
        if (has_changed)
            wake(device);
    }
    return ERR_OK;
}

/* The kernel does not come back from a device. */
static void lose_silent(DEVICE *device, const IoConfigConnector *connector)
{
    device->heard_ms = SysTimeGetMs();
    IoMgrConfigSetDiagnosis(connector, CF_CONNECTOR_BUS_ERROR);
}

/* What the thread has found out since the last time. */
static RTS_RESULT start_bus_cycle(const IoConfigConnector *connector)
{
    DEVICE *device = find_device(IoMgrConfigGetIndex(connector));
    RTS_UI32 errors;
    RTS_UI32 rounds;

    if (device == NULL)
        return ERR_OK;
    errors = SysAtomicLoad(&device->errors);
    rounds = SysAtomicLoad(&device->rounds);
    if (errors != device->errors_seen || rounds != device->rounds_seen)
        device->heard_ms = SysTimeGetMs();
    if (errors != device->errors_seen)
        IoMgrConfigSetDiagnosis(connector, CF_CONNECTOR_BUS_ERROR);
    else if (rounds != device->rounds_seen)
        IoMgrConfigNoteData(connector);
    else if (SysTimeGetMs() - device->heard_ms > device->setup.every_ms + TIMEOUT_MS)
        lose_silent(device, connector);
    device->errors_seen = errors;
    device->rounds_seen = rounds;
    return ERR_OK;
}

#if ONLINE_CHANGE
/* Devices know their connectors by number, and have copies of what these say. */
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
    .IoDrvStartBusCycle = start_bus_cycle,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = follow_configuration,
#endif
};

RTS_RESULT IoDrvSysfs_Hook(CMP_HOOK hook)
{
    switch (hook) {
    case CH_INIT2:
        return IoMgrRegisterInstance(&sysfs_driver);
    case CH_COMM_CYCLE:
        release_unused();
        return ERR_OK;
    case CH_EXIT2:
        end_threads();
        return IoMgrUnregisterInstance(&sysfs_driver);
    default:
        return ERR_OK;
    }
}
