/*
 * SettingValues.c - the values of settings, as they are before a file is read.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Apart from CmpSettings.c: what reads a value needs no file store.
 */
#include "SettingValues.h"

#if SETTINGS
RTS_I32 setting_values[SETTING_VALUES] = {
#define SETTING_NUMBER(id, component, key, standard, least, most, sentence) standard,
#define SETTING_CHOICE(id, component, key, words, sentence) 0,
#define SETTING_OPTION(id, component, key, option, sentence)
#define SETTING_FLAG(id, component, key, option, sentence)
#include "CmpSettingNames.h"
#undef SETTING_NUMBER
#undef SETTING_CHOICE
#undef SETTING_OPTION
#undef SETTING_FLAG
};
#endif
