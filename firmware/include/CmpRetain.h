/*
 * CmpRetain.h - RETAIN and PERSISTENT variables in flash. Manual 3.3.5.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The retain area lives in RAM. It is saved as a whole: on stop, at the end of the application, and at most every
 * APP_RETAIN_SAVE_US when it changed. A record is the state of one moment between the cycles of all tasks, and belongs
 * to one image.
 *
 * When an application begins, values come from a source: the last record, the record of the previous application, or what
 * the variables are at a reset. The source is chosen first (RetainLoad, RetainCapture); the values are put back, variable
 * by variable as the table in the image says, when the initial values are there; and they count, and are saved, when the
 * initialisation is over. Until then all of it can be done again: a power cut loses nothing.
 *
 * All from main.
 */
#ifndef CMPRETAIN_H
#define CMPRETAIN_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"
#include "RetainTable.h"
#include "SysFlashLog.h"
#include "rts_config.h"

/* The largest retain area that can be saved, bytes. */
RTS_UI32 RetainCapacity(void);

/* From now on the variables of a checked table are kept, in the area at `area`, in records with this tag, which is the
 * CRC of the image. The table stays where it is. They have no source yet. */
void RetainAttach(RTS_UI8 *area, const RETAIN_TABLE *table, RTS_UI32 tag);
void RetainDetach(void);

/* Number of the newest record. */
RTS_UI32 RetainGetSequence(void);

/* The source is the newest record in the range of the application whose checked table is `table`: this one's, all of
 * whose values are kept, or that of the previous application, of which PERSISTENT values are kept where name and type are
 * as they were. Those of its own are in the area at once, which is zero, so that they can be read while the application waits.
 * ERR_NO_OBJECT: there is none. */
RTS_RESULT RetainLoad(const RETAIN_TABLE *table, RTS_UI32 tag, FLASH_LOG_RANGE range);

/* The source is what the variables are now; a cold reset keeps PERSISTENT ones only. While there are none, and after an
 * initialisation that failed, the source stays the same. */
void RetainCapture(bool cold);

/* Puts the values back; the area has its initial values. */
void RetainPutBack(void);

/* The initialisation is over: what the variables are now is saved. After one that failed only what comes from the
 * previous application, whose own table will be gone. */
void RetainSettle(bool failed);

/* Saves what counts when it is not what was saved last, or always; no task runs. ERR_DEVICE flash fault. */
RTS_RESULT RetainSave(bool always);

/* An online change: the variables stay where they are, and from now on the table, checked, is this one, and records have
 * this tag. No task is in its cycle. RetainSaveExchanged saves what they were then. */
void RetainExchange(const RETAIN_TABLE *table, RTS_UI32 tag);
RTS_RESULT RetainSaveExchanged(void);

/* From now on the record numbered `until`, or the newest before it, is kept in flash, whatever is saved. It is that of
 * the previous application, as long as the device may go back to it. */
void RetainKeep(RTS_UI32 until);
void RetainKeepNone(void);

/* ---- a copy of them, for a file ---- */

#if FILE_STORE_FILES > 0
/* What was saved last: `size` bytes of the application with this tag. They stay as they are while RetainGetSequence is the
 * same. NULL: nothing is kept, or a save is under way. */
const RTS_UI8 *RetainGetSaved(RTS_UI32 *size, RTS_UI32 *tag);

/* Where RetainRestore takes values from: as much room as RetainGetSaved has, whose bytes are lost. */
RTS_UI8 *RetainGetRoom(void);

/* The bytes in the room become the values, and are saved, as a whole; or the room is given up. No task runs. */
RTS_RESULT RetainRestore(bool valid);
#if ONLINE_CHANGE
/* The same for values of the program that the loaded one has replaced, with the table of that: variables that both have get
 * them, if they fit. */
RTS_RESULT RetainRestoreFrom(const RETAIN_TABLE *table);
#endif
#endif

RTS_RESULT CmpRetain_Hook(CMP_HOOK hook);

#endif
