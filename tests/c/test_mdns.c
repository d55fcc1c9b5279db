/*
 * test_mdns.c - messages of multicast DNS: what a device replies, and what it makes of bad messages.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Mdns.h"
#include "test.h"

enum {
    TYPE_A = 1,
    TYPE_PTR = 12,
    TYPE_SRV = 33,
    TYPE_AAAA = 28,
    TYPE_ANY = 255,
    CLASS_IN = 1,
    UNICAST = 0x8000,
    TTL_S = 4500
};

static MDNS_DEVICE device;
static RTS_UI8 message[MDNS_QUERY_SIZE + 1];
static RTS_UI32 message_size;
static RTS_UI8 reply[MDNS_REPLY_SIZE];
static RTS_UI32 reply_size;

static void begin(void)
{
    device = (MDNS_DEVICE){.instance = "press 1", .host = "press-1", .ip = 0xC0A80105, .port = 11740};
    strcpy(device.text[0], "device=plcrt");
    memset(message, 0, sizeof(message));
    message_size = 12;
}

static void add8(unsigned value)
{
    message[message_size++] = (RTS_UI8)value;
}

static void add16(unsigned value)
{
    add8(value >> 8);
    add8(value & 0xFF);
}

/* "a.b" as labels; '|' is a dot in a label. */
static void add_name(const char *name)
{
    while (*name != '\0') {
        size_t length = strcspn(name, ".");
        add8((unsigned)length);
        for (size_t i = 0; i < length; i++)
            add8(name[i] == '|' ? '.' : (RTS_UI8)name[i]);
        name += length + (name[length] == '.');
    }
    add8(0);
}

static void add_question(const char *name, unsigned type, unsigned class)
{
    add_name(name);
    add16(type);
    add16(class);
    message[5]++;
}

/* A record with room for its data, whose size is set by end_record. */
static RTS_UI32 begin_record(const char *name, unsigned type, unsigned ttl_s, unsigned count_at)
{
    add_name(name);
    add16(type);
    add16(CLASS_IN);
    add16(0);
    add16(ttl_s);
    add16(0);
    message[count_at + 1]++;
    return message_size;
}

static void end_record(RTS_UI32 data_at)
{
    message[data_at - 2] = (RTS_UI8)((message_size - data_at) >> 8);
    message[data_at - 1] = (RTS_UI8)(message_size - data_at);
}

static MDNS_RECEIVER ask_from(RTS_UI16 port)
{
    reply_size = 0;
    return MdnsReply(&device, message, message_size, port, reply, &reply_size);
}

static MDNS_RECEIVER ask(const char *name, unsigned type, unsigned class)
{
    begin();
    add_question(name, type, class);
    return ask_from(MDNS_PORT);
}

static bool has(const void *bytes, size_t size)
{
    for (RTS_UI32 i = 0; i + size <= reply_size; i++)
        if (memcmp(reply + i, bytes, size) == 0)
            return true;
    return false;
}

/* ---- replies ---- */

static void a_search_for_the_service_gets_all_that_is_needed_to_connect(void)
{
    CHECK_EQUAL(ask("_plcrt._tcp.local", TYPE_PTR, CLASS_IN), MDNS_TO_ALL);
    CHECK_EQUAL(reply[7], 1);
    CHECK_EQUAL(reply[11], 3);
    CHECK(has("\7press 1\6_plcrt\4_tcp\5local", 26));
    CHECK(has("\0\0\0\0\x2D\xDC\7press-1\5local", 20));
    CHECK(has("\xC0\xA8\1\5", 4));
    CHECK(has("\14device=plcrt", 13));
}

static void each_name_of_the_device_is_answered_whatever_its_case(void)
{
    CHECK_EQUAL(ask("_services._dns-sd._udp.local", TYPE_PTR, CLASS_IN), MDNS_TO_ALL);
    CHECK_EQUAL(ask("PRESS-1.Local", TYPE_A, CLASS_IN), MDNS_TO_ALL);
    CHECK_EQUAL(reply[7], 1);
    CHECK_EQUAL(ask("Press 1._PLCRT._tcp.local", TYPE_ANY, CLASS_IN), MDNS_TO_ALL);
    CHECK_EQUAL(reply[7], 2);
}

static void questions_about_others_are_not_answered(void)
{
    CHECK_EQUAL(ask("press-2.local", TYPE_A, CLASS_IN), MDNS_SILENCE);
    CHECK_EQUAL(ask("press-1.local", TYPE_AAAA, CLASS_IN), MDNS_SILENCE);
    CHECK_EQUAL(ask("press-1.local", TYPE_A, 3), MDNS_SILENCE);
    CHECK_EQUAL(ask("press-1.local.com", TYPE_A, CLASS_IN), MDNS_SILENCE);
    CHECK_EQUAL(ask("press|1.local", TYPE_A, CLASS_IN), MDNS_SILENCE);
}

static void a_reply_goes_to_the_sender_alone_if_all_questions_want_that(void)
{
    CHECK_EQUAL(ask("press-1.local", TYPE_A, CLASS_IN | UNICAST), MDNS_TO_SENDER);
    add_question("_plcrt._tcp.local", TYPE_PTR, CLASS_IN);
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_TO_ALL);
}

static void a_simple_resolver_gets_its_number_and_question_back(void)
{
    begin();
    message[0] = 0x12;
    message[1] = 0x34;
    add_question("press-1.local", TYPE_A, CLASS_IN);
    CHECK_EQUAL(ask_from(50000), MDNS_TO_SENDER);
    CHECK_EQUAL(reply[0], 0x12);
    CHECK_EQUAL(reply[1], 0x34);
    CHECK_EQUAL(reply[5], 1);
    CHECK(memcmp(reply + 12, message + 12, message_size - 12) == 0);
    CHECK(has("\0\1\0\1\0\0\0\12\0\4\xC0\xA8\1\5", 14)); /* kept for 10 s, no flush bit */
}

static void what_the_sender_knows_is_left_out(void)
{
    begin();
    add_question("_plcrt._tcp.local", TYPE_PTR, CLASS_IN);
    RTS_UI32 data = begin_record("_plcrt._tcp.local", TYPE_PTR, TTL_S, 6);
    add_name("press 1._plcrt._tcp.local");
    end_record(data);
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_SILENCE);
    message[data - 4] = 2000 >> 8; /* less than half of its time is left */
    message[data - 3] = 2000 & 0xFF;
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_TO_ALL);
}

/* ---- bad messages ---- */

static void a_message_that_ends_anywhere_is_not_answered(void)
{
    ask("_plcrt._tcp.local", TYPE_PTR, CLASS_IN);
    for (RTS_UI32 whole = message_size; message_size > 0;) {
        message_size--;
        RTS_UI8 *copy = malloc(message_size + 1); /* so that a sanitizer sees what is read after it */
        memcpy(copy, message, message_size);
        CHECK_EQUAL(MdnsReply(&device, copy, message_size, MDNS_PORT, reply, &reply_size), MDNS_SILENCE);
        CHECK_EQUAL(MdnsFindClash(&device, copy, message_size, false), MDNS_NO_CLASH);
        free(copy);
        CHECK(whole > message_size);
    }
}

static void lies_about_counts_and_sizes_are_not_followed(void)
{
    ask("_plcrt._tcp.local", TYPE_PTR, CLASS_IN);
    message[4] = 0xFF; /* 65281 questions */
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_SILENCE);
    begin();
    message[2] = 0x84;
    RTS_UI32 data = begin_record("press-1.local", TYPE_A, TTL_S, 6);
    message[data - 2] = 0xFF; /* 65280 bytes of data */
    CHECK_EQUAL(MdnsFindClash(&device, message, message_size, false), MDNS_NO_CLASH);
    begin();
    data = begin_record("press 1._plcrt._tcp.local", TYPE_SRV, TTL_S, 6);
    add16(0);
    end_record(data); /* shorter than priority, weight and port, and nothing follows */
    message[2] = 0x84;
    CHECK_EQUAL(MdnsFindClash(&device, message, message_size, false), MDNS_NO_CLASH);
}

static void a_name_that_leads_to_itself_or_forward_ends(void)
{
    for (unsigned to = 0; to < 40; to++) {
        begin();
        add8(0xC0);
        add8(to);
        add16(TYPE_PTR);
        add16(CLASS_IN);
        message[5] = 1;
        CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_SILENCE);
    }
}

/* Questions whose names are 63 bytes and a pointer to the previous one, and then one about the device. */
static MDNS_RECEIVER ask_with_chain(unsigned length)
{
    begin();
    unsigned previous = 11; /* a 0 of the header: the end of a name */
    for (unsigned i = 0; i < length; i++) {
        unsigned start = message_size;
        add8(63);
        memset(message + message_size, 'a', 63);
        message_size += 63;
        add16(0xC000 | previous);
        add16(TYPE_A);
        add16(CLASS_IN);
        previous = start;
    }
    message[5] = (RTS_UI8)length;
    add_question("press-1.local", TYPE_A, CLASS_IN);
    return ask_from(MDNS_PORT);
}

static void a_name_that_grows_by_pointers_is_refused_above_255_bytes(void)
{
    CHECK_EQUAL(ask_with_chain(3), MDNS_TO_ALL);
    CHECK_EQUAL(ask_with_chain(4), MDNS_SILENCE);
}

static void a_message_that_is_too_long_or_a_response_is_not_answered(void)
{
    ask("_plcrt._tcp.local", TYPE_PTR, CLASS_IN);
    message[2] = 0x80;
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_SILENCE);
    message[2] = 0x08; /* another operation */
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_SILENCE);
    message[2] = 0;
    message_size = sizeof(message);
    CHECK_EQUAL(ask_from(MDNS_PORT), MDNS_SILENCE);
}

static void the_longest_names_and_texts_fit_a_reply(void)
{
    begin();
    memset(device.instance, 'i', MDNS_LABEL_SIZE - 1);
    memset(device.host, 'h', MDNS_LABEL_SIZE - 1);
    for (int i = 0; i < MDNS_TEXTS; i++)
        memset(device.text[i], 't', MDNS_TEXT_SIZE - 1);
    char name[128];
    snprintf(name, sizeof(name), "%s._plcrt._tcp.local", device.instance);
    add_question(name, TYPE_ANY, CLASS_IN);
    add_question("_plcrt._tcp.local", TYPE_PTR, CLASS_IN);
    add_question("_services._dns-sd._udp.local", TYPE_PTR, CLASS_IN);
    CHECK_EQUAL(ask_from(50000), MDNS_TO_SENDER);
    CHECK(reply_size > 1000 && reply_size <= MDNS_REPLY_SIZE);
}

/* ---- names of others ---- */

static void its_own_messages_are_no_clash(void)
{
    begin();
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsProbe(&device, message), false), MDNS_NO_CLASH);
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsAnnounce(&device, false, message), false), MDNS_NO_CLASH);
}

static void another_device_that_has_a_name_is_a_clash_until_it_leaves(void)
{
    begin();
    MDNS_DEVICE other = device;
    other.port = 11741;
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsAnnounce(&other, false, message), false), MDNS_TAKEN);
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsAnnounce(&other, true, message), false), MDNS_NO_CLASH);
    other = device;
    other.ip++;
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsAnnounce(&other, false, message), false), MDNS_TAKEN);
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsAnnounce(&other, false, message), true), MDNS_NO_CLASH);
}

static void of_two_that_ask_at_once_one_has_precedence(void)
{
    begin();
    MDNS_DEVICE other = device;
    other.port = 11741;
    CHECK_EQUAL(MdnsFindClash(&device, message, MdnsProbe(&other, message), false), MDNS_RACE);
    CHECK_EQUAL(MdnsFindClash(&other, message, MdnsProbe(&device, message), false), MDNS_NO_CLASH);
}

/* ---- labels ---- */

static const char *label(const char *name, RTS_UI32 number, bool host)
{
    static char made[MDNS_LABEL_SIZE];

    MdnsMakeLabel(made, name, number, host);
    return made;
}

static void labels_keep_what_a_name_may_have(void)
{
    CHECK(strcmp(label("press 1", 1, false), "press 1") == 0);
    CHECK(strcmp(label("press 1", 2, false), "press 1 (2)") == 0);
    CHECK(strcmp(label("press 1", 12, true), "press-1-12") == 0);
    CHECK(strcmp(label("a.b\\c\n\x1B[31m", 1, false), "a.b\\c--[31m") == 0);
    CHECK(strcmp(label("a.b\\c_\xC3\xA4", 1, true), "a-b-c---") == 0);
    CHECK(strcmp(label("", 1, true), "-") == 0);
    CHECK(strcmp(label("a\xC3\xFF\x80z\xE2\x82", 1, false), "a---z--") == 0); /* not UTF-8 */
}

static void a_long_label_is_cut_at_a_whole_character(void)
{
    char name[MDNS_LABEL_SIZE + 4];

    memset(name, 'x', sizeof(name));
    strcpy(name + 62, "\xC3\xA4");
    CHECK_EQUAL(strlen(label(name, 1, false)), 62);
    CHECK_EQUAL(strlen(label(name, 99, false)), 63);
    CHECK(strcmp(label(name, 99, false) + 58, " (99)") == 0);
}

int main(void)
{
    RUN(a_search_for_the_service_gets_all_that_is_needed_to_connect);
    RUN(each_name_of_the_device_is_answered_whatever_its_case);
    RUN(questions_about_others_are_not_answered);
    RUN(a_reply_goes_to_the_sender_alone_if_all_questions_want_that);
    RUN(a_simple_resolver_gets_its_number_and_question_back);
    RUN(what_the_sender_knows_is_left_out);
    RUN(a_message_that_ends_anywhere_is_not_answered);
    RUN(lies_about_counts_and_sizes_are_not_followed);
    RUN(a_name_that_leads_to_itself_or_forward_ends);
    RUN(a_name_that_grows_by_pointers_is_refused_above_255_bytes);
    RUN(a_message_that_is_too_long_or_a_response_is_not_answered);
    RUN(the_longest_names_and_texts_fit_a_reply);
    RUN(its_own_messages_are_no_clash);
    RUN(another_device_that_has_a_name_is_a_clash_until_it_leaves);
    RUN(of_two_that_ask_at_once_one_has_precedence);
    RUN(labels_keep_what_a_name_may_have);
    RUN(a_long_label_is_cut_at_a_whole_character);
    return test_result();
}
