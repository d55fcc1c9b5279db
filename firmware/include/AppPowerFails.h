/*
 * AppPowerFails.h - a port tells that the power is about to fail. Manual 3.3.5.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * docs/retain.md has the time that the power must hold out. With APP_POWER_FAIL.
 */
#ifndef APPPOWERFAILS_H
#define APPPOWERFAILS_H

/* Main saves retain variables in its next pass, before it serves tools. From any context, interrupts and signal handlers
 * too. Wake main if it sleeps. */
void AppPowerFails(void);

#endif
