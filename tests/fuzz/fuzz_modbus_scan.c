/*
 * fuzz_modbus_scan.c - any bytes as what the devices of a Modbus line say of themselves.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A row of replies: a byte with the length, and the bytes of the PDU, which gets the unit that was asked, and a CRC. A
 * length of 0 is a device that is silent.
 */
#include <string.h>

#include "ModbusRtu.h"
#include "ModbusScan.h"
#include "fuzz.h"
#include "modbus_fakes.h"

enum { STEP_NS = 250000, STEPS = 2000 };

static MODBUS_CLIENT client;
static MODBUS_CALL calls[1];

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t seeds[][24] = {
        {15, 43, 14, 1, 0x81, 0, 0, 2, 0, 3, 'A', 'B', 'C', 1, 1, 'D'},
        {2, 0xAB, 1, 9, 17, 7, 1, 0xFF, 'P', 'u', 'm', 'p', '1'},
        {0, 2, 0xAB, 11, 2, 0xAB, 1},
        {7, 43, 14, 1, 0x81, 0, 0, 3, 9, 43, 14, 1, 0x81, 0, 0, 1, 0, 0xFF},
    };
    static const uint8_t sizes[] = {16, 13, 7, 18};

    if (index >= sizeof(sizes) || capacity < sizes[index])
        return 0;
    memcpy(data, seeds[index], sizes[index]);
    return sizes[index];
}

static void begin(void)
{
    const SYSCOM_SETTINGS settings = {115200, SYSCOM_PARITY_EVEN, 1, false};

    ModbusScanEnd();
    fakes_begin();
    fakes.char_ns = 95000;
    memset(&client, 0, sizeof(client));
    memset(calls, 0, sizeof(calls));
    ModbusRtuBegin(&client.link, 0, &settings);
    ModbusClientBegin(&client, NULL, 0);
    ModbusClientSetCalls(&client, calls, 1);
}

static void check_module(const IoDrvModule *module)
{
    FUZZ_CHECK(memchr(module->name, '\0', sizeof(module->name)) != NULL);
    for (const char *c = module->name; *c != '\0'; c++)
        FUZZ_CHECK(*c >= ' ' && *c <= '~');
    FUZZ_CHECK(module->slot >= 1 && module->slot <= MODBUS_MAX_UNIT);
}

static bool is_asked(void)
{
    return client.device != NULL && client.sent && !client.link.sending;
}

/* Until there is another request, or for a while; takes what is found. */
static void run(RTS_UI32 *index, bool asked_before)
{
    IoDrvModule module;
    RTS_UI8 sent[300];

    for (int i = 0; i < STEPS && (asked_before || !is_asked()); i++, fakes.now_ns += STEP_NS) {
        RTS_RESULT result = ModbusScan(&client, *index, &module, fakes.now_ns);
        FUZZ_CHECK(result == ERR_OK || result == ERR_PENDING || result == ERR_NO_OBJECT);
        if (result == ERR_OK) {
            check_module(&module);
            ++*index;
        } else if (result == ERR_NO_OBJECT) {
            *index = 0;
        }
        ModbusClientPoll(&client, fakes.now_ns);
        ModbusScanPoll(&client, fakes.now_ns);
        (void)line_take(sent, sizeof(sent));
        asked_before = asked_before && is_asked();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    RTS_UI32 index = 0;

    begin();
    for (size_t i = 0; i < size;) {
        RTS_UI8 frame[1 + UINT8_MAX];
        size_t length = input[i++];
        if (length > size - i)
            length = size - i;
        run(&index, false);
        FUZZ_CHECK(is_asked()); /* it goes on, or begins again */
        frame[0] = client.device->unit;
        memcpy(frame + 1, input + i, length);
        if (length != 0)
            line_send_frame(frame, (RTS_UI32)length + 1);
        run(&index, true);
        i += length;
    }
    return 0;
}
