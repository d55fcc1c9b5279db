/*
 * AppRefusal.h - why an image was refused, in words (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPREFUSAL_H
#define APPREFUSAL_H

#include "CmpStd.h"
#include "rts_config.h"

enum { APP_REFUSAL_SIZE = APP_REFUSAL_TEXT_SIZE };

/* Why a download was refused: a sentence, cut to fit; "" when it was not. */
typedef struct {
    char text[APP_REFUSAL_SIZE];
} APP_REFUSAL;

#ifndef RTS_CFFI
/* Writes why, and returns `result`. A macro, so that sentences that are never sent take no flash. */
#define APP_REFUSE(refusal, result, ...) \
    (APP_REFUSAL_TEXT_SIZE > 1 ? AppRefuse(refusal, result, __VA_ARGS__) : (RTS_RESULT)(result))
RTS_RESULT AppRefuse(APP_REFUSAL *refusal, RTS_RESULT result, const char *format, ...) RTS_FORMAT(3, 4);
#endif

#endif
