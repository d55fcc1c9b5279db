/*
 * AppRetain.h - the retain variables of an application that is loaded.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only.
 */
#ifndef APPRETAIN_H
#define APPRETAIN_H

#include "../load/AppLoaded.h"
#include "CmpErrors.h"

/*
 * Finds where the retain variables of an image, in the area at `area`, come from: its own record up to number
 * `retain_until`, or the PERSISTENT ones of the previous application. ERR_OK: all of them are kept. The image stays where
 * it is until RetainDetach.
 */
RTS_RESULT AppRetainLoad(const APP_IMAGE *image, RTS_UI8 *area, RTS_UI32 retain_until);

#endif
