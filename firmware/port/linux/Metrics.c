/*
 * Metrics.c - figures of the controller as a text file that Prometheus reads.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The file is that of node_exporter's textfile collector: the text format of Prometheus, version 0.0.4. The label "plc" is the name of the file without its
 * ending, so the files of several controllers of one machine differ in it.
 */
#define _GNU_SOURCE
#include "Metrics.h"

#include "AppState.h"
#include "CmpAppEmbedded.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "CmpRouterEmbedded.h"
#include "LogReport.h"
#include "NewFile.h"
#include "Supervisor.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "rts_config.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    TEXT_SIZE = 48 * 1024, /* 16 tasks with 7 lines of 150 characters each, and as much again */
    LABEL_SIZE = 160,      /* a name of 64 characters, all of them escaped, with NUL */
    READABLE = 0644,       /* by node_exporter, which is another user */
};

static struct {
    const char *path;
    char plc[LABEL_SIZE];
    RTS_UI32 interval_ms;
    RTS_UI32 due_ms;
    RTS_I64 start_s; /* of the Unix epoch */
    bool written;
    int error; /* why the file was not written last time, 0: it was */
    char text[TEXT_SIZE];
    size_t size;
} metrics;

/* ---- text ---- */

static void put(const char *format, ...) __attribute__((format(printf, 1, 2)));

static void put(const char *format, ...)
{
    va_list arguments;
    size_t room = TEXT_SIZE - metrics.size;
    va_start(arguments, format);
    int length = vsnprintf(metrics.text + metrics.size, room, format, arguments);
    va_end(arguments);
    if (length > 0) {
        metrics.size += (size_t)length < room ? (size_t)length : room - 1;
    }
}

/* Copies text as the value of a label: escaped, and in ASCII, since a byte that is not UTF-8 would invalidate the file. */
static const char *as_label(const char *text, char label[LABEL_SIZE])
{
    size_t size = 0;
    for (; *text != '\0' && size < LABEL_SIZE - 2; text++) {
        if (*text == '"' || *text == '\\') {
            label[size++] = '\\';
        }
        label[size++] = *text >= ' ' && *text <= '~' ? *text : '_';
    }
    label[size] = '\0';
    return label;
}

static void put_family(const char *name, const char *type, const char *help)
{
    put("# HELP plcrt_%s %s\n# TYPE plcrt_%s %s\n", name, help, name, type);
}

/* ---- the controller ---- */

static void put_info(void)
{
    char name[LABEL_SIZE];
    char device[LABEL_SIZE];
    put_family("info", "gauge", "Version of plcrt, name and device of the controller.");
    put("plcrt_info{plc=\"%s\",version=\"%s\",name=\"%s\",device=\"%s\"} 1\n", metrics.plc, PLCRT_VERSION,
        as_label(SysTargetGet()->node_name, name), as_label(SysTargetGet()->device_name, device));
    put_family("start_time_seconds", "gauge", "When the controller started, since the Unix epoch.");
    put("plcrt_start_time_seconds{plc=\"%s\"} %lld\n", metrics.plc, (long long)metrics.start_s);
    put_family("restarts_total", "counter", "Deaths of the controller's process after which it was started again.");
    put("plcrt_restarts_total{plc=\"%s\"} %u\n", metrics.plc, PortDeaths());
}

static void put_state(const char *name, bool is_it)
{
    put("plcrt_state{plc=\"%s\",state=\"%s\"} %d\n", metrics.plc, name, is_it);
}

static void put_application(void)
{
    APP_STATUS status;
    AppGetStatus(&status);
    bool failed = (status.op_state & OS_EXCEPTION) != 0;
    put_family("state", "gauge", "1 for the state of the program, 0 for the other states.");
    put_state("none", status.state == AS_NONE);
    put_state("run", status.state == AS_RUN);
    put_state("stop", status.state != AS_NONE && status.state != AS_RUN && !failed);
    put_state("exception", failed);
    put_family("image_info", "gauge", "Checksum of the program, as plctool status shows it.");
    if (status.state != AS_NONE) {
        put("plcrt_image_info{plc=\"%s\",crc=\"%08X\"} 1\n", metrics.plc, (unsigned)status.image_crc);
    }
    put_family("load_ratio", "gauge", "Share of the time that tasks took since their start; 1 is one processor.");
    put("plcrt_load_ratio{plc=\"%s\"} %u.%02u\n", metrics.plc, (unsigned)(IecTaskGetLoad() / 100),
        (unsigned)(IecTaskGetLoad() % 100));
}

static void put_log(void)
{
    static const struct {
        RTS_UI32 log_class;
        const char *name;
    } classes[] = {{LOG_WARNING, "warning"}, {LOG_ERROR, "error"}, {LOG_EXCEPTION, "exception"}};
    put_family("log_entries_total", "counter", "Entries of the log since the start of the controller's process.");
    for (size_t i = 0; i < RTS_COUNT(classes); i++) {
        put("plcrt_log_entries_total{plc=\"%s\",class=\"%s\"} %u\n", metrics.plc, classes[i].name,
            (unsigned)PortLogCount(classes[i].log_class));
    }
}

static void put_line(const BLK_COUNTERS *counters, RTS_UI32 line)
{
    char event[LABEL_SIZE];
    for (RTS_UI32 i = 0; i < counters->count; i++) {
        put("plcrt_line_events_total{plc=\"%s\",line=\"%s %u\",event=\"%s\"} %u\n", metrics.plc, counters->driver,
            (unsigned)(line + 1), as_label(counters->names[i], event),
            (unsigned)counters->values[line * counters->count + i]);
    }
}

static void put_lines(void)
{
    put_family("line_events_total", "counter", "What happened on the lines that tools use, as plctool shell shows it.");
    for (const BLK_COUNTERS *const *counters = BlkCounters; *counters != NULL; counters++) {
        for (RTS_UI32 line = 0; line < (*counters)->lines; line++) {
            put_line(*counters, line);
        }
    }
}

/* ---- tasks ---- */

static const struct {
    const char *name;
    const char *type;
    const char *help;
    size_t offset;
    bool is_time;
} of_task[] = {
    {"task_cycles_total", "counter", "Cycles.", offsetof(IEC_TASK_INFO, cycles), false},
    {"task_overruns_total", "counter", "Cycles or events that were skipped because a cycle took too long.",
     offsetof(IEC_TASK_INFO, overruns), false},
    {"task_jitter_seconds", "gauge", "Largest deviation of a start from its due time.",
     offsetof(IEC_TASK_INFO, jitter_us), true},
    {"task_interval_seconds", "gauge", "Interval of a cyclic task.", offsetof(IEC_TASK_INFO, interval_us), true},
    {"task_last_seconds", "gauge", "Time of the last cycle.", offsetof(IEC_TASK_INFO, last_us), true},
    {"task_average_seconds", "gauge", "Average time of a cycle.", offsetof(IEC_TASK_INFO, avg_us), true},
    {"task_shortest_seconds", "gauge", "Time of the shortest cycle.", offsetof(IEC_TASK_INFO, min_us), true},
    {"task_longest_seconds", "gauge", "Time of the longest cycle.", offsetof(IEC_TASK_INFO, max_us), true},
};

static void put_of_task(const IEC_TASK_INFO *info, size_t which)
{
    char task[LABEL_SIZE];
    RTS_UI32 value;
    memcpy(&value, (const char *)info + of_task[which].offset, sizeof(value));
    put("plcrt_%s{plc=\"%s\",task=\"%s\"} ", of_task[which].name, metrics.plc, as_label(info->name, task));
    if (of_task[which].is_time) {
        put("%u.%06u\n", (unsigned)(value / 1000000), (unsigned)(value % 1000000));
    } else {
        put("%u\n", (unsigned)value);
    }
}

static void put_tasks(void)
{
    IEC_TASK_INFO info[APP_MAX_TASKS];
    RTS_UI32 count = 0;
    while (count < APP_MAX_TASKS && IecTaskGetInfo(count, &info[count]) == ERR_OK) {
        count++;
    }
    for (size_t which = 0; which < RTS_COUNT(of_task); which++) {
        put_family(of_task[which].name, of_task[which].type, of_task[which].help);
        for (RTS_UI32 i = 0; i < count; i++) {
            put_of_task(&info[i], which);
        }
    }
}

/* ---- the file ---- */

static int write_file(void)
{
    int file = NewFileOpen(metrics.path, READABLE);
    if (file < 0) {
        return errno;
    }
    return NewFileEnd(file, metrics.path, NewFileWrite(file, metrics.text, metrics.size));
}

static void note_result(int error)
{
    if (error != 0 && metrics.error == 0) {
        LogAdd(CMPID_CmpMgr, LOG_WARNING, ERR_FAILED, "The metrics are not written to %s: %s", metrics.path,
               strerror(error));
    }
    metrics.error = error;
    metrics.written |= error == 0;
}

void PortMetricsSet(const char *path, RTS_UI32 interval_s)
{
    struct timespec now;
    char name[LABEL_SIZE / 2];
    const char *slash = strrchr(path, '/');
    clock_gettime(CLOCK_REALTIME, &now);
    metrics.path = path;
    metrics.interval_ms = interval_s * 1000;
    metrics.start_s = now.tv_sec;
    (void)snprintf(name, sizeof(name), "%s", slash != NULL ? slash + 1 : path);
    name[strcspn(name, ".")] = '\0';
    (void)as_label(name, metrics.plc);
}

void PortMetricsPass(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();
    if (metrics.path == NULL || (RTS_I32)(now_ms - metrics.due_ms) < 0) {
        return;
    }
    metrics.due_ms = now_ms + metrics.interval_ms;
    metrics.size = 0;
    put_info();
    put_application();
    put_log();
    put_lines();
    put_tasks();
    note_result(write_file());
}

void PortMetricsEnd(void)
{
    if (metrics.written) {
        (void)unlink(metrics.path);
    }
}
