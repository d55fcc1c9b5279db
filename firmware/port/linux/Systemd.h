/*
 * Systemd.h - tells systemd that plcrt is up, what its program does, and that main has its passes (sd_notify(3)).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Without NOTIFY_SOCKET in the environment nothing of it does anything.
 */
#ifndef SYSTEMD_H
#define SYSTEMD_H

/* Reads the environment that systemd has set for this process. Before the worker is forked. */
void PortSystemdInit(void);

/* plcrt is up: READY=1. By the worker, in each life. */
void PortSystemdReady(void);

/* Reports the state of the program when it has changed, and feeds the watchdog of the unit (WatchdogSec=) when half of its
 * time has passed. From main, in each pass: a main that hangs feeds no watchdog. */
void PortSystemdPass(void);

/* plcrt ends in order: STOPPING=1. */
void PortSystemdStopping(void);

#endif
