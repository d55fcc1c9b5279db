/*
 * CmpRetain.h - retain variables in flash. Manual 3.3.5.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The retain area lives in RAM. It is saved as a whole, from main: on stop and shutdown, and at most every
 * APP_RETAIN_SAVE_US when it changed. A record belongs to one layout of variables and is restored only into the same.
 * All from main.
 */
#ifndef CMPRETAIN_H
#define CMPRETAIN_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"

/* The largest retain area that can be saved, bytes. */
RTS_UI32 RetainCapacity(void);

/* From now on `size` bytes at `area` are kept; `layout` names their layout. Size 0: nothing is kept. */
void RetainAttach(RTS_UI8 *area, RTS_UI32 size, RTS_UI32 layout);

/* Number of the newest record. */
RTS_UI32 RetainGetSequence(void);

/* Fills the area with what was saved last for this layout, in a record after number `after`, up to `until`.
 * ERR_NO_OBJECT: there is none, the area is as it was. */
RTS_RESULT RetainRestore(RTS_UI32 after, RTS_UI32 until);

/* Saves the area when it is not what was saved last, or always; no task runs. ERR_DEVICE flash fault. */
RTS_RESULT RetainSave(bool always);

/* From now on the record numbered `until`, or the newest before it, is kept in flash, whatever is saved. It is that of
 * the application before, as long as the device may go back to it. */
void RetainKeep(RTS_UI32 until);
void RetainKeepNone(void);

RTS_RESULT CmpRetain_Hook(CMP_HOOK hook);

#endif
