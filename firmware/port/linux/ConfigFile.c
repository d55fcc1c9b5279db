/*
 * ConfigFile.c - plcrt --config: a file of settings, which may give all options.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "ConfigFile.h"

#include "CmpSettings.h"
#include "SettingsCheck.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static struct {
    char text[CONFIG_FILE_SIZE + 1];
    char cut[CONFIG_FILE_SIZE + 1]; /* the same, with a NUL after each value that was given */
    size_t size;
    INI_READER reader;
} config;

/* False: the reason is on stderr. */
static bool read_all(const char *path)
{
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        fprintf(stderr, "plcrt: %s cannot be read: %s\n", path, strerror(errno));
        return false;
    }
    errno = 0;
    config.size = fread(config.text, 1, sizeof(config.text), file);
    int error = ferror(file) ? errno : 0;
    (void)fclose(file);
    if (error != 0) {
        fprintf(stderr, "plcrt: %s cannot be read: %s\n", path, strerror(error));
    } else if (config.size > CONFIG_FILE_SIZE) {
        fprintf(stderr, "plcrt: %s has more than %d bytes: remove comments\n", path, CONFIG_FILE_SIZE);
    }
    return error == 0 && config.size <= CONFIG_FILE_SIZE;
}

static bool check_all(const char *path)
{
    char words[SETTINGS_WORDS_SIZE];
    RTS_UI32 line = 0;
    bool valid = true;
    while ((line = SettingsCheck(config.text, (RTS_UI32)config.size, line + 1, words)) != 0) {
        fprintf(stderr, "plcrt: %s:%u: %s\n", path, (unsigned)line, words);
        valid = false;
    }
    return valid;
}

bool ConfigFileRead(const char *path)
{
    if (!read_all(path) || !check_all(path)) {
        return false;
    }
    memcpy(config.cut, config.text, config.size);
    IniOpen(&config.reader, config.cut, (RTS_UI32)config.size);
    SettingsGive(config.text, (RTS_UI32)config.size);
    return true;
}

static const SETTING_INFO *find(const INI_PART *section, const INI_PART *key)
{
    const SETTING_INFO *info;
    RTS_UI32 index = 0;
    while ((info = SettingsInfo(index)) != NULL && !(IniIs(section, info->component) && IniIs(key, info->key))) {
        index++;
    }
    return info;
}

/* What follows a value is the end of its line, or of the text. */
static char *cut_off(const INI_PART *value)
{
    char *text = config.cut + (value->text - config.cut);
    text[value->size] = '\0';
    return text;
}

bool ConfigFileNext(CONFIG_OPTION *next)
{
    INI_ENTRY entry;
    INI_KIND kind;
    while ((kind = IniNext(&config.reader, &entry)) != INI_END) {
        const SETTING_INFO *info = kind == INI_VALUE ? find(&config.reader.section, &entry.key) : NULL;
        if (info == NULL || info->option[0] == '\0' || (info->type == SETTING_IS_FLAG && IniIs(&entry.value, "no"))) {
            continue;
        }
        next->option = info->option;
        next->value = info->type == SETTING_IS_FLAG ? NULL : cut_off(&entry.value);
        next->line = (unsigned)config.reader.line;
        return true;
    }
    return false;
}

/* A line that changes nothing: the standard of what has one. */
static void print_setting(const SETTING_INFO *info)
{
    printf("; %s", info->sentence);
    if (info->type == SETTING_IS_NUMBER) {
        printf("; %d to %d\n;%s=%d\n", (int)info->least, (int)info->most, info->key, (int)info->standard);
    } else if (info->type == SETTING_IS_OPTION) {
        printf("; as --%s\n;%s=\n", info->option, info->key);
    } else {
        printf("; %s\n;%s=%.*s\n", info->words, info->key, (int)strcspn(info->words, "|"), info->words);
    }
}

void ConfigFileHelp(void)
{
    const SETTING_INFO *info;
    const char *section = "";
    printf("; Settings of plcrt --config FILE. Remove the ; before the ones that you want.\n");
    for (RTS_UI32 index = 0; (info = SettingsInfo(index)) != NULL; index++) {
        if (strcmp(section, info->component) != 0) {
            section = info->component;
            printf("\n[%s]\n", section);
        }
        print_setting(info);
    }
}
