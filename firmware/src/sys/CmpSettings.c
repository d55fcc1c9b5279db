/*
 * CmpSettings.c - the values of settings: from a text, the table of the port, or the standard.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * They are read once, at start-up. A line that is not valid costs a warning, never the start: a device that does not
 * start cannot be given another file.
 */
#include "CmpSettings.h"

#include <string.h>

#include "CmpErrors.h"
#include "CmpLog.h"
#include "CmpSettingsEmbedded.h"
#include "FileStore.h"
#include "SettingValues.h"
#include "SettingsCheck.h"

#if SETTINGS

typedef struct {
    const char *component;
    const char *key;
    const char *words; /* "" for a number */
    RTS_I32 standard;
    RTS_I32 least;
    RTS_I32 most;
} LIMITS;

static const LIMITS limits[SETTING_VALUES] = {
#define SETTING_NUMBER(id, component, key, standard, least, most, sentence) {component, key, "", standard, least, most},
#define SETTING_CHOICE(id, component, key, words, sentence) {component, key, words, 0, 0, 0},
#define SETTING_OPTION(id, component, key, option, sentence)
#define SETTING_FLAG(id, component, key, option, sentence)
#include "CmpSettingNames.h"
#undef SETTING_NUMBER
#undef SETTING_CHOICE
#undef SETTING_OPTION
#undef SETTING_FLAG
};

static INI_PART given; /* without a text: none */

void SettingsGive(const char *text, RTS_UI32 size)
{
    given.text = text;
    given.size = size;
}

bool SettingsGiven(INI_PART *text)
{
    *text = given;
    return given.text != NULL;
}

static void take_table(void)
{
    RTS_UI32 i;

    for (i = 0; i < SETTING_VALUES; i++)
        setting_values[i] = SettgGetIntValue(limits[i].component, limits[i].key, limits[i].standard);
}

/* The number of the setting with this name, SETTING_VALUES if there is none. */
static RTS_UI32 find(const INI_PART *section, const INI_PART *key)
{
    RTS_UI32 i = 0;

    while (i < SETTING_VALUES && !(IniIs(section, limits[i].component) && IniIs(key, limits[i].key)))
        i++;
    return i;
}

/* False if the line is not valid. */
static bool take_line(const INI_READER *reader, const INI_ENTRY *entry)
{
    RTS_UI32 i = find(&reader->section, &entry->key);

    return i < SETTING_VALUES &&
           SettingsTake(&entry->value, limits[i].words, limits[i].least, limits[i].most, &setting_values[i]);
}

/* The first lines that are left out; the log has other things to show, too. */
enum { NAMED_LINES = 3 };

static void report_line(RTS_UI32 line, RTS_UI32 count)
{
    if (count <= NAMED_LINES)
        LogAdd(CMPID_CmpSettings, LOG_WARNING, ERR_PARAMETER,
               SETTINGS_FILE_NAME " line %u is left out: not valid, or only of plcrt --config", (unsigned)line);
}

static void take_text(const char *text, RTS_UI32 size)
{
    INI_READER reader;
    INI_ENTRY entry;
    INI_KIND kind;
    RTS_UI32 count = 0;

    IniOpen(&reader, text, size);
    while ((kind = IniNext(&reader, &entry)) != INI_END) {
        if (kind == INI_BAD || (kind == INI_VALUE && !take_line(&reader, &entry)))
            report_line(reader.line, ++count);
    }
    if (count > NAMED_LINES)
        LogAdd(CMPID_CmpSettings, LOG_WARNING, ERR_PARAMETER, SETTINGS_FILE_NAME ": %u more lines are left out",
               (unsigned)(count - NAMED_LINES));
}

#if FILE_STORE_FILES > 0
/* Not inlined: the text is on the stack. */
static RTS_NOINLINE void take_file(void)
{
    char text[SETTINGS_FILE_SIZE];
    const FILE_ENTRY *file;

    FileStoreOpen();
    file = FileStoreFind(SETTINGS_FILE_NAME);
    if (file == NULL)
        return;
    if (file->size > sizeof text || FileStoreRead(file, 0, text, file->size) != ERR_OK)
        LogAdd(CMPID_CmpSettings, LOG_WARNING, ERR_FAILED,
               SETTINGS_FILE_NAME " is left out: it cannot be read, or has more than %u bytes",
               (unsigned)SETTINGS_FILE_SIZE);
    else
        take_text(text, file->size);
}
#else
#define take_file() ((void)0)
#endif

/* It was checked, and has options beside values. */
static void take_given(void)
{
    INI_READER reader;
    INI_ENTRY entry;
    INI_KIND kind;

    IniOpen(&reader, given.text, given.size);
    while ((kind = IniNext(&reader, &entry)) != INI_END) {
        if (kind == INI_VALUE)
            (void)take_line(&reader, &entry);
    }
}

RTS_RESULT CmpSettings_Hook(CMP_HOOK hook)
{
    if (hook != CH_INIT_SYSTEM2)
        return ERR_OK;
    take_table();
    if (given.text != NULL)
        take_given();
    else
        take_file();
    return ERR_OK;
}

#endif
