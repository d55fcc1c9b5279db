/*
 * SettingValues.h - reads the values of settings.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpSettings.h says where they come from.
 */
#ifndef SETTINGVALUES_H
#define SETTINGVALUES_H

#include "CmpStd.h"
#include "rts_config.h"

/* Numbers and choices come first: they have values. */
typedef enum {
#define SETTING_NUMBER(id, component, key, standard, least, most, sentence) SETTING_##id,
#define SETTING_CHOICE(id, component, key, words, sentence) SETTING_##id,
#define SETTING_OPTION(id, component, key, option, sentence)
#define SETTING_FLAG(id, component, key, option, sentence)
#include "CmpSettingNames.h"
#undef SETTING_NUMBER
#undef SETTING_CHOICE
    SETTING_VALUES
} SETTING_ID;

enum {
#define SETTING_NUMBER(id, component, key, standard, least, most, sentence) SETTING_##id##_STANDARD = (standard),
#define SETTING_CHOICE(id, component, key, words, sentence) SETTING_##id##_STANDARD = 0,
#include "CmpSettingNames.h"
#undef SETTING_NUMBER
#undef SETTING_CHOICE
#undef SETTING_OPTION
#undef SETTING_FLAG
};

/* The words of Bootproject.Start. */
enum { BOOT_START_ALWAYS, BOOT_START_NEVER, BOOT_START_CLEAN };

/* The value of a number or choice, as CH_INIT_SYSTEM2 has read it. A constant without SETTINGS. From any context. */
#if SETTINGS
extern RTS_I32 setting_values[SETTING_VALUES];
#define SETTING(id) setting_values[SETTING_##id]
#else
#define SETTING(id) ((RTS_I32)SETTING_##id##_STANDARD)
#endif

#endif
