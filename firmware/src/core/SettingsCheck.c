/*
 * SettingsCheck.c - the list of settings with their sentences, and what is wrong with a text of them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For plcrt, which refuses to start with such a text, and plctool, which does so before it sends one.
 */
#include "SettingsCheck.h"

#include <string.h>

#include "CMUtils.h"
#include "rts_config.h"

/* Takes a word of the text and the "|" after it. */
static INI_PART next_word(const char **words)
{
    INI_PART word = {*words, 0};

    while (**words != '\0' && *(*words)++ != '|')
        word.size++;
    return word;
}

static bool take_word(const INI_PART *value, const char *words, RTS_I32 *number)
{
    RTS_I32 index;

    for (index = 0; *words != '\0'; index++) {
        INI_PART word = next_word(&words);
        if (word.size != value->size || memcmp(word.text, value->text, word.size) != 0)
            continue;
        *number = index;
        return true;
    }
    return false;
}

bool SettingsTake(const INI_PART *value, const char *words, RTS_I32 least, RTS_I32 most, RTS_I32 *number)
{
    RTS_I32 found;

    if (words[0] != '\0')
        return take_word(value, words, number);
    if (!IniNumber(value, &found) || found < least || found > most)
        return false;
    *number = found;
    return true;
}

static const SETTING_INFO settings[] = {
#define SETTING_NUMBER(id, component, key, standard, least, most, sentence) \
    {component, key, SETTING_IS_NUMBER, standard, least, most, "", "", sentence},
#define SETTING_CHOICE(id, component, key, words, sentence) \
    {component, key, SETTING_IS_CHOICE, 0, 0, 0, words, "", sentence},
#define SETTING_OPTION(id, component, key, option, sentence) \
    {component, key, SETTING_IS_OPTION, 0, 0, 0, "", option, sentence},
#define SETTING_FLAG(id, component, key, option, sentence) \
    {component, key, SETTING_IS_FLAG, 0, 0, 0, "no|yes", option, sentence},
#include "CmpSettingNames.h"
};

const SETTING_INFO *SettingsInfo(RTS_UI32 index)
{
    return index < RTS_COUNT(settings) ? &settings[index] : NULL;
}

/* ---- the name that was meant ---- */

enum { NAME_MOST = 40 };

static unsigned char lower(char c)
{
    return (unsigned char)(c >= 'A' && c <= 'Z' ? c | 0x20 : c);
}

static RTS_UI32 least_of(RTS_UI32 a, RTS_UI32 b)
{
    return a < b ? a : b;
}

/* Characters to insert, delete or replace, without regard to case; NAME_MOST for names that are too long. */
static RTS_UI32 distance(const INI_PART *name, const char *known)
{
    RTS_UI32 row[NAME_MOST + 1];
    RTS_UI32 length = (RTS_UI32)strlen(known);
    RTS_UI32 i;
    RTS_UI32 k;

    if (name->size > NAME_MOST || length > NAME_MOST)
        return NAME_MOST;
    for (k = 0; k <= length; k++)
        row[k] = k;
    for (i = 0; i < name->size; i++) {
        RTS_UI32 corner = row[0];
        row[0] = i + 1;
        for (k = 0; k < length; k++) {
            RTS_UI32 replaced = corner + (lower(name->text[i]) != lower(known[k]));
            corner = row[k + 1];
            row[k + 1] = least_of(replaced, least_of(corner, row[k]) + 1);
        }
    }
    return row[length];
}

/* NULL: none is near. The right key in another section is. */
static const SETTING_INFO *nearest(const INI_PART *section, const INI_PART *key)
{
    const SETTING_INFO *found = NULL;
    RTS_UI32 best = (section->size + key->size) / 3 + 1;
    RTS_UI32 i;

    for (i = 0; i < RTS_COUNT(settings); i++) {
        RTS_UI32 by_key = distance(key, settings[i].key);
        RTS_UI32 both = least_of(distance(section, settings[i].component), by_key < 2 ? 2 : NAME_MOST) + by_key;
        if (both < best) {
            best = both;
            found = &settings[i];
        }
    }
    return found;
}

/* ---- what is wrong ---- */

/* A name of the text for a sentence, cut. */
typedef char SHOWN[NAME_MOST + 4];

static const char *shown(const INI_PART *part, SHOWN text)
{
    RTS_UI32 size = least_of(part->size, NAME_MOST);

    memcpy(text, part->text, size);
    memcpy(text + size, part->size > NAME_MOST ? "..." : "", part->size > NAME_MOST ? 4 : 1);
    return text;
}

static const SETTING_INFO *find(const INI_PART *section, const INI_PART *key)
{
    RTS_UI32 i;

    for (i = 0; i < RTS_COUNT(settings); i++) {
        if (IniIs(section, settings[i].component) && IniIs(key, settings[i].key))
            return &settings[i];
    }
    return NULL;
}

static void say_unknown(const INI_PART *section, const INI_PART *key, char *words)
{
    const SETTING_INFO *meant = nearest(section, key);
    SHOWN section_text;
    SHOWN key_text;

    (void)shown(section, section_text);
    (void)shown(key, key_text);
    if (meant != NULL)
        CMUtlsnprintf(words, SETTINGS_WORDS_SIZE, "[%s] %s is not a setting: write [%s] %s if that is meant",
                      section_text, key_text, meant->component, meant->key);
    else
        CMUtlsnprintf(words, SETTINGS_WORDS_SIZE, "[%s] %s is not a setting: plcrt --help-config lists all",
                      section_text, key_text);
}

/* The words of a choice as a sentence has them: "always, never or clean". */
static void list_words(const char *words, char *text, RTS_UI32 size)
{
    RTS_UI32 used = 0;

    for (; *words != '\0' && used + 5 < size; words++) {
        const char *joint = strchr(words + 1, '|') != NULL ? ", " : " or ";
        if (*words != '|') {
            text[used++] = *words;
            continue;
        }
        memcpy(text + used, joint, strlen(joint));
        used += (RTS_UI32)strlen(joint);
    }
    text[used] = '\0';
}

static void say_value(const SETTING_INFO *info, const INI_PART *value, char *words)
{
    SHOWN text;
    char choice[48];

    (void)shown(value, text);
    list_words(info->words, choice, sizeof choice);
    if (info->type == SETTING_IS_NUMBER)
        CMUtlsnprintf(words, SETTINGS_WORDS_SIZE, "[%s] %s=%s is not valid: give a number from %d to %d",
                      info->component, info->key, text, (int)info->least, (int)info->most);
    else if (info->type == SETTING_IS_OPTION)
        CMUtlsnprintf(words, SETTINGS_WORDS_SIZE, "[%s] %s has no value: give one, or remove the line", info->component,
                      info->key);
    else
        CMUtlsnprintf(words, SETTINGS_WORDS_SIZE, "[%s] %s=%s is not valid: give %s", info->component, info->key, text,
                      choice);
}

static bool is_valid(const SETTING_INFO *info, const INI_PART *value)
{
    RTS_I32 number;

    return info->type == SETTING_IS_OPTION ? value->size > 0
                                           : SettingsTake(value, info->words, info->least, info->most, &number);
}

/* The line before `line` that has the same setting; 0: none. */
static RTS_UI32 first_line(const char *text, RTS_UI32 size, const SETTING_INFO *info, RTS_UI32 line)
{
    INI_READER reader;
    INI_ENTRY entry;
    INI_KIND kind;

    IniOpen(&reader, text, size);
    while ((kind = IniNext(&reader, &entry)) != INI_END && reader.line < line) {
        if (kind == INI_VALUE && find(&reader.section, &entry.key) == info)
            return reader.line;
    }
    return 0;
}

/* What is wrong with a line of a key and a value; false: nothing. */
static bool check_value(const char *text, RTS_UI32 size, const INI_READER *reader, const INI_ENTRY *entry, char *words)
{
    const SETTING_INFO *info = find(&reader->section, &entry->key);
    RTS_UI32 first;

    if (info == NULL) {
        say_unknown(&reader->section, &entry->key, words);
        return true;
    }
    if (!is_valid(info, &entry->value)) {
        say_value(info, &entry->value, words);
        return true;
    }
    first = first_line(text, size, info, reader->line);
    if (first != 0)
        CMUtlsnprintf(words, SETTINGS_WORDS_SIZE, "[%s] %s is in line %u already: remove one of the two",
                      info->component, info->key, (unsigned)first);
    return first != 0;
}

RTS_UI32 SettingsCheck(const char *text, RTS_UI32 size, RTS_UI32 from, char *words)
{
    INI_READER reader;
    INI_ENTRY entry;
    INI_KIND kind;

    IniOpen(&reader, text, size);
    while ((kind = IniNext(&reader, &entry)) != INI_END) {
        if (reader.line < from)
            continue;
        if (kind == INI_BAD) {
            CMUtlsnprintf(words, SETTINGS_WORDS_SIZE,
                          "not a setting: write [Component], Key=Value, or a comment after ;");
            return reader.line;
        }
        if (kind == INI_VALUE && check_value(text, size, &reader, &entry, words))
            return reader.line;
    }
    return 0;
}

bool SettingsValue(const char *text, RTS_UI32 size, RTS_UI32 index, RTS_UI32 *start, RTS_UI32 *length)
{
    const SETTING_INFO *info = SettingsInfo(index);
    bool found = false;
    INI_READER reader;
    INI_ENTRY entry;
    INI_KIND kind;

    IniOpen(&reader, text, size);
    while ((kind = IniNext(&reader, &entry)) != INI_END) {
        if (kind != INI_VALUE || info == NULL || find(&reader.section, &entry.key) != info ||
            !is_valid(info, &entry.value))
            continue;
        *start = (RTS_UI32)(entry.value.text - text);
        *length = entry.value.size;
        found = true; /* a later line takes its place */
    }
    return found;
}
