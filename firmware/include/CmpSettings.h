/*
 * CmpSettings.h - settings: what a user may change without building the firmware again. Manual 3.8.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * docs/settings.md. Back ends are asked in turn: the command line of plcrt, the text (plcrt --config FILE, else
 * Settings.cfg of the file store), the table of the port (CmpSettingsEmbedded.h), the standard in CmpSettingNames.h.
 * Values count from the next start on. No client changes them by a service: a file is put, which needs the download right.
 */
#ifndef CMPSETTINGS_H
#define CMPSETTINGS_H

#include "CmpItf.h"
#include "IniText.h"

#define SETTINGS_FILE_NAME "Settings.cfg"

/* Takes this text in place of the file. It stays where it is. Before CMInit, from main. */
void SettingsGive(const char *text, RTS_UI32 size);

/* The text that was given; false: none, the file counts. */
bool SettingsGiven(INI_PART *text);

RTS_RESULT CmpSettings_Hook(CMP_HOOK hook);

#endif
