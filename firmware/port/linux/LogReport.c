/*
 * LogReport.c - passes the log on to stderr, and counts its entries.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A user who starts plcrt sees the errors of start-up and end. Under systemd stderr is the journal, which gets the whole
 * log, as long as it takes something: plcrt does not wait for a journal that is stuck.
 */
#define _GNU_SOURCE
#include "LogReport.h"

#include "CmpLog.h"
#include "port.h"

#include <poll.h>
#include <unistd.h>

enum { CLASSES = 5 }; /* LOG_INFO .. LOG_DEBUG, one bit each */

static struct {
    RTS_UI32 last; /* handle of the last entry that was taken */
    bool waited;   /* for the entry after it, which a task may be writing */
    RTS_UI32 count[CLASSES];
} report;

static RTS_UI32 index_of(RTS_UI32 log_class)
{
    RTS_UI32 index = 0;
    while (index < CLASSES - 1 && log_class >> index > 1) {
        index++;
    }
    return index;
}

static PORT_LEVEL level_of(RTS_UI32 log_class)
{
    static const PORT_LEVEL levels[CLASSES] = {PORT_INFO, PORT_WARNING, PORT_ERROR, PORT_CRITICAL, PORT_DEBUG};
    return levels[index_of(log_class)];
}

/* False if a write to stderr would wait. */
static bool stderr_takes(void)
{
    struct pollfd polled = {.fd = STDERR_FILENO, .events = POLLOUT};
    return poll(&polled, 1, 0) > 0;
}

/* True if the next entry is missing: for one pass it may be that a task is writing it, after that it is lost. */
static bool waits_for_one_before(const LOG_ENTRY *entry)
{
    bool missing = entry->handle > report.last + 1;
    report.waited = missing && !report.waited;
    return report.waited;
}

static void print_entry(const LOG_ENTRY *entry)
{
    if (entry->handle > report.last + 1) {
        PortPrint(PORT_WARNING, "%u entries of the log were lost", (unsigned)(entry->handle - report.last - 1));
    }
    PortPrint(level_of(entry->log_class), "%s: %s", CMGetComponentName(entry->component), entry->text);
}

bool PortLogReport(bool errors)
{
    LOG_ENTRY entry;
    bool found = false;
    bool journal = PortIsJournal();
    while ((!journal || stderr_takes()) && LogGetEntry(report.last + 1, &entry) == ERR_OK &&
           !waits_for_one_before(&entry)) {
        if (journal) {
            print_entry(&entry);
        } else if (errors && entry.log_class == LOG_ERROR) {
            PortPrint(PORT_ERROR, "%s", entry.text);
        }
        found |= entry.log_class == LOG_ERROR;
        report.count[index_of(entry.log_class)]++;
        report.last = entry.handle;
    }
    return found;
}

RTS_UI32 PortLogCount(RTS_UI32 log_class)
{
    return report.count[index_of(log_class)];
}
