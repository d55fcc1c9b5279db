/*
 * test_modbus_server.c - what a Modbus server replies: every function code, its limits, its exceptions; the views of
 * one memory.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusPdu.h"
#include "ModbusServer.h"
#include "modbus_fakes.h"
#include "test.h"

/* Holding registers 0..9, which are coils 0..159 too; 10..11 next to them, read only; input registers 0..124 and
 * discrete inputs 2000 bits from 100 on; holding registers up to the last address. */
static RTS_UI8 writable[20];
static RTS_UI8 readable[4];
static RTS_UI8 inputs[250];
static RTS_UI8 discrete[250];
static RTS_UI8 last[16];
static RTS_UI8 swapped[8];
static RTS_UI8 many[250];
static RTS_UI8 reals[8];
static RTS_UI8 wholes[8];
static RTS_UI8 long_number[8];

enum { WHOLE_OF_TWO = 1 << MODBUS_RANGE_NUMBER_SHIFT, WHOLE_OF_FOUR = 3 << MODBUS_RANGE_NUMBER_SHIFT };

static const MODBUS_RANGE ranges[] = {
    {MODBUS_HOLDING_REGISTERS | MODBUS_COILS, MODBUS_RANGE_WRITABLE, 0, 0, 1, 160},
    {MODBUS_HOLDING_REGISTERS, 0, 10, 0, 1, 32},
    {MODBUS_INPUT_REGISTERS, 0, 0, 0, 1, 2000},
    {MODBUS_DISCRETE_INPUTS, 0, 0, 100, 2, 2000},
    {MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE, 65528, 0, 1, 128},
    {MODBUS_HOLDING_REGISTERS | MODBUS_COILS, MODBUS_RANGE_WRITABLE, 500, 500, 2, 64},
    {MODBUS_HOLDING_REGISTERS | MODBUS_COILS, MODBUS_RANGE_WRITABLE, 1000, 1000, 1, 2000},
    {MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE, 2000, 0, 4, 64},
    {MODBUS_HOLDING_REGISTERS | MODBUS_COILS, MODBUS_RANGE_WRITABLE | WHOLE_OF_TWO, 3001, 48016, 4, 64},
    {MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE | WHOLE_OF_FOUR, 3005, 0, 8, 64},
};
static const MODBUS_MEMORY memory[] = {{&ranges[0], writable},   {&ranges[1], readable}, {&ranges[2], inputs},
                                       {&ranges[3], discrete},   {&ranges[4], last},     {&ranges[5], swapped},
                                       {&ranges[6], many},       {&ranges[7], reals},    {&ranges[8], wholes},
                                       {&ranges[9], long_number}};

static MODBUS_SERVER server;
static RTS_UI8 pdu[MODBUS_MAX_PDU + 8];

static void begin(void)
{
    memset(&server, 0, sizeof(server));
    memset(writable, 0, sizeof(writable));
    memset(swapped, 0, sizeof(swapped));
    memset(last, 0, sizeof(last));
    memset(many, 0, sizeof(many));
    memset(wholes, 0, sizeof(wholes));
    memset(long_number, 0, sizeof(long_number));
    for (int i = 0; i < 4; i++)
        readable[i] = (RTS_UI8)(0xC0 + i);
    for (int i = 0; i < 250; i++) {
        inputs[i] = (RTS_UI8)i;
        discrete[i] = (RTS_UI8)(i * 7);
    }
    server.unit = 5;
    server.running = true;
    server.memory = memory;
    server.range_count = RTS_COUNT(memory);
    fakes_begin();
}

/* Size of the reply, which is in `pdu`. */
static RTS_UI32 ask(const RTS_UI8 *request, RTS_UI32 size)
{
    memset(pdu, 0xEE, sizeof(pdu));
    memcpy(pdu, request, size);
    size = ModbusServerReply(&server, pdu, size);
    CHECK(size <= MODBUS_MAX_PDU);
    CHECK(!fakes.locked);
    return size;
}

#define ASK(...) ask((const RTS_UI8[]){__VA_ARGS__}, sizeof((const RTS_UI8[]){__VA_ARGS__}))
#define CHECK_REPLY(size, ...)                               \
    do {                                                     \
        static const RTS_UI8 expected[] = {__VA_ARGS__};     \
        RTS_UI32 replied = (size);                           \
        CHECK_EQUAL(replied, sizeof(expected));              \
        CHECK(memcmp(pdu, expected, sizeof(expected)) == 0); \
    } while (0)
#define CHECK_EXCEPTION(code, ...)                          \
    do {                                                    \
        static const RTS_UI8 request[] = {__VA_ARGS__};     \
        CHECK_EQUAL(ask(request, sizeof(request)), 2);      \
        CHECK_EQUAL(pdu[0], request[0] | MODBUS_EXCEPTION); \
        CHECK_EQUAL(pdu[1], (code));                        \
    } while (0)

static void registers_are_written_and_read(void)
{
    begin();
    CHECK_REPLY(ASK(16, 0, 2, 0, 2, 4, 0x12, 0x34, 0x56, 0x78), 16, 0, 2, 0, 2);
    CHECK_REPLY(ASK(3, 0, 1, 0, 4), 3, 8, 0, 0, 0x12, 0x34, 0x56, 0x78, 0, 0);
    CHECK_REPLY(ASK(6, 0, 3, 0xAB, 0xCD), 6, 0, 3, 0xAB, 0xCD);
    CHECK_EQUAL(writable[6], 0xAB);
    CHECK_EQUAL(writable[7], 0xCD);
    CHECK_REPLY(ASK(4, 0, 1, 0, 1), 4, 2, 2, 3);
    CHECK_EQUAL(server.requests, 4);
    CHECK_EQUAL(server.written, 2);
    CHECK_EQUAL(server.errors, 0);
}

static void a_read_goes_on_in_the_next_range(void)
{
    begin();
    writable[18] = 1;
    writable[19] = 2;
    CHECK_REPLY(ASK(3, 0, 9, 0, 3), 3, 6, 1, 2, 0xC0, 0xC1, 0xC2, 0xC3);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 3, 0, 9, 0, 4);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 16, 0, 9, 0, 2, 4, 1, 2, 3, 4);
    CHECK_EQUAL(writable[18], 1); /* nothing is half written */
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 6, 0, 10, 0, 1);
}

static void coils_and_registers_are_one_memory(void)
{
    begin();
    CHECK_REPLY(ASK(5, 0, 17, 0xFF, 0), 5, 0, 17, 0xFF, 0);
    CHECK_REPLY(ASK(3, 0, 1, 0, 1), 3, 2, 0, 2);
    CHECK_REPLY(ASK(15, 0, 24, 0, 8, 1, 0x81), 15, 0, 24, 0, 8);
    CHECK_REPLY(ASK(3, 0, 1, 0, 1), 3, 2, 0x81, 2);
    CHECK_REPLY(ASK(6, 0, 2, 0x80, 0x01), 6, 0, 2, 0x80, 0x01);
    CHECK_REPLY(ASK(1, 0, 31, 0, 2), 1, 1, 3); /* the last bit of register 1, the first of 2 */
    CHECK_REPLY(ASK(1, 0, 47, 0, 1), 1, 1, 1);
    CHECK_REPLY(ASK(5, 0, 17, 0, 0), 5, 0, 17, 0, 0);
    CHECK_REPLY(ASK(3, 0, 1, 0, 1), 3, 2, 0x81, 0);
}

static void memory_with_the_low_byte_first_looks_the_same_from_outside(void)
{
    begin();
    CHECK_REPLY(ASK(6, 1, 0xF5, 0x12, 0x34), 6, 1, 0xF5, 0x12, 0x34);
    CHECK_EQUAL(swapped[2], 0x34);
    CHECK_EQUAL(swapped[3], 0x12);
    CHECK_REPLY(ASK(3, 1, 0xF5, 0, 1), 3, 2, 0x12, 0x34);
    CHECK_REPLY(ASK(1, 2, 4, 0, 16), 1, 2, 0x34, 0x12);
    CHECK_REPLY(ASK(5, 2, 4, 0xFF, 0), 5, 2, 4, 0xFF, 0);
    CHECK_EQUAL(swapped[2], 0x35);
}

static void numbers_of_two_registers_may_have_the_high_one_first(void)
{
    static const RTS_UI8 in_memory[] = {0xDD, 0xCC, 0xBB, 0xAA, 4, 3, 2, 1};

    begin();
    CHECK_REPLY(ASK(16, 0x07, 0xD0, 0, 4, 8, 0xAA, 0xBB, 0xCC, 0xDD, 1, 2, 3, 4), 16, 0x07, 0xD0, 0, 4);
    CHECK(memcmp(reals, in_memory, sizeof(reals)) == 0);
    CHECK_REPLY(ASK(3, 0x07, 0xD1, 0, 2), 3, 4, 0xCC, 0xDD, 1, 2);
}

/* Half of one would be another number than anyone meant. */
static void the_count_of_requests_that_wrote_wraps_past_zero(void)
{
    begin();
    server.written = 0xFFFFFFFF;
    CHECK_REPLY(ASK(6, 0, 3, 0xAB, 0xCD), 6, 0, 3, 0xAB, 0xCD);
    CHECK_EQUAL(server.written, 1); /* 0: nothing was ever written */
}

static void a_part_of_a_number_is_not_written(void)
{
    begin();
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 6, 0x0B, 0xB9, 0x40, 0xA0);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 6, 0x0B, 0xBA, 0x40, 0xA0);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 22, 0x0B, 0xB9, 0, 0, 0, 1);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 16, 0x0B, 0xBA, 0, 2, 4, 1, 2, 3, 4);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 16, 0x0B, 0xB9, 0, 3, 6, 1, 2, 3, 4, 5, 6);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 16, 0x0B, 0xBD, 0, 2, 4, 1, 2, 3, 4); /* of four registers */
    CHECK_EQUAL(wholes[0] | wholes[1] | wholes[2] | wholes[3] | wholes[4] | wholes[5] | long_number[6], 0);
    CHECK_REPLY(ASK(16, 0x0B, 0xBB, 0, 6, 12, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12), 16, 0x0B, 0xBB, 0, 6);
    CHECK_EQUAL(wholes[4], 4);
    CHECK_EQUAL(wholes[7], 1);
    CHECK_EQUAL(long_number[0], 12);
    CHECK_REPLY(ASK(3, 0x0B, 0xBC, 0, 2), 3, 4, 3, 4, 5, 6);          /* but read */
    CHECK_REPLY(ASK(5, 0xBB, 0x90, 0xFF, 0), 5, 0xBB, 0x90, 0xFF, 0); /* bits are meant one by one */
}

static void bits_are_packed_from_the_lowest(void)
{
    begin();
    CHECK_REPLY(ASK(2, 0, 100, 0, 8), 2, 1, 0);
    CHECK_REPLY(ASK(2, 0, 108, 0, 9), 2, 2, 7, 0); /* the bits after the ninth are 0 */
    CHECK_REPLY(ASK(2, 0, 109, 0, 3), 2, 1, 3);
    CHECK_EQUAL(ASK(2, 0, 100, 0x07, 0xD0), 252); /* 2000 */
    CHECK(memcmp(pdu + 2, discrete, 250) == 0);
    CHECK_EQUAL(ASK(2, 0, 103, 0x07, 0xCD), 252);
    for (int i = 0; i < 1997; i++)
        CHECK_EQUAL(pdu[2 + i / 8] >> i % 8 & 1, discrete[(i + 3) / 8] >> (i + 3) % 8 & 1);
    CHECK_EQUAL(pdu[251] >> 5, 0);
}

static void a_register_is_masked(void)
{
    begin();
    ASK(6, 0, 4, 0x00, 0x12);
    CHECK_REPLY(ASK(22, 0, 4, 0x00, 0xF2, 0x00, 0x25), 22, 0, 4, 0x00, 0xF2, 0x00, 0x25);
    CHECK_REPLY(ASK(3, 0, 4, 0, 1), 3, 2, 0x00, 0x17); /* the example of the specification, 6.16 */
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 22, 0, 10, 0, 0, 0, 0);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 22, 0, 4, 0, 0, 0);
}

static void a_write_comes_before_the_read_of_the_same_request(void)
{
    RTS_UI32 locks;

    begin();
    locks = fakes.locks;
    CHECK_REPLY(ASK(23, 0, 3, 0, 2, 0, 4, 0, 2, 4, 0xAA, 0xBB, 0xCC, 0xDD), 23, 4, 0, 0, 0xAA, 0xBB);
    CHECK_EQUAL(fakes.locks, locks + 1); /* as one */
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 23, 0, 3, 0, 2, 0, 10, 0, 1, 2, 1, 2);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 23, 0, 50, 0, 2, 0, 3, 0, 1, 2, 1, 2);
    CHECK_EQUAL(writable[6], 0);
}

/* Counts at and beyond the limits of a request of registers or bits: the first byte is the function. */
static void check_read_limits(RTS_UI8 function, RTS_UI16 address, RTS_UI16 most)
{
    RTS_UI8 request[5] = {function};

    ModbusPut16(request + 1, address);
    ModbusPut16(request + 3, most);
    CHECK_EQUAL(ask(request, 5), 2 + (most == 2000 ? 250 : 2 * most));
    ModbusPut16(request + 3, most + 1u);
    CHECK_EQUAL(ask(request, 5), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_VALUE);
    ModbusPut16(request + 3, 0);
    CHECK_EQUAL(ask(request, 5), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_VALUE);
    for (RTS_UI32 size = 1; size < 7; size++) {
        RTS_UI8 longer[7] = {function, 0, 0, 0, 1, 0, 0};
        if (size != 5) {
            CHECK_EQUAL(ask(longer, size), 2);
            CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_VALUE);
        }
    }
}

static void reads_have_the_limits_of_the_standard(void)
{
    begin();
    check_read_limits(1, 1000, 2000);
    check_read_limits(2, 100, 2000);
    check_read_limits(3, 1000, 125);
    check_read_limits(4, 0, 125);
}

static RTS_UI8 write_many(RTS_UI8 function, RTS_UI32 count, RTS_UI32 bytes, RTS_UI32 sent)
{
    RTS_UI8 request[300] = {function, 0x03, 0xE8};

    ModbusPut16(request + 3, count);
    request[5] = (RTS_UI8)bytes;
    memset(request + 6, 0x5A, sizeof(request) - 6);
    return ask(request, 6 + sent) == 2 ? pdu[1] : 0;
}

static void writes_have_the_limits_of_the_standard(void)
{
    begin();
    CHECK_EQUAL(write_many(16, 123, 246, 246), 0);
    CHECK_EQUAL(many[245], 0x5A);
    CHECK_EQUAL(many[246], 0);
    CHECK_EQUAL(write_many(16, 124, 248, 247), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(write_many(16, 0, 0, 0), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(write_many(16, 2, 2, 4), MODBUS_ILLEGAL_VALUE); /* the byte count is not that of the registers */
    CHECK_EQUAL(write_many(16, 2, 4, 3), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(write_many(16, 2, 4, 5), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(write_many(15, 1968, 246, 246), 0);
    CHECK_EQUAL(write_many(15, 1969, 247, 247), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(write_many(15, 9, 1, 1), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(write_many(15, 9, 2, 2), 0);
}

static RTS_UI8 read_write(RTS_UI32 reads, RTS_UI32 writes)
{
    RTS_UI8 request[260] = {23, 0x03, 0xE8, 0, 0, 0x03, 0xE8};

    ModbusPut16(request + 3, reads);
    ModbusPut16(request + 7, writes);
    request[9] = (RTS_UI8)(2 * writes);
    return ask(request, 10 + 2 * writes) == 2 ? pdu[1] : 0;
}

static void read_and_write_have_limits_of_their_own(void)
{
    begin();
    CHECK_EQUAL(read_write(125, 121), 0);
    CHECK_EQUAL(read_write(126, 121), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(read_write(125, 122), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(read_write(0, 1), MODBUS_ILLEGAL_VALUE);
    CHECK_EQUAL(read_write(1, 0), MODBUS_ILLEGAL_VALUE);
}

static void addresses_end_at_65535(void)
{
    begin();
    CHECK_REPLY(ASK(6, 0xFF, 0xFF, 1, 2), 6, 0xFF, 0xFF, 1, 2);
    CHECK_REPLY(ASK(3, 0xFF, 0xFE, 0, 2), 3, 4, 0, 0, 1, 2);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 3, 0xFF, 0xFE, 0, 3);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 3, 0xFF, 0xFF, 0, 125);
}

static void a_coil_is_on_or_off(void)
{
    begin();
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 5, 0, 1, 0xFF, 1);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 5, 0, 1, 1, 0);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 5, 0, 1, 0xFF);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 5, 3, 0, 0xFF, 0);
    CHECK_EQUAL(writable[1], 0);
}

static void other_functions_are_refused(void)
{
    RTS_UI32 refused = 0;

    begin();
    for (RTS_UI32 function = 0; function < 128; function++) {
        RTS_UI8 request[5] = {(RTS_UI8)function, 0, 0, 0, 1};
        bool known = ModbusFindFunction((RTS_UI8)function) != NULL;
        RTS_UI32 size = ask(request, 5);
        bool was_refused = size == 2 && pdu[1] == MODBUS_ILLEGAL_FUNCTION;
        CHECK_EQUAL(was_refused, !known);
        refused += was_refused;
    }
    CHECK_EQUAL(refused, 128 - 13);
    CHECK_EQUAL(server.errors > refused, true); /* some are too short or too long */
}

static void the_loopback_returns_what_came(void)
{
    begin();
    CHECK_EQUAL(ASK(8, 0, 0, 0xA5, 0x37), 5);
    CHECK(memcmp(pdu, "\x08\x00\x00\xA5\x37", 5) == 0);
    CHECK_EQUAL(ASK(8, 0, 1, 0, 0), 2); /* another diagnostic */
    CHECK(pdu[0] == 0x88 && pdu[1] == MODBUS_ILLEGAL_FUNCTION);
    CHECK_EQUAL(ASK(8, 0, 0, 1), 2);
    CHECK(pdu[0] == 0x88 && pdu[1] == MODBUS_ILLEGAL_VALUE);
}

/* Registers 0 to 11 and 500 to 503 are there. */
static void gaps_have_a_value_if_they_may_be_read(void)
{
    begin();
    CHECK_EQUAL(ASK(3, 0, 10, 0, 4), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_ADDRESS);
    server.has_gaps = true;
    server.gap[0] = 0x34;
    server.gap[1] = 0x12;
    CHECK_EQUAL(ASK(3, 0, 10, 0, 4), 10);
    CHECK(memcmp(pdu + 2, "\xC0\xC1\xC2\xC3\x12\x34\x12\x34", 8) == 0);
    swapped[0] = 0x77;
    CHECK_EQUAL(ASK(3, 0x01, 0xF3, 0, 2), 6); /* 499 and 500 */
    CHECK(memcmp(pdu + 2, "\x12\x34\x00\x77", 4) == 0);
    CHECK_EQUAL(ASK(3, 0x20, 0, 0, 125), 252); /* none is there */
    CHECK(memcmp(pdu + 250, "\x12\x34", 2) == 0);
    CHECK_EQUAL(ASK(3, 0xFF, 0xFF, 0, 2), 2); /* past the last address */
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_ADDRESS);
    server.gap[0] = 1;
    CHECK_EQUAL(ASK(2, 0, 0, 0, 16), 4);
    CHECK(pdu[2] == 0xFF && pdu[3] == 0xFF);
}

static void gaps_are_not_written(void)
{
    begin();
    server.has_gaps = true;
    CHECK_EQUAL(ASK(6, 0, 100, 0, 1), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_ADDRESS);
    CHECK_EQUAL(ASK(22, 0, 100, 0, 0, 0, 1), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_ADDRESS);
    CHECK_EQUAL(ASK(23, 0, 0, 0, 1, 0, 9, 0, 2, 4, 1, 1, 1, 1), 2); /* 10 may be read only */
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_ADDRESS);
    CHECK_EQUAL(writable[18], 0);
}

static void server_id_says_whether_the_program_runs(void)
{
    begin();
    server.object[MODBUS_PRODUCT_NAME] = "PLC";
    CHECK_REPLY(ASK(17), 17, 5, 5, 0xFF, 'P', 'L', 'C');
    server.running = false;
    CHECK_REPLY(ASK(17), 17, 5, 5, 0, 'P', 'L', 'C');
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 17, 0);
}

static void identification_is_a_stream_or_one_object(void)
{
    begin();
    server.object[0] = "Acme";
    server.object[1] = "P1";
    server.object[2] = "1.0";
    server.object[4] = "Box";
    CHECK_REPLY(ASK(43, 14, 1, 0), 43, 14, 1, 0x82, 0, 0, 3, 0, 4, 'A', 'c', 'm', 'e', 1, 2, 'P', '1', 2, 3, '1', '.',
                '0');
    CHECK_REPLY(ASK(43, 14, 2, 3), 43, 14, 2, 0x82, 0, 0, 1, 4, 3, 'B', 'o', 'x');
    CHECK_REPLY(ASK(43, 14, 4, 1), 43, 14, 4, 0x82, 0, 0, 1, 1, 2, 'P', '1');
    CHECK_REPLY(ASK(43, 14, 1, 200), 43, 14, 1, 0x82, 0, 0, 3, 0, 4, 'A', 'c', 'm', 'e', 1, 2, 'P', '1', 2, 3, '1', '.',
                '0'); /* from the beginning */
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 43, 14, 4, 7);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_ADDRESS, 43, 14, 4, 3); /* it has no URL */
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 43, 14, 0, 0);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 43, 14, 5, 0);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_VALUE, 43, 14, 1);
    CHECK_EXCEPTION(MODBUS_ILLEGAL_FUNCTION, 43, 13, 1, 0);
}

static void a_long_identification_comes_in_parts(void)
{
    static char text[200];
    RTS_UI32 seen = 0;
    RTS_UI8 next = 0;
    bool more;

    begin();
    memset(text, 'x', sizeof(text) - 1);
    for (int i = 0; i < MODBUS_OBJECTS; i++)
        server.object[i] = text;
    do {
        RTS_UI32 size = ASK(43, 14, 2, next);
        RTS_UI32 at = 7;
        more = pdu[4] == 0xFF;
        for (RTS_UI8 i = 0; i < pdu[6]; i++, seen++) {
            CHECK_EQUAL(pdu[at], seen);
            CHECK_EQUAL(pdu[at + 1], 100);
            at += 2u + pdu[at + 1];
        }
        CHECK_EQUAL(at, size);
        CHECK(!more || pdu[5] == seen);
        next = pdu[5];
    } while (more && seen < MODBUS_OBJECTS);
    CHECK_EQUAL(seen, MODBUS_OBJECTS);
}

static void an_empty_request_is_refused(void)
{
    begin();
    pdu[0] = 3;
    CHECK_EQUAL(ModbusServerReply(&server, pdu, 0), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_FUNCTION);
}

int main(void)
{
    RUN(registers_are_written_and_read);
    RUN(the_count_of_requests_that_wrote_wraps_past_zero);
    RUN(a_read_goes_on_in_the_next_range);
    RUN(coils_and_registers_are_one_memory);
    RUN(memory_with_the_low_byte_first_looks_the_same_from_outside);
    RUN(numbers_of_two_registers_may_have_the_high_one_first);
    RUN(a_part_of_a_number_is_not_written);
    RUN(bits_are_packed_from_the_lowest);
    RUN(a_register_is_masked);
    RUN(a_write_comes_before_the_read_of_the_same_request);
    RUN(reads_have_the_limits_of_the_standard);
    RUN(writes_have_the_limits_of_the_standard);
    RUN(read_and_write_have_limits_of_their_own);
    RUN(addresses_end_at_65535);
    RUN(a_coil_is_on_or_off);
    RUN(other_functions_are_refused);
    RUN(the_loopback_returns_what_came);
    RUN(gaps_have_a_value_if_they_may_be_read);
    RUN(gaps_are_not_written);
    RUN(server_id_says_whether_the_program_runs);
    RUN(identification_is_a_stream_or_one_object);
    RUN(a_long_identification_comes_in_parts);
    RUN(an_empty_request_is_refused);
    return test_result();
}
