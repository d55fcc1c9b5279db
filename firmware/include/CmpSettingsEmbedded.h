/*
 * CmpSettingsEmbedded.h - settings from a constant table of the port. Manual 3.8.2.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The port lists its values in rts_config_port.h: #define SETTINGS_TABLE {"CmpXxx", "Key", 1, NULL}, {"CmpXxx", "Name",
 * 0, "text"},
 */
#ifndef CMPSETTINGSEMBEDDED_H
#define CMPSETTINGSEMBEDDED_H

#include "CmpStd.h"

/* The value of component's `key` in the table of the port (SETTINGS_TABLE), or `otherwise` when the table has none (of this
 * type). From any context. */
RTS_I32 SettgGetIntValue(const char *component, const char *key, RTS_I32 otherwise);
const char *SettgGetStringValue(const char *component, const char *key, const char *otherwise);

#endif
