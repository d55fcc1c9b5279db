/*
 * fuzz_commit.c - anything in the commit log: the device starts, runs nothing but a whole application, and takes
 * another one.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "fuzz_log.h"

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    return fuzz_log_seed(FILE_COMMIT, index, data, capacity);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    APP_STATUS status;
    RTS_UI32 step;

    fuzz_start_with(FILE_COMMIT, data, size);
    FUZZ_CHECK(SimAdvance(ms(50)) == ERR_OK);
    AppGetStatus(&status);
    if (status.state != AS_NONE) {
        step = read_u32(APP_AREA_DATA, STEP_OFFSET);
        FUZZ_CHECK(step == 1 || step == 2);
        FUZZ_CHECK(status.image_crc == image_crc(&fuzz_images[step]));
    }
    fuzz_check_can_be_flashed();
    return 0;
}
