/*
 * test_node_name.c - the name that a client gives the node, on a whole device of the simulator.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "NodeName.h"
#include "SysTarget.h"
#include "files_client.h"

static void setup(void)
{
    start_device(64 * 1024, 1024, 8 * 1024);
}

/* Result of giving the node a name of `length` characters, all of them from `text`; its TAG_ERROR. */
static RTS_UI32 give(const char *text, RTS_UI32 length)
{
    RTS_UI8 content[300];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagOpen(&writer, TAG_DEV_NEW_NODE_NAME, BTAG_ALIGN_0);
    for (RTS_UI32 i = 0; i < length; i++)
        BTagAppend16(&writer, (RTS_UI8)text[i]);
    BTagAppend16(&writer, 0);
    BTagClose(&writer);
    CHECK(client_call(&client, SG_DEVICE, SRV_DEV_SET_NODE_NAME, &writer, &reply));
    return reply_error(&reply) != ERR_OK ? reply_error(&reply) : number_in(0, TAG_SERVICE_RESULT);
}

/* Whether the identity has this name. */
static bool is_called(const char *name)
{
    BTAG tag;
    RTS_UI32 length = (RTS_UI32)strlen(name);

    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_NODE_NAME, 6, 200, &tag), ERR_OK);
    if (BytesGet32(tag.data) != 2 * (length + 1))
        return false;
    for (RTS_UI32 i = 0; i < length; i++)
        if (BytesGet16(tag.data + 4 + 2 * i) != (RTS_UI8)name[i])
            return false;
    return true;
}

static void a_name_lasts_until_an_empty_one_takes_it_back(void)
{
    setup();
    CHECK_EQUAL(give("Mixer 7", 7), ERR_OK);
    CHECK(is_called("Mixer 7"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(reconnect() && is_called("Mixer 7"));
    CHECK_EQUAL(give("", 0), ERR_OK);
    CHECK(is_called(SysTargetGet()->node_name));
    CHECK_EQUAL(give("", 0), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(reconnect() && is_called(SysTargetGet()->node_name));
}

static void the_longest_name_has_49_characters_of_ascii(void)
{
    static const char longest[] = "0123456789012345678901234567890123456789012345678";

    setup();
    CHECK_EQUAL(sizeof(longest) - 1, NS_MAX_NODE_NAME);
    CHECK_EQUAL(give(longest, NS_MAX_NODE_NAME), ERR_OK);
    CHECK(is_called(longest));
    CHECK_EQUAL(give("01234567890123456789012345678901234567890123456789", NS_MAX_NODE_NAME + 1), ERR_PARAMETER);
    CHECK_EQUAL(give("M\xFCller", 6), ERR_PARAMETER);
    CHECK_EQUAL(give("a\nb", 3), ERR_PARAMETER);
    CHECK_EQUAL(give("a\x7F", 2), ERR_PARAMETER);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SET_NODE_NAME, (const RTS_UI8 *)"\x58\x04\x41\x01\x00\x00", 6,
                         &reply)); /* U+0141, of which the lower byte is a letter */
    CHECK_EQUAL(number_in(0, TAG_SERVICE_RESULT), ERR_PARAMETER);
    CHECK(is_called(longest));
}

static void a_request_without_name_or_with_half_a_character_changes_nothing(void)
{
    setup();
    CHECK_EQUAL(give("here", 4), ERR_OK);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SET_NODE_NAME, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    CHECK(
        client_request(&client, SG_DEVICE, SRV_DEV_SET_NODE_NAME, (const RTS_UI8 *)"\x58\x03\x41\x00\x42", 5, &reply));
    CHECK(is_called("A")); /* what is whole of it counts */
}

static void it_waits_for_a_file_that_is_being_written_but_not_for_one_that_was_left(void)
{
    RTS_UI8 data[100] = {0};
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(put_begin("recipe", data, sizeof(data), &handle), ERR_OK);
    CHECK_EQUAL(give("other", 5), ERR_INVALID_STATE);
    CHECK_EQUAL(put_part(handle, 0, data, sizeof(data)), ERR_OK);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_OK);
    CHECK_EQUAL(give("other", 5), ERR_OK);
    CHECK_EQUAL(put_begin("recipe", data, sizeof(data), &handle), ERR_OK);
    CHECK(reconnect());
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(give("third", 5), ERR_OK);
    CHECK(is_called("third"));
}

static void a_name_that_was_put_as_a_file_counts_as_far_as_it_is_one(void)
{
    static const RTS_UI8 line[] = "Line 2\r\nand more";
    static const RTS_UI8 control[] = "\r\n";

    setup();
    CHECK_EQUAL(put(FILE_NAME_NODE, line, sizeof(line) - 1), ERR_OK);
    CHECK(is_called("Line 2"));
    CHECK_EQUAL(put(FILE_NAME_NODE, control, sizeof(control) - 1), ERR_OK);
    CHECK(is_called(SysTargetGet()->node_name));
}

static void without_room_for_files_it_is_refused(void)
{
    start_device(64 * 1024, 1024, 0);
    CHECK(give("name", 4) != ERR_OK);
    CHECK(is_called(SysTargetGet()->node_name));
}

int main(void)
{
    RUN(a_name_lasts_until_an_empty_one_takes_it_back);
    RUN(the_longest_name_has_49_characters_of_ascii);
    RUN(a_request_without_name_or_with_half_a_character_changes_nothing);
    RUN(it_waits_for_a_file_that_is_being_written_but_not_for_one_that_was_left);
    RUN(a_name_that_was_put_as_a_file_counts_as_far_as_it_is_one);
    RUN(without_room_for_files_it_is_refused);
    return test_result();
}
