/*
 * fuzz_modbus_client.c - any bytes as the replies to a Modbus client.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The first byte chooses the job. Then a row of replies: a byte with the length, and its bytes; with the high bit the
 * bytes are a PDU that gets unit and CRC, so that what follows them is reached too.
 */
#include <string.h>

#include "ModbusClient.h"
#include "ModbusRtu.h"
#include "fuzz.h"
#include "modbus_fakes.h"

enum { STEP_NS = 250000, UNIT = 3, TIMEOUT_MS = 20, GUARD = 0xA5, ROOM = 260 };

static const MODBUS_JOB jobs[] = {
    {MODBUS_READ_COILS, 0, 3, 13, 0, 0, 0, 10},
    {MODBUS_READ_HOLDING_REGISTERS, MODBUS_JOB_REVERSE_4, 0, 4, 0, 0, 0, 10},
    {MODBUS_READ_INPUT_REGISTERS, 0, 0, 125, 0, 0, 0, 10},
    {MODBUS_READ_DISCRETE_INPUTS, 0, 0, 2000, 0, 0, 0, 10},
    {MODBUS_WRITE_COIL, MODBUS_JOB_VERIFY, 0, 0, 5, 1, 0, 10},
    {MODBUS_WRITE_REGISTERS, MODBUS_JOB_VERIFY | MODBUS_JOB_REVERSE_2, 0, 0, 5, 3, 0, 10},
    {MODBUS_MASK_WRITE_REGISTER, MODBUS_JOB_VERIFY, 0, 0, 5, 1, 0x00F0, 10},
    {MODBUS_READ_WRITE_REGISTERS, MODBUS_JOB_REVERSE_8, 8, 4, 0, 4, 0, 10},
};

static MODBUS_CLIENT client;
static MODBUS_DEVICE device;
static MODBUS_JOB_STATE state;
static RTS_UI8 in[ROOM];
static RTS_UI8 out[ROOM];
static RTS_UI8 written[ROOM];

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t seeds[][16] = {
        {0, 0x80 | 4, 1, 2, 0x55, 0x15},
        {1, 0x80 | 10, 3, 8, 1, 2, 3, 4, 5, 6, 7, 8},
        {4, 0x80 | 5, 5, 0, 5, 0, 0, 0x80 | 3, 1, 1, 0},
        {5, 0x80 | 5, 16, 0, 5, 0, 3},
        {6, 0x80 | 7, 22, 0, 5, 0xFF, 0x0F, 0, 0},
        {1, 0x80 | 2, 0x83, 2},
        {7, 0x80 | 10, 23, 8, 1, 2, 3, 4, 5, 6, 7, 8},
        {2, 3, 1, 2, 3},
    };
    static const uint8_t sizes[] = {6, 12, 11, 7, 9, 4, 12, 5};

    if (index >= sizeof(sizes) || capacity < sizes[index])
        return 0;
    memcpy(data, seeds[index], sizes[index]);
    return sizes[index];
}

static void begin(const MODBUS_JOB *job)
{
    const SYSCOM_SETTINGS settings = {115200, SYSCOM_PARITY_EVEN, 1, false};

    fakes_begin();
    fakes.char_ns = 95000;
    memset(&client, 0, sizeof(client));
    memset(&device, 0, sizeof(device));
    memset(&state, 0, sizeof(state));
    memset(in, GUARD, sizeof(in));
    memset(written, GUARD, sizeof(written));
    device.unit = UNIT;
    device.timeout_ms = TIMEOUT_MS;
    device.retries = MODBUS_RETRIES;
    device.ask_again_ms = MODBUS_RETRY_MS;
    device.jobs = &state;
    device.job_count = 1;
    state = (MODBUS_JOB_STATE){.job = job, .in = in, .out = out, .written = written, .has_out = true};
    ModbusRtuBegin(&client.link, 0, &settings);
    ModbusClientBegin(&client, &device, 1);
}

/* Until the request has left, or for a while. */
static bool run(bool until_asked)
{
    RTS_UI8 sent[300];

    for (int i = 0; i < 8000; i++, fakes.now_ns += STEP_NS) {
        RTS_UI32 asked = device.counters.requests;
        ModbusClientPoll(&client, fakes.now_ns);
        (void)line_take(sent, sizeof(sent));
        if (until_asked && client.device != NULL && client.sent && !client.link.sending)
            return true;
        if (!until_asked && asked != device.counters.requests)
            return true;
    }
    return false;
}

static RTS_UI32 size_of(RTS_UI32 count)
{
    return ModbusDataSize(ModbusFindFunction(state.job->function), count);
}

static void check_guards(void)
{
    for (RTS_UI32 i = size_of(state.job->read_count); i < ROOM; i++)
        FUZZ_CHECK(in[i] == GUARD);
    for (RTS_UI32 i = size_of(state.job->write_count); i < ROOM; i++)
        FUZZ_CHECK(written[i] == GUARD);
    FUZZ_CHECK(!fakes.locked);
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    if (size == 0)
        return 0;
    begin(&jobs[input[0] % RTS_COUNT(jobs)]);
    for (size_t i = 1; i < size;) {
        uint8_t head = input[i++];
        size_t length = head & 0x7F;
        RTS_UI8 frame[1 + 0x7F];
        if (length > size - i)
            length = size - i;
        frame[0] = UNIT;
        memcpy(frame + 1, input + i, length);
        FUZZ_CHECK(run(true)); /* it always asks again */
        if ((head & 0x80) != 0)
            line_send_frame(frame, (RTS_UI32)length + 1);
        else
            line_send(frame + 1, (RTS_UI32)length);
        (void)run(false);
        i += length;
    }
    check_guards();
    FUZZ_CHECK(run(true));
    return 0;
}
