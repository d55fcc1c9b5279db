/*
 * LogReport.h - what plcrt prints of its log, and how many entries of a class there were.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef LOGREPORT_H
#define LOGREPORT_H

#include "CmpStd.h"

/* Takes the entries since the last call. In the journal of systemd all of them are printed, elsewhere the errors, if
 * `errors`. Returns true if there was an error. From main. */
bool PortLogReport(bool errors);

/* Entries of one class (LOG_ERROR ...) that were taken. From main. */
RTS_UI32 PortLogCount(RTS_UI32 log_class);

#endif
