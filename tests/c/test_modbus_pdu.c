/*
 * test_modbus_pdu.c - exact lengths of requests and replies of Modbus.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each PDU lies in memory of its own length, so that a sanitizer finds what is read past its end.
 */
#include <stdlib.h>
#include <string.h>

#include "ModbusPdu.h"
#include "test.h"

static RTS_UI8 *in_own_memory(const void *pdu, RTS_UI32 size)
{
    RTS_UI8 *copy = malloc(size);

    CHECK(copy != NULL);
    memcpy(copy, pdu, size);
    return copy;
}

static RTS_UI32 size_of(RTS_UI32 (*get)(const RTS_UI8 *pdu, RTS_UI32 size), const char *pdu, RTS_UI32 size)
{
    RTS_UI8 *copy = in_own_memory(pdu, size);
    RTS_UI32 found = get(copy, size);

    free(copy);
    return found;
}

static void a_request_says_its_length_as_soon_as_it_is_known(void)
{
    static const char write[] = {MODBUS_WRITE_REGISTERS, 0, 0, 0, 2, 4};
    static const char device[] = {MODBUS_ENCAPSULATED, MODBUS_DEVICE_IDENTIFICATION};
    static const char other[] = {MODBUS_ENCAPSULATED, MODBUS_DEVICE_IDENTIFICATION + 1};
    RTS_UI32 size;

    for (size = 1; size < sizeof write; size++)
        CHECK_EQUAL(size_of(ModbusGetRequestSize, write, size), 6);
    CHECK_EQUAL(size_of(ModbusGetRequestSize, write, sizeof write), 10);
    CHECK_EQUAL(size_of(ModbusGetRequestSize, device, 1), 4);
    CHECK_EQUAL(size_of(ModbusGetRequestSize, device, 2), 4);
    CHECK_EQUAL(size_of(ModbusGetRequestSize, other, 1), 4);
    CHECK_EQUAL(size_of(ModbusGetRequestSize, other, 2), 0);
}

static void a_reply_says_its_length_as_soon_as_it_is_known(void)
{
    static const char read[] = {MODBUS_READ_HOLDING_REGISTERS, 6};

    CHECK_EQUAL(size_of(ModbusGetReplySize, read, 1), 2);
    CHECK_EQUAL(size_of(ModbusGetReplySize, read, 2), 8);
}

static RTS_UI8 exception_of(const char *pdu, RTS_UI32 size)
{
    RTS_UI8 *copy = in_own_memory(pdu, size);
    MODBUS_REQUEST request;
    RTS_UI8 exception = ModbusReadRequest(copy, size, &request);

    free(copy);
    return exception;
}

static void a_request_of_another_length_is_refused(void)
{
    static const char write[] = {MODBUS_WRITE_REGISTERS, 0, 0, 0, 1, 2, 0x12, 0x34, 0};
    static const char read[] = {MODBUS_READ_COILS, 0, 0, 0, 1, 0};
    RTS_UI32 size;

    for (size = 1; size < sizeof write; size++)
        CHECK_EQUAL(exception_of(write, size), (size == 8 ? 0 : MODBUS_ILLEGAL_VALUE));
    CHECK_EQUAL(exception_of(write, sizeof write), MODBUS_ILLEGAL_VALUE);
    for (size = 1; size <= sizeof read; size++)
        CHECK_EQUAL(exception_of(read, size), (size == 5 ? 0 : MODBUS_ILLEGAL_VALUE));
}

/* ---- replies ---- */

static MODBUS_REPLY reply_to(RTS_UI8 function, const char *pdu, RTS_UI32 size)
{
    MODBUS_REQUEST request = {.function = ModbusFindFunction(function), .read_count = 2, .write_count = 2};
    RTS_UI8 head[MODBUS_MAX_PDU] = {0};
    RTS_UI8 *copy = in_own_memory(pdu, size);
    MODBUS_REPLY reply;

    (void)ModbusBeginRequest(&request, head);
    if (function == MODBUS_ENCAPSULATED)
        head[1] = MODBUS_DEVICE_IDENTIFICATION;
    reply = ModbusCheckReply(&request, head, copy, size);
    free(copy);
    return reply;
}

static void check_only(RTS_UI8 function, const char *pdu, RTS_UI32 good)
{
    RTS_UI32 size;

    for (size = 1; size <= good + 1; size++)
        CHECK_EQUAL(reply_to(function, pdu, size), (size == good ? MODBUS_REPLY_GOOD : MODBUS_REPLY_OTHER));
}

static void a_reply_has_the_length_of_its_request(void)
{
    static const char read[] = {MODBUS_READ_HOLDING_REGISTERS, 4, 1, 2, 3, 4, 5};
    static const char written[] = {MODBUS_WRITE_REGISTERS, 0, 0, 0, 2, 0};
    static const char id[] = {MODBUS_REPORT_SERVER_ID, 2, 7, 0x7F, 0};

    check_only(MODBUS_READ_HOLDING_REGISTERS, read, 6);
    check_only(MODBUS_WRITE_REGISTERS, written, 5);
    check_only(MODBUS_REPORT_SERVER_ID, id, 4);
}

static void a_reply_that_says_another_count_or_address_is_not_its_own(void)
{
    static const char count[] = {MODBUS_READ_HOLDING_REGISTERS, 3, 1, 2, 3, 4};
    static const char address[] = {MODBUS_WRITE_REGISTERS, 0, 1, 0, 2};
    static const char number[] = {MODBUS_WRITE_REGISTERS, 0, 0, 0, 3};

    CHECK_EQUAL(reply_to(MODBUS_READ_HOLDING_REGISTERS, count, sizeof count), MODBUS_REPLY_OTHER);
    CHECK_EQUAL(reply_to(MODBUS_WRITE_REGISTERS, address, sizeof address), MODBUS_REPLY_OTHER);
    CHECK_EQUAL(reply_to(MODBUS_WRITE_REGISTERS, number, sizeof number), MODBUS_REPLY_OTHER);
}

static void an_exception_has_two_bytes(void)
{
    static const char exception[] = {(char)(MODBUS_READ_COILS | MODBUS_EXCEPTION), 2, 0};

    CHECK_EQUAL(reply_to(MODBUS_READ_COILS, exception, 1), MODBUS_REPLY_OTHER);
    CHECK_EQUAL(reply_to(MODBUS_READ_COILS, exception, 2), MODBUS_REPLY_EXCEPTION);
    CHECK_EQUAL(reply_to(MODBUS_READ_COILS, exception, 3), MODBUS_REPLY_OTHER);
}

int main(void)
{
    RUN(a_request_says_its_length_as_soon_as_it_is_known);
    RUN(a_reply_says_its_length_as_soon_as_it_is_known);
    RUN(a_request_of_another_length_is_refused);
    RUN(a_reply_has_the_length_of_its_request);
    RUN(a_reply_that_says_another_count_or_address_is_not_its_own);
    RUN(an_exception_has_two_bytes);
    return test_result();
}
