/*
 * fuzz_settings.c - any text of settings: each fault has a line and a sentence, and a text without faults is taken whole.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpSettings.h"
#include "SettingValues.h"
#include "SettingsCheck.h"
#include "fuzz.h"

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const char *const seeds[] = {
        "[CmpApp]\nBootproject.Start=clean\n[CmpRetain]\nSavePeriod=0x200\n",
        "\xEF\xBB\xBF; x\r\n[CmpLog]\r\nLogger.0.Filter = 7\r\nLogger.0.Filter=8\r\n// "
        "y\r\n[CmpRetian]\r\nSavePeriod=500",
        "[SysMdns]\nAnnounce=yes\n[CmpBlkDrvTcp]\nAddress=127.0.0.1:0\n#\n[]\n=\n[x\n",
    };

    (void)capacity;
    if (index >= RTS_COUNT(seeds))
        return 0;
    memcpy(data, seeds[index], strlen(seeds[index]));
    return strlen(seeds[index]);
}

static RTS_UI32 count_faults(const char *text, RTS_UI32 size)
{
    char words[SETTINGS_WORDS_SIZE];
    RTS_UI32 line = 0;
    RTS_UI32 faults = 0;
    RTS_UI32 next;

    while ((next = SettingsCheck(text, size, line + 1, words)) != 0) {
        FUZZ_CHECK(next > line && strlen(words) > 10);
        line = next;
        faults++;
    }
    return faults;
}

static void check_values(const char *text, RTS_UI32 size)
{
    RTS_UI32 start = 0;
    RTS_UI32 length = 0;

    for (RTS_UI32 i = 0; SettingsInfo(i) != NULL; i++)
        if (SettingsValue(text, size, i, &start, &length))
            FUZZ_CHECK(start <= size && length <= size - start);
}

/* What the runtime has taken is within its limits. */
static void check_taken(void)
{
    RTS_I32 number;
    char value[12];

    for (RTS_UI32 i = 0; i < SETTING_VALUES; i++) {
        const SETTING_INFO *info = SettingsInfo(i);
        INI_PART part = {value, (RTS_UI32)snprintf(value, sizeof(value), "%d", (int)setting_values[i])};
        if (info->type == SETTING_IS_NUMBER)
            FUZZ_CHECK(SettingsTake(&part, "", info->least, info->most, &number) && number == setting_values[i]);
        else
            FUZZ_CHECK(setting_values[i] >= 0 && setting_values[i] < 3);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    /* Of its own, so that the sanitizer sees what is read past its end. */
    char *text = malloc(size + (size == 0));

    FUZZ_CHECK(text != NULL);
    memcpy(text, data, size);
    (void)count_faults(text, (RTS_UI32)size);
    check_values(text, (RTS_UI32)size);
    SettingsGive(text, (RTS_UI32)size);
    FUZZ_CHECK(CmpSettings_Hook(CH_INIT_SYSTEM2) == ERR_OK);
    check_taken();
    SettingsGive(NULL, 0);
    free(text);
    return 0;
}
