/*
 * fuzz_loader.c - any image with a right CRC: it is refused and the old application runs on, or it is loaded and can be
 * started, stopped and replaced.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: an image. Its size and CRC are made right, and its code does nothing but return: what any code can do is
 * tried by tests/attack, this is about what describes it.
 */
#include "CmpIecTask.h"
#include "app_image.h"
#include "fuzz.h"

enum { MAX_IMAGE = 8192, RUN_MS = 20 };

static APP_BYTES old;

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    APP_SPEC spec;
    APP_BYTES image;

    if (index > 1)
        return 0;
    spec_counter(&spec, 2);
    if (index == 1) {
        add_import(&spec, "simburn", 0x76DDCD81, 0x00010000);
        add_task(&spec, "Event", KIND_EVENT, 0, 0)->event_area = APP_AREA_DATA;
    }
    build_image(&image, &spec);
    if (image.size > capacity)
        return 0;
    memcpy(data, image.bytes, image.size);
    return image.size;
}

/* A device that runs application 1, which has proven itself. */
static void begin(void)
{
    static bool is_prepared;

    if (is_prepared)
        return;
    is_prepared = true;
    FUZZ_CHECK(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF) == ERR_OK);
    FUZZ_CHECK(SimStart() == ERR_OK);
    build_counter(&old, 1);
    FUZZ_CHECK(download(&old) == ERR_OK && AppStartApplication() == ERR_OK);
    FUZZ_CHECK(SimAdvance(ms(5000)) == ERR_OK);
    SimStop();
    FUZZ_CHECK(SimFlashSave() == ERR_OK);
    FUZZ_CHECK(SimStart() == ERR_OK);
}

static void fill_with_returns(APP_BYTES *image, CDL_SEGMENT code)
{
#if defined(__aarch64__)
    static const uint8_t ret[] = {0xC0, 0x03, 0x5F, 0xD6};
#elif defined(__arm__)
    static const uint8_t ret[] = {0x70, 0x47};
#else
    static const uint8_t ret[] = {0xC3};
#endif
    RTS_UI32 i;

    if (code.offset < CDL_HEADER_SIZE || code.offset > image->size || code.size > image->size - code.offset)
        return;
    for (i = 0; i < code.size; i++)
        image->bytes[code.offset + i] = ret[i % sizeof ret];
}

static void repair(APP_BYTES *image)
{
    CDL_HEADER header;

    if (image->size < CDL_HEADER_SIZE)
        return;
    header = image_header(image);
    header.total_size = image->size;
    fill_with_returns(image, header.code);
    image_set_header(image, header);
}

static void check_old_runs(void)
{
    FUZZ_CHECK(app_state() == AS_RUN && read_u32(APP_AREA_DATA, STEP_OFFSET) == 1);
}

/* All its information strings can be read, and it can be run. */
static void use(void)
{
    IEC_TASK_INFO info;
    RTS_UI32 i;

    for (i = 0; i < 8; i++)
        FUZZ_CHECK(strlen(AppGetInfo(i)) < APP_NAME_SIZE);
    for (i = 0; IecTaskGetInfo(i, &info) == ERR_OK; i++)
        FUZZ_CHECK(memchr(info.name, '\0', sizeof info.name) != NULL);
    FUZZ_CHECK(i <= APP_MAX_TASKS);
    (void)AppStartApplication();
    FUZZ_CHECK(SimAdvance(ms(RUN_MS)) == ERR_OK);
    FUZZ_CHECK(AppReset(RESET_OPTION_COLD) == ERR_OK);
    FUZZ_CHECK(AppReset(RESET_OPTION_WARM) == ERR_OK);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static APP_BYTES image;
    APP_REFUSAL refusal;

    if (size > MAX_IMAGE)
        return 0;
    begin();
    image.size = (RTS_UI32)size;
    memcpy(image.bytes, data, size);
    repair(&image);
    if (download_part(&image, image.size, &refusal) != ERR_OK) {
        check_old_runs();
    } else {
        use();
        SimStop();
        FUZZ_CHECK(SimFlashRestore() == ERR_OK && SimStart() == ERR_OK);
        check_old_runs();
    }
    FUZZ_CHECK(SimFlashViolations() == 0);
    return 0;
}
