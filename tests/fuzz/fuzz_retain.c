/*
 * fuzz_retain.c - anything in the log of retain variables: the application runs, and its values are saved again.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "fuzz_log.h"

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    return fuzz_log_seed(FILE_RETAIN, index, data, capacity);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_start_with(FILE_RETAIN, data, size);
    FUZZ_CHECK(app_state() == AS_RUN && read_u32(APP_AREA_DATA, STEP_OFFSET) == 2);
    FUZZ_CHECK(SimAdvance(ms(50)) == ERR_OK);
    FUZZ_CHECK(AppReset(RESET_OPTION_WARM) == ERR_OK && AppStartApplication() == ERR_OK); /* saves */
    FUZZ_CHECK(SimAdvance(ms(50)) == ERR_OK);
    FUZZ_CHECK(AppReset(RESET_OPTION_COLD) == ERR_OK && AppStartApplication() == ERR_OK);
    FUZZ_CHECK(SimAdvance(ms(50)) == ERR_OK);
    FUZZ_CHECK(app_state() == AS_RUN && read_u32(APP_AREA_DATA, STEP_OFFSET) == 2);
    fuzz_check_can_be_flashed();
    return 0;
}
