/*
 * AppCommit.h - which slot holds the application, and what is known about it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A slot says itself that its image is a program of the device: after the image follows a seal (AppRecord.h), so that the
 * newest program is found even when nothing else is left. What happened to the programs since is in a log of commit
 * records, each with the complete state of both slots: the newest valid one counts, unless a slot has a whole
 * image with a newer seal. From main only.
 */
#ifndef APPCOMMIT_H
#define APPCOMMIT_H

#include "AppRecord.h"
#include "CmpErrors.h"
#include "CmpStd.h"
#include "rts_config.h"

/* Finds out what is in flash. If the application failed, it is in that exception again. */
void AppCommitOpen(void);

/* ERR_OK, or ERR_DEVICE: a part of the log cannot be read. What is known comes from the remaining records and the seals;
 * no record is written, because a later start may find a newer one. */
RTS_RESULT AppCommitResult(void);

/* The record in force. */
const COMMIT *AppCommitGet(void);

/* Whether the application in `slot` has proven itself. */
bool AppCommitIsProven(RTS_UI32 slot);

/* Whether the active application failed, and is run on request only. */
bool AppCommitIsDead(void);

/* The slot that is not `slot`; of SLOT_NONE the first. */
RTS_UI32 AppCommitOtherSlot(RTS_UI32 slot);

/* Seals the image in `slot`, whose file ends with it: from now on it is what boots, a trial. On ERR_DEVICE what was
 * before still is, and the image is deleted. */
RTS_RESULT AppCommitInstall(RTS_UI32 slot, RTS_UI32 crc, RTS_UI32 retain_after);

#if BOOT_ON_DEMAND
/* The image in `slot` counts as AppCommitInstall makes it count, but not in flash: no record is written that knows of it,
 * and it has not proven itself. It ends with AppCommitSeal, AppCommitEndTry, a rollback, or AppCommitErase. */
void AppCommitTry(RTS_UI32 slot, RTS_UI32 size, RTS_UI32 crc, RTS_UI32 retain_after);
bool AppCommitIsTried(void);

/* Seals the image that is tried. On ERR_DEVICE it goes on as it was. */
RTS_RESULT AppCommitSeal(void);

/* What boots is what counts again. */
void AppCommitEndTry(void);
#else
#define AppCommitIsTried() false
#define AppCommitEndTry() ((void)0)
#endif

/* Takes AppCommitInstall back before a record knows of it: the image in `slot` is deleted, and what was before is again. */
void AppCommitTakeBack(RTS_UI32 slot);

/*
 * Each of these writes a record that is in force from then on, atomically. ERR_DEVICE flash fault: the previous one
 * stays, or it is this one but may be lost when power is.
 */

/* Nothing boots. AppCommitWipe follows. On an error the previous record stays. */
RTS_RESULT AppCommitErase(void);

/* The slot that is not `failed` is what boots; its retain records are those after `retain_after`. The other is wiped. */
RTS_RESULT AppCommitRollBack(RTS_UI32 failed, RTS_UI32 retain_after);

/* A new state of the image in `slot`, and the exception it is in. Writes nothing when it has proven itself, or that is
 * its state already. */
RTS_RESULT AppCommitSetState(RTS_UI32 slot, RTS_UI8 state);

/* The active one failed by the exception it is in: SLOT_FAILED, or SLOT_HALTED when it has proven itself. */
void AppCommitSetDead(const char *text);

/* The initialisation of the application in `slot` begins, and has ended. Of one that only stands in for the active one
 * (AppBoot.c) nothing is noted. */
void AppCommitBegin(RTS_UI32 slot);
void AppCommitDone(RTS_UI32 slot);

/* Makes what is in a slot unusable, so that no lost record brings it back. */
void AppCommitWipe(RTS_UI32 slot);

#endif
