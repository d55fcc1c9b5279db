/*
 * test_comm_can.c - CmpBlkDrvCan: channels of several tools on one bus, scans, losses, bus off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBlkDrvCan.h"
#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpPackets.h"
#include "can_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { KBIT = 1000, ECHO_SIZE = 1500 };

static RTS_UI8 packet[BLK_MAX_SIZE];
static const RTS_UI8 payload[400];

static bool ask(CLIENT *client)
{
    REPLY reply;

    return client_request(client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply);
}

/* A long request and its long reply. */
static bool echo(CLIENT *client)
{
    static RTS_UI8 content[ECHO_SIZE];
    RTS_UI8 request[ECHO_SIZE + 32];
    BTAG_WRITER writer;
    REPLY reply;

    for (RTS_UI32 i = 0; i < sizeof(content); i++)
        content[i] = (RTS_UI8)(i * 13);
    BTagWriterInit(&writer, request, sizeof(request));
    BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, sizeof(content));
    BTagWrite(&writer, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0, content, sizeof(content));
    return client_call(client, SG_DEVICE, SRV_DEV_ECHO, &writer, &reply) && reply.size > ECHO_SIZE;
}

static bool can_connect(CLIENT *client, CAN_TOOL *tool)
{
    can_client(client, tool);
    return client_open(client) && client_login(client) && client_login_app(client);
}

static void a_tool_logs_in_on_classic_can_and_fd(void)
{
    static const RTS_UI32 rates[][2] = {{125 * KBIT, 0}, {1000 * KBIT, 0}, {500 * KBIT, 2000 * KBIT}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(rates); i++) {
        CLIENT client;
        can_start(rates[i][0], rates[i][1]);
        CHECK(can_connect(&client, can_tool(200)));
        CHECK(ask(&client));
        CHECK(echo(&client));
        CHECK_EQUAL(BlkDrvCanGetCounters()->aborted, 0);
        can_end();
    }
}

/* Packets that an echo takes when the tool sends packets of up to `packet` bytes, if it may. */
static RTS_UI32 packets_of_an_echo(RTS_UI32 longest)
{
    CLIENT client;

    can_start(500 * KBIT, 0);
    can_client(&client, can_tool(200));
    client.packet = longest;
    CHECK(client_open(&client) && client_login(&client) && client_login_app(&client));
    RTS_UI32 before = BlkDrvCanGetCounters()->packets;
    CHECK(echo(&client));
    RTS_UI32 packets = BlkDrvCanGetCounters()->packets - before;
    can_end();
    return packets;
}

static void a_tool_that_asks_may_send_long_packets(void)
{
    CHECK_EQUAL(packets_of_an_echo(0), 4);
    CHECK_EQUAL(packets_of_an_echo(1000), 2);
    CHECK_EQUAL(packets_of_an_echo(4095), 1);
}

enum { PIECE = 100, TOTAL = 3 * PIECE };

static void send_piece(CLIENT *client, RTS_UI32 offset, RTS_UI32 flags)
{
    RTS_UI8 content[PIECE + 32];
    RTS_UI8 message[PIECE + 64];
    CDL_POSITION position;
    BTAG_WRITER writer;

    BytesPut32(position.flags, flags);
    BytesPut32(position.offset, offset);
    BytesPut32(position.total_size, TOTAL);
    BytesPut32(position.crc, 0x12345678);
    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0, &position, sizeof(position));
    BTagWrite(&writer, TAG_CDL_DATA, BTAG_ALIGN_0, payload, PIECE);
    client_send_message(
        client, message,
        client_message(client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, content, writer.size, message));
}

/* What the device has by now, as the next block it sends says, which has this number; 0: it sends none. */
static RTS_UI32 arrived(CLIENT *client, RTS_UI32 number)
{
    RTS_UI8 message[NETSERVER_MESSAGE_SIZE];
    REPLY reply;

    client->received = number - 1;
    RTS_UI32 size = client_take_message(client, message);
    if (size < 20)
        return 0;
    BTagReaderInit(&reply.tags, message + 20, size - 20);
    return reply_number(&reply, TAG_CDL_NEXT);
}

static void start_download(CLIENT *client)
{
    can_start(500 * KBIT, 0);
    CHECK(can_connect(client, can_tool(200)));
    send_piece(client, 0, DLF_REPLYMAYWAIT);
    can_pass(CHANNEL_REPLY_WAIT_MS / 2);
    CHECK_EQUAL(arrived(client, client->received + 1), 0);
}

static void a_reply_that_may_wait_is_left_out(void)
{
    CLIENT client;

    start_download(&client);
    RTS_UI32 number = client.received + 1;
    send_piece(&client, PIECE, DLF_CONTINUEDOWNLOAD | DLF_REPLYMAYWAIT);
    send_piece(&client, 2 * PIECE, DLF_CONTINUEDOWNLOAD);
    CHECK_EQUAL(arrived(&client, number + 2), TOTAL);
    CHECK_EQUAL(arrived(&client, number + 3), 0);
    CHECK(ask(&client));
    can_end();
}

static void a_reply_that_waits_is_sent_when_nothing_else_comes(void)
{
    CLIENT client;

    start_download(&client);
    RTS_UI32 number = client.received + 1;
    can_pass(CHANNEL_REPLY_WAIT_MS / 2);
    CHECK(arrived(&client, number) == PIECE || arrived(&client, number) == PIECE); /* after a keepalive */
    can_end();
}

static void a_reply_that_waits_is_sent_when_the_tool_polls(void)
{
    CLIENT client;
    RTS_UI8 package[BLK_MAX_SIZE];

    start_download(&client);
    RTS_UI32 number = client.received + 1;
    client_send_block(&client, client.sent, CHANNEL_FLAG_TO_SERVER, payload, 0, 0, 0);
    CHECK(client_take(&client, NULL, package) != 0 && package[0] == CHANNEL_PKG_ACK);
    CHECK_EQUAL(arrived(&client, number), PIECE);
    can_end();
}

static void a_refusal_does_not_wait(void)
{
    CLIENT client;

    start_download(&client);
    RTS_UI32 number = client.received + 2;
    send_piece(&client, 2 * PIECE, DLF_CONTINUEDOWNLOAD | DLF_REPLYMAYWAIT);
    CHECK_EQUAL(arrived(&client, number), PIECE);
    can_end();
}

static void two_tools_are_served_at_once(void)
{
    CLIENT a;
    CLIENT b;

    can_start(500 * KBIT, 0);
    CHECK(can_connect(&a, can_tool(128)));
    CHECK(can_connect(&b, can_tool(254)));
    CHECK(a.session != b.session && a.channel != b.channel);
    for (int i = 0; i < 5; i++)
        CHECK(ask(&a) && echo(&b) && ask(&b) && echo(&a));
    can_end();
}

/* Their frames are mixed on the bus. */
static void packets_of_several_tools_arrive_at_the_same_time(void)
{
    CAN_TOOL *tool[4];
    CLIENT client[4];

    can_start(500 * KBIT, 0);
    for (int i = 0; i < 4; i++) {
        tool[i] = can_tool((RTS_UI8)(130 + i));
        can_client(&client[i], tool[i]);
        RTS_UI32 size = client_packet(&client[i], 99, payload, sizeof(payload), packet);
        CHECK(can_put(tool[i], packet, size));
    }
    can_pass(300);
    CHECK_EQUAL(BlkDrvCanGetCounters()->packets, 4);
    CHECK(!IsoTpIsSending(&tool[0]->tx) && !IsoTpIsSending(&tool[3]->tx));
    can_end();
}

static void more_packets_than_there_is_room_for_are_sent_again(void)
{
    CAN_TOOL *tool[6];
    CLIENT client;

    can_start(500 * KBIT, 0);
    for (int i = 0; i < 6; i++) {
        tool[i] = can_tool((RTS_UI8)(130 + i));
        can_client(&client, tool[i]);
        CHECK(can_put(tool[i], packet, client_packet(&client, 99, payload, sizeof(payload), packet)));
    }
    can_pass(2000);
    CHECK_EQUAL(BlkDrvCanGetCounters()->packets, CAN_RX_SESSIONS);
    CHECK_EQUAL(BlkDrvCanGetCounters()->no_session, 6 - CAN_RX_SESSIONS);
    CHECK(can_connect(&client, tool[5])); /* all sessions are free again */
    can_end();
}

static void a_tool_that_stops_in_the_middle_blocks_no_other(void)
{
    CLIENT client;
    CLIENT dead;
    CAN_TOOL *mute;

    can_start(500 * KBIT, 0);
    mute = can_tool(140);
    CAN_TOOL *tool = can_tool(150);
    CHECK(can_connect(&dead, mute));
    mute->mute = true;
    CHECK(!ask(&dead)); /* the reply is more than a frame */
    CHECK(can_connect(&client, tool));
    CHECK(echo(&client));
    for (int i = 0; i < 2 * CAN_RX_SESSIONS; i++)
        can_frame(mute, DEVICE_NODE,
                  "\x11\x90"
                  "abcdef",
                  8);
    CHECK(echo(&client));
    can_drain(tool);
    CHECK(BlkDrvCanGetCounters()->unsent != 0);
    CHECK(can_connect(&client, can_tool(160)));
    can_end();
}

/* The last frame of a request waits in the controller when this returns. */
static void send_stop(CLIENT *client)
{
    RTS_UI8 content[32];
    RTS_UI8 message[PIECE];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagOpen(&writer, TAG_APP_DESCRIPTOR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_APP_SESSION, client->app_session);
    BTagClose(&writer);
    client_send_message(client, message,
                        client_message(client, SG_APPLICATION, SRV_APP_STOP, content, writer.size, message));
}

/* The frames of another tool came in time, and were read after the service. */
static void a_service_that_takes_long_aborts_no_packet_of_another_tool(void)
{
    static const RTS_UI8 first[] = {0x10, 12, 1, 2, 3, 4, 5, 6};
    static const RTS_UI8 last[] = {0x21, 7, 8, 9, 10, 11, 12};
    CLIENT client;

    can_start(500 * KBIT, 0);
    CHECK(can_connect(&client, can_tool(130)));
    CAN_TOOL *other = can_tool(200);
    fakes.control_ms = 5 * ISOTP_TIMEOUT_MS;
    send_stop(&client);
    can_frame(other, DEVICE_NODE, first, sizeof(first));
    while (SimCanNext() != INT64_MAX)
        SimCanAdvance(SimCanNext());
    CHECK_EQUAL(fakes.stops, 0);
    can_pass(1);
    CHECK_EQUAL(fakes.stops, 1);
    RTS_UI32 packets = BlkDrvCanGetCounters()->packets;
    can_frame(other, DEVICE_NODE, last, sizeof(last));
    can_pass(10);
    CHECK_EQUAL(BlkDrvCanGetCounters()->aborted, 0);
    CHECK_EQUAL(BlkDrvCanGetCounters()->packets, packets + 1);
    can_end();
}

static void ids_tried_in_the_name_of_a_tool_close_nothing(void)
{
    CLIENT client;

    can_start(500 * KBIT, 0);
    CHECK(can_connect(&client, can_tool(200)));
    client_send_guess_and_close(&client);
    can_settle();
    CHECK(ask(&client));
    can_end();
}

/* On classic CAN a packet needs flow control, which a tool that has ended does not send. */
static void tools_that_have_vanished_give_way_in_less_than_a_second(void)
{
    CLIENT client;
    CLIENT gone;
    RTS_UI32 waited = 0;

    can_start(500 * KBIT, 0);
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++) {
        CAN_TOOL *tool = can_tool((RTS_UI8)(130 + i));
        CHECK(can_connect(&gone, tool));
        tool->mute = true;
    }
    can_client(&client, can_tool(200));
    while (!client_open(&client) && waited < 1000) {
        can_pass(100);
        waited += 100;
    }
    CHECK(waited < 1000);
    CHECK(client_login(&client) && echo(&client));
    can_end();
}

/* With ever new addresses in its packets. */
static void a_tool_that_is_many_leaves_a_channel_to_others(void)
{
    CAN_TOOL *crowded;
    CLIENT many[COMM_MAX_CLIENTS];
    CLIENT other;

    can_start(500 * KBIT, 0);
    crowded = can_tool(200);
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++) {
        can_client(&many[i], crowded);
        many[i].address = (RTS_UI16)(0x1000 + i);
        CHECK_EQUAL(client_open(&many[i]) && client_login(&many[i]), i < COMM_HOST_CHANNELS);
    }
    CHECK(can_connect(&other, can_tool(201)));
    can_end();
}

/* ---- scans ---- */

static void scan(CAN_TOOL *tool, RTS_UI8 target, RTS_UI8 window, RTS_UI32 request_id)
{
    CAN_SCAN frame = {CAN_FRAME_SCAN, window, {0}, {0}};

    BytesPut16(frame.version, NS_VERSION_0400);
    BytesPut32(frame.request_id, request_id);
    can_frame(tool, target, &frame, sizeof(frame));
}

static bool is_reply(RTS_UI32 size, RTS_UI32 request_id)
{
    return size > 60 && packet[3] == ROUTER_SVC_NAME_RESPONSE && BytesGet32(packet + 12 + 4) == request_id &&
           packet[9] == DEVICE_NODE && packet[12 + 38] == BLK_DRV_TYPE_CAN;
}

static void a_scan_of_all_or_of_one_is_answered(void)
{
    can_start(250 * KBIT, 0);
    CAN_TOOL *tool = can_tool(222);
    scan(tool, CAN_TO_ALL, 0, 0x01020304);
    can_pass(100);
    CHECK(is_reply(can_take(tool, packet, sizeof(packet)), 0x01020304));
    scan(tool, DEVICE_NODE, 0, 5);
    can_pass(100);
    CHECK(is_reply(can_take(tool, packet, sizeof(packet)), 5));
    scan(tool, DEVICE_NODE + 1, 0, 6);
    can_pass(100);
    CHECK_EQUAL(can_take(tool, packet, sizeof(packet)), 0);
    can_end();
}

static void a_scan_that_is_cut_is_not_answered(void)
{
    const RTS_UI8 cut[sizeof(CAN_SCAN)] = {CAN_FRAME_SCAN};

    can_start(250 * KBIT, 0);
    CAN_TOOL *tool = can_tool(222);
    scan(tool, CAN_TO_ALL, 0, 1); /* what is left of it in the device would make the next one whole */
    can_pass(100);
    CHECK(is_reply(can_take(tool, packet, sizeof(packet)), 1));
    for (RTS_UI8 size = 1; size < sizeof(cut); size++) {
        can_frame(tool, CAN_TO_ALL, cut, size);
        can_pass(100);
        CHECK_EQUAL(can_take(tool, packet, sizeof(packet)), 0);
    }
    CHECK_EQUAL(BlkDrvCanGetCounters()->scans, 1);
    can_end();
}

static void the_answer_comes_at_a_random_moment_of_the_window(void)
{
    enum { WINDOW = 20, RUNS = 40 };
    RTS_UI32 early = 0;
    RTS_UI32 late = 0;

    can_start(1000 * KBIT, 0);
    CAN_TOOL *tool = can_tool(222);
    for (RTS_UI32 run = 0; run < RUNS; run++) {
        RTS_UI32 ms = 0;
        scan(tool, CAN_TO_ALL, WINDOW, run);
        scan(tool, CAN_TO_ALL, WINDOW, run); /* again: one answer */
        for (; tool->count == 0 && ms < 1000; ms++)
            can_pass(1);
        CHECK(ms <= WINDOW * CAN_SCAN_UNIT_MS + 20);
        early += ms < WINDOW * CAN_SCAN_UNIT_MS / 2;
        late += ms >= WINDOW * CAN_SCAN_UNIT_MS / 2;
        CHECK(is_reply(can_take(tool, packet, sizeof(packet)), run));
        can_pass(WINDOW * CAN_SCAN_UNIT_MS);
        CHECK_EQUAL(tool->count, 0);
    }
    CHECK(early > RUNS / 5 && late > RUNS / 5);
    can_end();
}

static void scans_of_two_tools_are_both_answered(void)
{
    can_start(500 * KBIT, 0);
    CAN_TOOL *a = can_tool(200);
    CAN_TOOL *b = can_tool(201);
    scan(a, CAN_TO_ALL, 5, 1);
    scan(b, CAN_TO_ALL, 5, 2);
    can_pass(200);
    CHECK(is_reply(can_take(a, packet, sizeof(packet)), 1));
    CHECK(is_reply(can_take(b, packet, sizeof(packet)), 2));
    can_end();
}

/* ---- what is not for us ---- */

/* Frames that look as if more of a packet were to come, and a scan, but not for us. */
static void send_frames_of_others(void)
{
    static const struct {
        RTS_UI32 id;
        RTS_UI8 flags;
    } frames[] = {
        {0x605, 0}, /* CANopen: SDO to node 5 */
        {0x705, 0},
        {0x18DA05F1, CAN_FLAG_EXTENDED},                             /* diagnostics of vehicles */
        {(CAN_ID_BASE ^ 1 << 20) | 5 << 8 | 200, CAN_FLAG_EXTENDED}, /* with another base */
        {CAN_ID_BASE | 6 << 8 | 200, CAN_FLAG_EXTENDED},
        {CAN_ID_BASE | 5 << 8 | 200, CAN_FLAG_EXTENDED | CAN_FLAG_REMOTE},
        {CAN_ID_BASE | 5 << 8 | 255, CAN_FLAG_EXTENDED},
        {CAN_ID_BASE | 5 << 8 | 0, CAN_FLAG_EXTENDED},
        {CAN_ID_BASE | 5 << 8 | 7, CAN_FLAG_EXTENDED},     /* another device */
        {CAN_ID_BASE | 255 << 8 | 200, CAN_FLAG_EXTENDED}, /* ISO-TP to all */
    };

    CAN_TOOL *tool = can_tool(200);
    RTS_UI32 before = SimCanFrames();
    for (RTS_UI32 i = 0; i < RTS_COUNT(frames); i++) {
        CAN_FRAME frame = {.id = frames[i].id, .flags = frames[i].flags, .size = 8, .data = {0x10, 100}};
        CHECK_EQUAL(SimCanSend(tool->node, &frame), ERR_OK);
    }
    can_pass(50);
    CHECK_EQUAL(SimCanFrames(), before + RTS_COUNT(frames)); /* not one flow control frame */
    scan(tool, DEVICE_NODE + 1, 0, 6);
    can_pass(50);
    CHECK_EQUAL(can_take(tool, packet, sizeof(packet)), 0);
}

static void frames_of_others_are_left_alone(void)
{
    can_start(500 * KBIT, 0);
    send_frames_of_others();
    can_end();
}

static void frames_of_others_are_left_alone_too_if_the_controller_has_too_few_filters(void)
{
    static const CAN_FILTER all[] = {{.extended = false}, {.extended = true}};

    can_start(500 * KBIT, 0);
    CHECK_EQUAL(SimCanSetFilters(SIM_CAN_DEVICE, all, RTS_COUNT(all)), ERR_OK);
    send_frames_of_others();
    can_end();
}

static void another_device_with_our_number_is_noticed(void)
{
    can_start(500 * KBIT, 0);
    RTS_UI32 logged = fakes.log_added;
    CAN_TOOL *other = can_tool(DEVICE_NODE);
    for (int i = 0; i < 3; i++)
        can_frame(other, 200, "\x03xyz", 4); /* as devices do: to a tool */
    can_pass(10);
    CHECK_EQUAL(BlkDrvCanGetCounters()->same_node, 3);
    CHECK_EQUAL(fakes.log_added, logged + 1);
    can_end();
}

/* ---- bad times ---- */

static void lost_frames_cost_time_but_no_data(void)
{
    CLIENT client;

    can_start(500 * KBIT, 0);
    CAN_TOOL *tool = can_tool(200);
    CHECK(can_connect(&client, tool));
    SimCanLose(SIM_CAN_DEVICE, 97); /* overruns */
    int good = 0;
    for (int i = 0; i < 20; i++) {
        bool done = ask(&client);
        good += done;
        if (!done) {
            can_drain(tool);
            (void)can_connect(&client, tool);
        }
    }
    CHECK(BlkDrvCanGetCounters()->aborted + tool->failed != 0);
    CHECK(good > 10);
    SimCanLose(SIM_CAN_DEVICE, 0);
    can_drain(tool);
    CHECK(can_connect(&client, tool) && echo(&client));
    can_end();
}

static void destroyed_frames_are_not_even_noticed(void)
{
    CLIENT client;

    can_start(500 * KBIT, 0);
    CHECK(can_connect(&client, can_tool(200)));
    SimCanDestroy(SIM_CAN_DEVICE, 5);
    CHECK(echo(&client));
    CHECK_EQUAL(BlkDrvCanGetCounters()->aborted, 0);
    can_end();
}

static void the_device_comes_back_from_bus_off(void)
{
    CLIENT client;
    CAN_STATE state;

    can_start(500 * KBIT, 0);
    CAN_TOOL *tool = can_tool(200);
    CHECK(can_connect(&client, tool));
    SimCanDestroy(SIM_CAN_DEVICE, 32);
    CHECK(!ask(&client));
    CHECK_EQUAL(BlkDrvCanGetCounters()->bus_off, 1);
    can_pass(CAN_RESTART_MS + 10);
    SysCanGetState(0, &state);
    CHECK_EQUAL(state.bus, CAN_BUS_ACTIVE);
    can_drain(tool);
    CHECK(can_connect(&client, tool) && echo(&client));
    can_end();
}

/* The log is short. */
static void a_bus_that_goes_off_again_and_again_is_two_entries_of_the_log(void)
{
    enum { TIMES = 20 };
    CLIENT client;

    can_start(500 * KBIT, 0);
    CAN_TOOL *tool = can_tool(200);
    CHECK(can_connect(&client, tool));
    RTS_UI32 logged = fakes.log_added;
    for (int i = 0; i < TIMES; i++) {
        SimCanDestroy(SIM_CAN_DEVICE, 32);
        (void)can_connect(&client, tool);
        can_pass(CAN_STEADY_MS / 2);
    }
    CHECK_EQUAL(BlkDrvCanGetCounters()->bus_off, TIMES);
    CHECK_EQUAL(fakes.log_added, logged + 1);
    can_pass(CAN_STEADY_MS);
    CHECK_EQUAL(fakes.log_added, logged + 2);
    CHECK(strcmp(fakes.log_text, "CAN: the bus is back (times off: 20)") == 0);
    can_pass(2 * CAN_STEADY_MS);
    CHECK_EQUAL(fakes.log_added, logged + 2);
    SimCanDestroy(SIM_CAN_DEVICE, 32);
    (void)can_connect(&client, tool);
    CHECK_EQUAL(fakes.log_added, logged + 3); /* another trouble */
    can_end();
}

static void a_device_without_a_number_takes_no_part(void)
{
    can_start(500 * KBIT, 0);
    SimCanSetAddress(0, CAN_ID_BASE);
    fakes_run_init_hooks();
    CAN_TOOL *tool = can_tool(200);
    scan(tool, CAN_TO_ALL, 0, 1);
    can_pass(100);
    CHECK_EQUAL(tool->count, 0);
    can_end();
}

static void an_address_that_cannot_be_is_refused(void)
{
    static const CAN_ADDRESS bad[] = {
        {CAN_ID_BASE, 128}, {CAN_ID_BASE, 257}, {CAN_ID_BASE, 0xFFFFFFFF}, {CAN_ID_BASE | 0x100, 5}, {0x3F400000, 5}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(bad); i++) {
        can_start(500 * KBIT, 0);
        SimCanSetAddress(bad[i].node, bad[i].base);
        RTS_UI32 logged = fakes.log_added;
        fakes_run_init_hooks();
        CHECK_EQUAL(fakes.log_added, logged + 1);
        CAN_TOOL *tool = can_tool(200);
        scan(tool, CAN_TO_ALL, 0, 1);
        can_pass(100);
        CHECK_EQUAL(tool->count, 0);
        can_end();
    }
}

int main(void)
{
    RUN(a_tool_logs_in_on_classic_can_and_fd);
    RUN(a_tool_that_asks_may_send_long_packets);
    RUN(a_reply_that_may_wait_is_left_out);
    RUN(a_reply_that_waits_is_sent_when_nothing_else_comes);
    RUN(a_reply_that_waits_is_sent_when_the_tool_polls);
    RUN(a_refusal_does_not_wait);
    RUN(two_tools_are_served_at_once);
    RUN(packets_of_several_tools_arrive_at_the_same_time);
    RUN(more_packets_than_there_is_room_for_are_sent_again);
    RUN(a_tool_that_stops_in_the_middle_blocks_no_other);
    RUN(a_service_that_takes_long_aborts_no_packet_of_another_tool);
    RUN(ids_tried_in_the_name_of_a_tool_close_nothing);
    RUN(tools_that_have_vanished_give_way_in_less_than_a_second);
    RUN(a_tool_that_is_many_leaves_a_channel_to_others);
    RUN(a_scan_of_all_or_of_one_is_answered);
    RUN(a_scan_that_is_cut_is_not_answered);
    RUN(the_answer_comes_at_a_random_moment_of_the_window);
    RUN(scans_of_two_tools_are_both_answered);
    RUN(frames_of_others_are_left_alone);
    RUN(frames_of_others_are_left_alone_too_if_the_controller_has_too_few_filters);
    RUN(another_device_with_our_number_is_noticed);
    RUN(lost_frames_cost_time_but_no_data);
    RUN(destroyed_frames_are_not_even_noticed);
    RUN(the_device_comes_back_from_bus_off);
    RUN(a_bus_that_goes_off_again_and_again_is_two_entries_of_the_log);
    RUN(a_device_without_a_number_takes_no_part);
    RUN(an_address_that_cannot_be_is_refused);
    return test_result();
}
