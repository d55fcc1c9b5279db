/*
 * test_comm_router.c - CmpRouterEmbedded and CmpNameServiceServer: headers, what a leaf ignores, who am I.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpNameServiceServer.h"
#include "CmpRouterEmbedded.h"
#include "comm_fakes.h"
#include "rts_config.h"
#include "test.h"

/* A driver that keeps the last packet. */
static RTS_UI8 sent[BLK_MAX_SIZE];
static RTS_UI32 sent_size;
static RTS_UI32 sent_count;

static RTS_RESULT keep(const ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count)
{
    RTS_UNUSED(peer);
    sent_count++;
    sent_size = 0;
    for (RTS_UI32 i = 0; i < count; i++) {
        memcpy(sent + sent_size, parts[i].data, parts[i].size);
        sent_size += parts[i].size;
    }
    return ERR_OK;
}

static BLK_DRV driver;

static void setup(void)
{
    static const BLK_DRV fresh = {
        .type = BLK_DRV_TYPE_COM, .point_to_point = 1, .address_words = 1, .address = {0x00, 0xAF}, .send = keep};

    fakes_start();
    driver = fresh;
    sent_size = 0;
    sent_count = 0;
}

/* RTSINFO request: it is answered on its own. */
static const RTS_UI8 question[] = {0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};

/* Hands in a header with `question` after it, or only `size` bytes of it. */
static RTS_UI32 ask_cut(const RTS_UI8 *header, RTS_UI32 header_size, RTS_UI32 size)
{
    RTS_UI8 *packet; /* own memory of exactly this size, for the sanitizer */
    RTS_UI8 whole[BLK_MAX_SIZE];
    RTS_UI8 copy[BLK_MAX_SIZE];

    memcpy(whole, header, header_size);
    memcpy(whole + header_size, question, sizeof(question));
    packet = copy + sizeof(copy) - size;
    memcpy(packet, whole, size);
    sent_count = 0;
    RouterHandleData(&driver, packet, size);
    return sent_count;
}

static RTS_UI32 ask(const char *header, RTS_UI32 size)
{
    return ask_cut((const RTS_UI8 *)header, size, size + (RTS_UI32)sizeof(question));
}

#define ASK(header) ask(header, sizeof(header) - 1)

static void captured_tcp_header_is_read_and_answered_as_captured(void)
{
    static const RTS_UI8 own[] = {0x2D, 0xDC, 0x0A, 0x00, 0x02, 0x0F};

    setup();
    memcpy(driver.address, own, sizeof(own));
    driver.address_words = 3;
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x43"
                    "\x2D\xDC\xC0\xA8\x38\x72"
                    "\xC4\x12\xC0\xA8\x38\x73\x83\x0F"),
                1);
    CHECK(memcmp(sent,
                 "\xC5\x73\x40\x40\x00\x34"
                 "\xC4\x12\xC0\xA8\x38\x73\x83\x0F"
                 "\x2D\xDC\x0A\x00\x02\x0F",
                 20) == 0);
    CHECK_EQUAL(sent[20], 0x82);
    CHECK_EQUAL(sent_size, 30);
}

static void payload_starts_at_a_multiple_of_four(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x11\x00\xAF\x00\x01\x00\x00"), 1);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x21\x00\xAF\x00\x01\x00\x02"), 1);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x10\x00\x01"), 1);
}

static void longer_static_header_is_honoured(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x7C\x40\x40\x00\x10\x12\x34\x00\x32\x00\x00"), 1);
    CHECK_EQUAL(BytesGet16(sent + 6), 0x3200);
}

static void header_shorter_than_three_words_is_rejected(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x6A\x40\x40\x00\x10\x00\x01"), 0);
    CHECK_EQUAL(ASK("\xC5\x68\x40\x40\x00\x10\x00\x01"), 0);
    CHECK_EQUAL(RouterGetCounters()->malformed, 2);
}

static void wrong_magic_is_rejected(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC4\x6B\x40\x40\x00\x10\x00\x01"), 0);
    CHECK_EQUAL(RouterGetCounters()->malformed, 1);
}

static void addresses_of_fifteen_words_are_answered(void)
{
    RTS_UI8 header[6 + 60 + 2] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0xFF};

    setup();
    memset(header + 6, 0x5A, 60);
    CHECK_EQUAL(ask_cut(header, 68, 68 + sizeof(question)), 1);
    CHECK_EQUAL(sent[5], 0x1F);
    CHECK(memcmp(sent + 6, header + 36, 30) == 0);
}

static void every_cut_packet_is_rejected(void)
{
    RTS_UI8 header[6 + 60 + 2] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0xFF};

    setup();
    for (RTS_UI32 words = 0; words <= 0xFF; words++) {
        header[5] = (RTS_UI8)words;
        RTS_UI32 whole = (6 + 2 * (words & 15) + 2 * (words >> 4) + 3) & ~3u;
        for (RTS_UI32 size = 0; size < whole; size++) {
            RTS_UI32 before = RouterGetCounters()->malformed;
            CHECK_EQUAL(ask_cut(header, sizeof(header), size), 0);
            CHECK_EQUAL(RouterGetCounters()->malformed, before + 1);
        }
    }
}

static void packet_longer_than_any_line_takes_is_rejected(void)
{
    static RTS_UI8 packet[BLK_LONGEST_PACKET + 4] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x10,
                                                     0x00, 0x01, 0x02, 0xC2, 0x00, 0x04};

    setup();
    RouterHandleData(&driver, packet, BLK_LONGEST_PACKET);
    CHECK_EQUAL(sent_count, 1);
    RouterHandleData(&driver, packet, BLK_LONGEST_PACKET + 1);
    CHECK_EQUAL(sent_count, 1);
}

static void signal_packets_are_never_answered(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x6B\x60\x40\x00\x10\x00\x01"), 0);
    CHECK_EQUAL(RouterGetCounters()->ignored, 1);
}

static void packets_without_sender_are_never_answered(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x01\x00\xAF"), 0);
    CHECK_EQUAL(RouterGetCounters()->ignored, 1);
}

static void hop_count_zero_and_relative_addresses_are_not_delivered(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x03\x40\x40\x00\x10\x00\x01"), 0);
    CHECK_EQUAL(ASK("\xC5\x6B\x50\x40\x00\x10\x00\x01"), 0);
    CHECK_EQUAL(RouterGetCounters()->not_for_us, 2);
}

static void bus_driver_takes_only_its_own_address_and_broadcasts(void)
{
    setup();
    driver.point_to_point = 0;
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x11\x00\xAF\x00\x01\x00\x00"), 1);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x10\x00\x01"), 1);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x11\xFF\xFF\x00\x01\x00\x00"), SRV_OTHER_CLIENTS);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x11\xFF\xFE\x00\x01\x00\x00"), 0);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x11\x00\xAE\x00\x01\x00\x00"), 0);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x12\x00\xAF\x00\x00\x00\x01"), 0);
}

static void point_to_point_driver_takes_any_receiver(void)
{
    setup();
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x13\x00\x00\x00\x00\x00\x00\x00\x01\x00\x00"), 1);
}

static void address_service_is_ignored_so_no_peer_becomes_parent(void)
{
    RTS_UI8 packet[] = {0xC5, 0x0B, 0x40, 0x01, 0x00, 0x10, 0x00, 0xAF, 0x12, 0x34, 0x12, 0x34};

    setup();
    for (RTS_UI32 service = 0; service <= 0xFF; service++) {
        if (service == ROUTER_SVC_CHANNEL || service == ROUTER_SVC_NAME_REQUEST)
            continue;
        packet[3] = (RTS_UI8)service;
        RouterHandleData(&driver, packet, sizeof(packet));
    }
    CHECK_EQUAL(sent_count, 0);
    CHECK_EQUAL(RouterGetCounters()->ignored, 254);
    CHECK_EQUAL(ASK("\xC5\x6B\x40\x40\x00\x10\x00\x01"), 1);
    CHECK_EQUAL(BytesGet16(sent + 8), 0xAF00); /* still our own address */
}

static void announced_block_length_limits_the_answer(void)
{
    setup();
    /* Name request with BlkLenMax 2, 96 bytes: our reply has 106. 3 means 128, 15 means 512. */
    CHECK_EQUAL(ask("\xC5\x6B\x42\x03\x00\x10\x00\x01\x02\xC2\x00\x04\x00\x00\x00\x00", 16), 0);
    CHECK_EQUAL(ask("\xC5\x6B\x43\x03\x00\x10\x00\x01\x02\xC2\x00\x04\x00\x00\x00\x00", 16), 1);
    CHECK_EQUAL(ask("\xC5\x6B\x4F\x03\x00\x10\x00\x01\x02\xC2\x00\x04\x00\x00\x00\x00", 16), 1);
}

static void payload_room_counts_the_header_in_steps_of_four(void)
{
    ROUTER_PEER peer = {&driver, 512, 1, {0}};

    CHECK_EQUAL(RouterGetMaxPayload(&peer, 2), 500);
    CHECK_EQUAL(RouterGetMaxPayload(&peer, 8), 488); /* as seen with the field's tools */
    CHECK_EQUAL(RouterGetMaxPayload(&peer, 30), 444);
    peer.max_packet = 64;
    CHECK_EQUAL(RouterGetMaxPayload(&peer, 30), 0);
}

static void peers_are_distinguished_by_driver_and_address(void)
{
    const ROUTER_PEER peer = {&driver, 512, 1, {0x12, 0x34}};
    BLK_DRV other_driver = driver;
    ROUTER_PEER other = peer;

    other.max_packet = 64;
    other.address[2] = 0x56; /* past the address */
    CHECK(RouterIsSamePeer(&peer, &other));
    other.address[1] = 0x35;
    CHECK(!RouterIsSamePeer(&peer, &other));
    other = peer;
    other.address_words = 2;
    CHECK(!RouterIsSamePeer(&peer, &other));
    other = peer;
    other.driver = &other_driver;
    CHECK(!RouterIsSamePeer(&peer, &other));
}

/* ---- name service ---- */

static RTS_UI32 scan(RTS_UI16 type, RTS_UI16 version, const char *name, RTS_UI32 name_size)
{
    RTS_UI8 packet[BLK_MAX_SIZE] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x11, 0x00, 0xAF, 0x00, 0x01, 0x00, 0x00};

    BytesPut16(packet + 12, type);
    BytesPut16(packet + 14, version);
    BytesPut32(packet + 16, 0x11223344);
    memcpy(packet + 20, name, name_size);
    sent_count = 0;
    RouterHandleData(&driver, packet, 20 + name_size);
    return sent_count;
}

static bool is_wide(const RTS_UI8 *data, const char *text)
{
    for (RTS_UI32 i = 0; i <= strlen(text); i++)
        if (BytesGet16(data + 2 * i) != (RTS_UI8)text[i])
            return false;
    return true;
}

static void captured_scan_is_answered_in_the_captured_form(void)
{
    static const RTS_UI8 request[] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x11, 0x00, 0xAF, 0x00, 0x01,
                                      0x00, 0x00, 0x02, 0xC2, 0x00, 0x04, 0x01, 0x00, 0x00, 0x00};
    /* clang-format off */
    static const RTS_UI8 reply[] = {
        0xC5, 0x73, 0x40, 0x04, 0x00, 0x11, 0x00, 0x01, 0x00, 0xAF, 0x00, 0x00, /* router */
        0x80, 0xC2, 0x00, 0x04, 0x01, 0x00, 0x00, 0x00, 0x01, 0x00, 0x01, 0x00, 0x00, 0x00, 0x05, 0x00,
        0x06, 0x00, 0x06, 0x00, 0x00, 0x10, 0x00, 0x00, 0x02, 0x00, 0x01, 0x00, 0x14, 0x05, 0x0E, 0x03,
        0x00, 0x00, 0x00, 0x00, 0x05, 0x00, 0x02, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00};
    /* clang-format on */

    setup();
    RouterHandleData(&driver, request, sizeof(request));
    CHECK_EQUAL(sent_size, sizeof(reply) + 2 * (6 + 7 + 7) + 6);
    CHECK(memcmp(sent, reply, sizeof(reply)) == 0);
    CHECK(is_wide(sent + 60, "Node7"));
    CHECK(is_wide(sent + 72, "Device"));
    CHECK(is_wide(sent + 86, "Vendor"));
    CHECK(memcmp(sent + 100, "SN-42", 6) == 0);
}

static void third_party_scanner_with_a_longer_header_is_answered(void)
{
    setup();
    static const RTS_UI8 request[] = {0xC5, 0x7C, 0x40, 0x03, 0x00, 0x10, 0x12, 0x34, 0x00, 0x32,
                                      0x00, 0x00, 0x02, 0xC2, 0x00, 0x04, 0x69, 0x69, 0x20, 0x04};
    RouterHandleData(&driver, request, sizeof(request));
    CHECK_EQUAL(sent_count, 1);
    CHECK(memcmp(sent + 16, "\x69\x69\x20\x04", 4) == 0);
}

static void broadcast_scan_is_answered(void)
{
    setup();
    static const RTS_UI8 request[] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01,
                                      0x02, 0xC2, 0x00, 0x04, 0x00, 0x00, 0x00, 0x00};
    RouterHandleData(&driver, request, sizeof(request));
    CHECK_EQUAL(sent_count, 1);
}

static void version_0103_has_its_own_layout(void)
{
    setup();
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0103, "", 0), 1);
    CHECK_EQUAL(BytesGet16(sent + 14), 0x0103);
    CHECK_EQUAL(BytesGet32(sent + 16), 0x11223344);
    CHECK_EQUAL(BytesGet16(sent + 20), 1);
    CHECK_EQUAL(sent[22], 1);
    CHECK_EQUAL(BytesGet32(sent + 12 + 28), 0x030E0514);
    CHECK(is_wide(sent + 12 + 32, "Node7"));
    CHECK_EQUAL(sent_size, 12 + 32 + 40);
}

static void version_0101_has_its_own_layout(void)
{
    setup();
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0101, "", 0), 1);
    CHECK_EQUAL(BytesGet16(sent + 14), 0x0101);
    CHECK_EQUAL(BytesGet32(sent + 12 + 8), 0x1000);
    CHECK_EQUAL(BytesGet16(sent + 12 + 12), 1);
    CHECK_EQUAL(BytesGet16(sent + 12 + 18), 5);
    CHECK_EQUAL(BytesGet16(sent + 12 + 20), 6);
    CHECK(is_wide(sent + 12 + 22, "Node7"));
    CHECK(is_wide(sent + 12 + 34, "Device"));
    CHECK_EQUAL(sent_size, 12 + 22 + 26);
}

static void reply_has_the_wanted_version_or_a_lower_one(void)
{
    static const RTS_UI16 versions[][2] = {{0x0102, 0x0102}, {0x0201, 0x0102}, {0x0301, 0x0103}, {0x03FF, 0x0103},
                                           {0x0400, 0x0400}, {0x0500, 0x0400}, {0xFFFF, 0x0400}};

    setup();
    for (RTS_UI32 i = 0; i < RTS_COUNT(versions); i++) {
        CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, versions[i][0], "", 0), 1);
        CHECK_EQUAL(BytesGet16(sent + 14), versions[i][1]);
    }
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0100, "", 0), 0);
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0000, "", 0), 0);
}

static void name_request_is_answered_by_the_node_of_that_name_only(void)
{
    setup();
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400,
                     "N\0o\0d\0e\0"
                     "7\0\0\0",
                     12),
                1);
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400,
                     "N\0o\0d\0e\0"
                     "7\0",
                     10),
                1);
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400,
                     "N\0o\0d\0e\0"
                     "8\0\0\0",
                     12),
                0);
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400, "N\0o\0d\0e\0", 8), 0);
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400,
                     "N\0o\0d\0e\0"
                     "7\0"
                     "7\0",
                     12),
                0);
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400,
                     "N\0o\0d\0e\0"
                     "7",
                     9),
                0);
    CHECK_EQUAL(scan(NS_RESOLVE_NAME, 0x0400, "", 0), 0);
}

static void other_name_packages_and_cut_ones_are_ignored(void)
{
    RTS_UI8 packet[] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01, 0x02, 0xC2, 0x00, 0x04, 0x00, 0x00, 0x00, 0x00};

    setup();
    CHECK_EQUAL(scan(NS_IDENTIFICATION, 0x0400, "", 0), 0);
    CHECK_EQUAL(scan(0xC203, 0x0400, "", 0), 0);
    for (RTS_UI32 size = 8; size < sizeof(packet); size++)
        RouterHandleData(&driver, packet, size);
    CHECK_EQUAL(sent_count, 0);
}

static void longest_names_are_reported_whole_and_longer_ones_cut(void)
{
    static const char name[] = "0123456789012345678901234567890123456789012345678901234567890123456789"
                               "0123456789012345678901234567890123456789012345678901234567890123456789";

    setup();
    fakes.target.node_name = name;
    fakes.target.device_name = name + sizeof(name) - 1 - 60;
    fakes.target.vendor_name = name;
    fakes.target.serial_number = name;
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0400, "", 0), 1);
    CHECK_EQUAL(BytesGet16(sent + 12 + 14), NS_MAX_NODE_NAME);
    CHECK_EQUAL(BytesGet16(sent + 12 + 16), 60);
    CHECK_EQUAL(BytesGet16(sent + 12 + 18), NS_MAX_TYPE_NAMES - 60);
    CHECK_EQUAL(sent[12 + 36], NS_MAX_SERIAL);
    CHECK(sent_size == 12 + 48 + 2 * (50 + 61 + 39) + 65 && sent_size <= 12 + NS_REPLY_SIZE);
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0103, "", 0), 1);
    CHECK_EQUAL(scan(NS_RESOLVE_ADDRESS, 0x0101, "", 0), 1);
}

int main(void)
{
    RUN(captured_tcp_header_is_read_and_answered_as_captured);
    RUN(payload_starts_at_a_multiple_of_four);
    RUN(longer_static_header_is_honoured);
    RUN(header_shorter_than_three_words_is_rejected);
    RUN(wrong_magic_is_rejected);
    RUN(addresses_of_fifteen_words_are_answered);
    RUN(every_cut_packet_is_rejected);
    RUN(packet_longer_than_any_line_takes_is_rejected);
    RUN(signal_packets_are_never_answered);
    RUN(packets_without_sender_are_never_answered);
    RUN(hop_count_zero_and_relative_addresses_are_not_delivered);
    RUN(bus_driver_takes_only_its_own_address_and_broadcasts);
    RUN(point_to_point_driver_takes_any_receiver);
    RUN(address_service_is_ignored_so_no_peer_becomes_parent);
    RUN(announced_block_length_limits_the_answer);
    RUN(payload_room_counts_the_header_in_steps_of_four);
    RUN(peers_are_distinguished_by_driver_and_address);
    RUN(captured_scan_is_answered_in_the_captured_form);
    RUN(third_party_scanner_with_a_longer_header_is_answered);
    RUN(broadcast_scan_is_answered);
    RUN(version_0103_has_its_own_layout);
    RUN(version_0101_has_its_own_layout);
    RUN(reply_has_the_wanted_version_or_a_lower_one);
    RUN(name_request_is_answered_by_the_node_of_that_name_only);
    RUN(longest_names_are_reported_whole_and_longer_ones_cut);
    RUN(other_name_packages_and_cut_ones_are_ignored);
    return test_result();
}
