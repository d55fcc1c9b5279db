/*
 * SettingsCheck.h - the list of settings for users, and what is wrong with a text of them (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From any context.
 */
#ifndef SETTINGSCHECK_H
#define SETTINGSCHECK_H

#include "CmpStd.h"
#ifndef RTS_CFFI
#include "IniText.h"
#endif

enum { SETTING_IS_NUMBER, SETTING_IS_CHOICE, SETTING_IS_OPTION, SETTING_IS_FLAG };

/* The largest text that a device reads [bytes]. */
enum { SETTINGS_FILE_SIZE = 1024, SETTINGS_WORDS_SIZE = 200 };

typedef struct {
    const char *component;
    const char *key;
    RTS_UI32 type;    /* SETTING_IS_* */
    RTS_I32 standard; /* of a number */
    RTS_I32 least;
    RTS_I32 most;
    const char *words;    /* of a choice or flag: what it may be, divided by "|", the standard first; else "" */
    const char *option;   /* of plcrt, without "--"; "" for what all devices have */
    const char *sentence; /* what it is, for users */
} SETTING_INFO;

/* Setting number `index` of the list; NULL after the last one. */
const SETTING_INFO *SettingsInfo(RTS_UI32 index);

/* Finds the first fault of a text from line `from` on: a line that is not one, a setting that does not exist, twice the same,
 * or a value out of its limits. Returns its line and a sentence in `words` (SETTINGS_WORDS_SIZE); 0: no fault. */
RTS_UI32 SettingsCheck(const char *text, RTS_UI32 size, RTS_UI32 from, char *words);

/* Where in a text the value of setting number `index` is; false if it has none that is valid. */
bool SettingsValue(const char *text, RTS_UI32 size, RTS_UI32 index, RTS_UI32 *start, RTS_UI32 *length);

#ifndef RTS_CFFI
/* True if `value` is one of `words`, or without words a number within the limits; *number is it, or the index of the word. */
bool SettingsTake(const INI_PART *value, const char *words, RTS_I32 least, RTS_I32 most, RTS_I32 *number);

#endif

#endif
