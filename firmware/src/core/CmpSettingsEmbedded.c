/*
 * CmpSettingsEmbedded.c - settings from a constant table of the port.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpSettingsEmbedded.h"

#include <string.h>

#include "rts_config.h"

typedef struct {
    const char *component;
    const char *key;
    RTS_I32 number;
    const char *text; /* NULL: the value is the number */
} SETTING;

static const SETTING settings[] = {SETTINGS_TABLE{NULL, NULL, 0, NULL}};

static const SETTING *find(const char *component, const char *key)
{
    const SETTING *s;

    for (s = settings; s->component != NULL; s++) {
        if (strcmp(s->component, component) == 0 && strcmp(s->key, key) == 0)
            return s;
    }
    return NULL;
}

RTS_I32 SettgGetIntValue(const char *component, const char *key, RTS_I32 otherwise)
{
    const SETTING *s = find(component, key);

    return s != NULL && s->text == NULL ? s->number : otherwise;
}

const char *SettgGetStringValue(const char *component, const char *key, const char *otherwise)
{
    const SETTING *s = find(component, key);

    return s != NULL && s->text != NULL ? s->text : otherwise;
}
