/*
 * test_comm_minimal.c - the communication with the sizes of the smallest firmware.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "SimLink.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { DEVICE_NAME_OFFSET = 48 }; /* of the first name in a name service reply */

static CLIENT client;
static RTS_UI8 reply[BLK_MAX_SIZE];

/* Scans in this version; returns the size of the reply. */
static RTS_UI32 scan(RTS_UI16 version)
{
    RTS_UI8 request[sizeof(NS_REQUEST)];
    RTS_UI8 packet[BLK_MAX_SIZE];
    RTS_UI8 service = 0;

    BytesPut16(request, NS_RESOLVE_ADDRESS);
    BytesPut16(request + 2, version);
    BytesPut32(request + 4, 0x11223344);
    (void)SimLinkSend(packet, client_packet(&client, ROUTER_SVC_NAME_REQUEST, request, sizeof(request), packet));
    RTS_UI32 size = client_take(&client, &service, reply);
    return service == ROUTER_SVC_NAME_RESPONSE ? size : 0;
}

static void setup(void)
{
    fakes_start();
    client_init(&client, 0x0102);
}

static void names_that_do_not_fit_are_cut_and_the_serial_number_is_whole(void)
{
    static const char name[] = "0123456789012345678901234567890123456789012345678901234567890123456789";
    static const char serial[] = "SN-0123456789";

    setup();
    fakes.target.node_name = "Node";
    fakes.target.device_name = name;
    fakes.target.vendor_name = name;
    fakes.target.serial_number = serial;
    RTS_UI32 size = scan(NS_VERSION_0400);
    CHECK(size != 0 && size <= NS_REPLY_SIZE);
    CHECK(BytesGet16(reply + 14) == 4);
    RTS_UI32 device = BytesGet16(reply + 16);
    CHECK(device > 4 && device < sizeof(name) - 1);
    CHECK(BytesGet16(reply + 18) == 0);
    CHECK(reply[36] == sizeof(serial) - 1);
    CHECK(size == DEVICE_NAME_OFFSET + 2 * (5 + device + 1 + 1) + sizeof(serial));
    CHECK(memcmp(reply + size - sizeof(serial), serial, sizeof(serial)) == 0);
}

static void only_the_newest_version_of_the_name_service_is_answered(void)
{
    setup();
    CHECK(scan(NS_VERSION_0400) != 0);
    CHECK(scan(NS_VERSION_0103) == 0);
    CHECK(scan(NS_VERSION_0101) == 0);
}

static void names_of_19_characters_and_a_serial_number_of_24_are_reported_whole(void)
{
    REPLY answer;

    setup();
    fakes.target.node_name = fakes.target.device_name = fakes.target.vendor_name = "0123456789012345678";
    fakes.target.serial_number = "0123456789ABCDEF01234567"; /* of an STM32 */
    CHECK(client_open(&client));
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &answer));
    CHECK(reply_error(&answer) == ERR_OK);
    CHECK(scan(NS_VERSION_0400) == DEVICE_NAME_OFFSET + 3 * 2 * 20 + 25);
}

static void largest_message_goes_to_and_fro(void)
{
    RTS_UI8 content[NETSERVER_MESSAGE_SIZE - 20] = {0};
    REPLY answer;

    setup();
    CHECK(client_open(&client) && client.limit == NETSERVER_MESSAGE_SIZE);
    content[0] = 0x7F; /* an unknown tag that fills the message */
    content[1] = 0x80 | (sizeof(content) - 3) % 0x80;
    content[2] = (sizeof(content) - 3) / 0x80;
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_READ_STATUS, content, sizeof(content), &answer));
    CHECK(reply_error(&answer) == ERR_OK);
}

static void services_that_only_inform_are_unknown(void)
{
    REPLY answer;

    setup();
    CHECK(client_open(&client));
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_READ_TASK_INFO, NULL, 0, &answer));
    CHECK(reply_error(&answer) == ERR_L7_UNKNOWNCMD);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_ECHO, NULL, 0, &answer));
    CHECK(reply_error(&answer) == ERR_L7_UNKNOWNCMD);
}

int main(void)
{
    RUN(names_that_do_not_fit_are_cut_and_the_serial_number_is_whole);
    RUN(only_the_newest_version_of_the_name_service_is_answered);
    RUN(names_of_19_characters_and_a_serial_number_of_24_are_reported_whole);
    RUN(largest_message_goes_to_and_fro);
    RUN(services_that_only_inform_are_unknown);
    return test_result();
}
