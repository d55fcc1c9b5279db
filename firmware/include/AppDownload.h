/*
 * AppDownload.h - downloading a new application (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only.
 */
#ifndef APPDOWNLOAD_H
#define APPDOWNLOAD_H

#include "AppRefusal.h"
#include "CmpErrors.h"
#include "CmpStd.h"

/*
 * Download. Begin opens the idle slot (erases lazily, sector by sector), Write appends, End checks everything
 * and, only when all is well, commits the slot, stops the old application and loads the new one (state AS_STOP).
 * On any error the old application goes on, untouched; except that when a driver refuses the I/O configuration of the new
 * one, or its tasks cannot be created, it is loaded again, with its retain variables, and started if it ran.
 *
 * Begin: ERR_NOMEMORY too large for the slot. Write: ERR_INVALID_SEQUENCE not begun or `offset` is not what
 * AppDownloadOffset says; ERR_DEVICE flash fault, which ends the download. End: the reason as ERR_* and in *refusal
 * (never NULL).
 */
RTS_RESULT AppDownloadBegin(RTS_UI32 total_size, RTS_UI32 image_crc);
RTS_RESULT AppDownloadWrite(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size);
/* The same for data that are packed (Unpack.h) and unpack to `unpacked` bytes, if the runtime can (APP_UNPACK_SIZE).
 * ERR_NO_CONSISTENCY, ERR_OUT_OF_LIMITS: they do not; that ends the download too. */
RTS_RESULT AppDownloadUnpack(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked);
RTS_UI32 AppDownloadOffset(void); /* bytes received so far; an aborted transfer continues here */
/* Whether the download that has begun is that of this image. It outlives the channel it came through. */
bool AppDownloadIsOf(RTS_UI32 total_size, RTS_UI32 image_crc);
bool AppDownloadIsOpen(void);
RTS_RESULT AppDownloadEnd(APP_REFUSAL *refusal);
/* The same for an online change (AppChange.h), with ONLINE_CHANGE: the application goes on in the new image, or as it was. */
RTS_RESULT AppDownloadChange(APP_REFUSAL *refusal);
void AppDownloadAbort(void);

/* With BOOT_ON_DEMAND: AppDownloadEnd, but the application is not what boots, and nothing about it is in a record: after the
 * power was off the previous one runs, with its own retain variables. So it does when the next download begins, which
 * needs the room of this one. Without a previous one nothing boots. */
RTS_RESULT AppDownloadTry(APP_REFUSAL *refusal);

bool AppDownloadTriesAll(void); /* a setting wants it of each download that says nothing of it */
bool AppDownloadIsTried(void);  /* the application is one of AppDownloadTry */

/* Makes the application what boots; ERR_OK if it is already. ERR_APP_NOT_LOADED; ERR_CALL_AGAIN within an event;
 * ERR_APP_CREATE_BOOTPROJECT_FAILED: the flash cannot be written, and the previous one still boots. */
RTS_RESULT AppCreateBootProject(void);

#endif
