/*
 * Metrics.h - figures of the controller as a text file that Prometheus reads (plcrt --metrics).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef METRICS_H
#define METRICS_H

#include "CmpStd.h"

enum {
    METRICS_S = 15,            /* how often the file is written if the user does not say */
    METRICS_LONGEST_S = 86400, /* the longest interval */
};

/* Where the file is written, and how often [s]; NULL: nowhere. `path` stays. Before CMInit. */
void PortMetricsSet(const char *path, RTS_UI32 interval_s);

/* Writes the file if it is due. A file that cannot be written is a warning in the log, once until it can be written
 * again. From main, in each pass. */
void PortMetricsPass(void);

/* Removes the file at an orderly end, so that no reader takes its figures for those of a controller that runs. */
void PortMetricsEnd(void);

#endif
