/*
 * test_comm_shell.c - CmpPlcShell: commands in words, answers of any length.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdio.h>
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpOperationControl.h"
#include "CmpSrv.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

static CLIENT client;
static REPLY reply;
static char text[8192];
static RTS_UI32 parts;
static RTS_UI32 refused; /* the error, 0 when it was done */

static void setup(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    CHECK(client_open(&client) && client_login(&client));
}

/* Part `block` of the answer, appended to `text`; the tag it came in. */
static RTS_UI32 ask_part(const char *command, RTS_UI32 block)
{
    RTS_UI8 content[128];
    BTAG_WRITER writer;
    BTAG_READER part;
    BTAG head;
    BTAG tag;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_SHELL_SESSION, client.session);
    BTagWrite32(&writer, TAG_SHELL_BLOCK, block);
    BTagOpen(&writer, TAG_SHELL_COMMAND, BTAG_ALIGN_2);
    BTagAppendText(&writer, command, sizeof(content));
    BTagClose(&writer);
    CHECK(client_call(&client, SG_PLCSHELL, SRV_SHELL_EXECUTE, &writer, &reply));
    if (reply_error(&reply) != ERR_OK)
        return 0;
    CHECK_EQUAL(BTagReadNext(&reply.tags, &head), ERR_OK);
    CHECK_EQUAL(BTagReadContainer(&reply.tags, &head, &part), ERR_OK);
    CHECK_EQUAL(BTagFind(&part, TAG_SHELL_TEXT, 1, sizeof(reply.message), &tag), ERR_OK);
    strncat(text, (const char *)tag.data, tag.size);
    refused = 0;
    CHECK_EQUAL(BTagFindOptional(&part, TAG_SHELL_RESULT, &refused), ERR_OK);
    return head.id;
}

/* The whole answer. */
static const char *ask(const char *command)
{
    text[0] = '\0';
    for (parts = 1; ask_part(command, parts - 1) == TAG_SHELL_PART && parts < 100; parts++) {
    }
    return text;
}

static void help_names_every_command(void)
{
    static const char *const names[] = {"?",        "rtsinfo",      "applist", "getprgstat", "startprg", "stopprg",
                                        "resetprg", "resetprgcold", "reload",  "tasklist",   "plcload",  "channelinfo"};
    char line[64];

    setup();
    ask("?");
    for (RTS_UI32 i = 0; i < RTS_COUNT(names); i++) {
        snprintf(line, sizeof(line), "%s: ", names[i]);
        CHECK(strstr(text, line) != NULL);
    }
}

static void an_unknown_command_says_where_the_list_is(void)
{
    setup();
    CHECK(strcmp(ask("mem"), "There is no such command; ? lists them.\r\n") == 0);
    CHECK_EQUAL(refused, ERR_NO_OBJECT);
    CHECK(strcmp(ask("startprgx"), text) == 0);
    CHECK_EQUAL(fakes.starts, 0);
}

static void without_application_it_says_so(void)
{
    setup();
    CHECK(strcmp(ask("applist"), "Application\r\n") == 0);
    fakes.status.state = AS_NONE;
    CHECK(strcmp(ask("applist"), "No Application loaded\r\n") == 0);
    CHECK(strcmp(ask("getprgstat"), "No Application loaded\r\n") == 0);
}

static void the_state_has_its_exception(void)
{
    setup();
    fakes.status.state = AS_RUN;
    CHECK(strcmp(ask("getprgstat"), "run\r\n") == 0);
    fakes.status.state = AS_STOP;
    fakes.status.exception.code = 0x101;
    CHECK(strcmp(ask("getprgstat"), "stop\r\nexception 0x00000101\r\n") == 0);
}

static void commands_that_change_something_need_the_right_to(void)
{
    setup();
    ChannelGetClient(0)->session.rights = RIGHT_VIEW;
    CHECK(strcmp(ask("startprg"), "You may not do this.\r\n") == 0);
    CHECK_EQUAL(refused, ERR_NO_ACCESS_RIGHTS);
    CHECK(strcmp(ask("applist"), "Application\r\n") == 0);
    CHECK_EQUAL(refused, 0);
    CHECK_EQUAL(fakes.starts, 0);
}

static void what_the_program_forbids_is_not_done(void)
{
    setup();
    fakes.forbidden = 1 << OPERATION_STOP | 1 << OPERATION_RESET;
    ask("stopprg");
    CHECK_EQUAL(refused, ERR_OPERATION_DENIED);
    ask("resetprg");
    CHECK_EQUAL(refused, ERR_OPERATION_DENIED);
    ask("resetprgcold");
    CHECK_EQUAL(refused, ERR_OPERATION_DENIED);
    ask("reload");
    CHECK_EQUAL(refused, ERR_OPERATION_DENIED);
    CHECK_EQUAL(fakes.stops + fakes.resets + fakes.reloads, 0);
    CHECK(strcmp(ask("startprg"), "startprg: done\r\n") == 0);
}

static void commands_that_change_something_do_it_once(void)
{
    setup();
    CHECK(strcmp(ask("startprg"), "startprg: done\r\n") == 0);
    CHECK(strcmp(ask("stopprg"), "stopprg: done\r\n") == 0);
    ask("resetprg");
    CHECK_EQUAL(fakes.reset_option, RESET_OPTION_WARM);
    ask("resetprgcold");
    CHECK_EQUAL(fakes.reset_option, RESET_OPTION_COLD);
    CHECK(strcmp(ask("reload"), "reload: done\r\n") == 0);
    CHECK(fakes.starts == 1 && fakes.stops == 1 && fakes.resets == 2 && fakes.reloads == 1);
    CHECK_EQUAL(ask_part("startprg", 1), TAG_SHELL_LAST);
    CHECK_EQUAL(fakes.starts, 1);
}

static void an_error_is_said(void)
{
    setup();
    fakes.control_result = ERR_INVALID_STATE;
    ask("startprg");
    CHECK(strncmp(text, "startprg: error 0x", 18) == 0);
    CHECK_EQUAL(refused, ERR_INVALID_STATE);
}

static void it_needs_a_login(void)
{
    setup();
    client.session = 0;
    CHECK_EQUAL(ask_part("?", 0), 0);
    CHECK_EQUAL(reply_error(&reply), ERR_INVALID_SESSION_ID);
}

static void a_long_answer_comes_in_parts(void)
{
    setup();
    ask("tasklist");
    fakes.task_count = FAKE_TASKS;
    for (RTS_UI32 i = 0; i < FAKE_TASKS; i++)
        snprintf(fakes.tasks[i].name, sizeof(fakes.tasks[i].name), "Task%u", (unsigned)i);
    ask("tasklist");
    CHECK_EQUAL(parts, 1);
    char whole[sizeof(text)];
    memcpy(whole, text, sizeof(text));
    client_send_open(&client, 8, CHANNEL_MIN_MESSAGE);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK(client_login(&client));
    ask("tasklist");
    CHECK(parts > 2);
    CHECK(strcmp(text, whole) == 0);
}

static void the_load_is_that_of_all_tasks(void)
{
    setup();
    fakes.task_load = 35;
    CHECK(strcmp(ask("plcload"), "PLC load: 35%\r\n") == 0);
}

static void channels_come_with_what_went_wrong(void)
{
    char line[64];

    setup();
    CLIENT lost = client;
    lost.channel ^= 1;
    client_send_ack(&lost, 0, 0);
    CHECK(client_take(&client, NULL, reply.message) > 0); /* the complaint */
    snprintf(line, sizeof(line), "Channel %u: logged in, messages up to %u bytes", (unsigned)client.channel,
             (unsigned)client.limit);
    CHECK(strstr(ask("channelinfo"), line) != NULL);
    CHECK(strstr(text, "Channels opened: 1, refused 0, failed 0") != NULL);
    CHECK(strstr(text, "of another channel 1, repeated 0") != NULL);
}

static void lines_come_with_what_went_wrong(void)
{
    static const char wrong[] = "#<wrong#>#<1#>";

    setup();
    CHECK(strstr(ask("channelinfo"), "Line serial 1: frames 0, CRC errors 0, too long 0, too short 0, ") != NULL);
    memcpy(fakes.line_in, wrong, sizeof(wrong) - 1);
    fakes.line_in_size = sizeof(wrong) - 1;
    fakes_cycle(1);
    CHECK(strstr(ask("channelinfo"), "Line serial 1: frames 0, CRC errors 1, too long 0, too short 1, ") != NULL);
    CHECK(strstr(text, ", unfinished 0, ends without start 0\r\n") != NULL);
}

static void a_command_need_not_have_a_nul_and_is_bounded(void)
{
    static const RTS_UI8 bare[] = {TAG_SHELL_COMMAND, 7, 'a', 'p', 'p', 'l', 'i', 's', 't'};
    RTS_UI8 longer[2 + SHELL_MAX_COMMAND + 1] = {TAG_SHELL_COMMAND, SHELL_MAX_COMMAND + 1};

    setup();
    CHECK(client_request(&client, SG_PLCSHELL, SRV_SHELL_EXECUTE, bare, sizeof(bare), &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    memset(longer + 2, 'x', sizeof(longer) - 2);
    CHECK(client_request(&client, SG_PLCSHELL, SRV_SHELL_EXECUTE, longer, sizeof(longer), &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_SIZE_MISMATCH);
    CHECK(client_request(&client, SG_PLCSHELL, SRV_SHELL_EXECUTE, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    CHECK(client_request(&client, SG_PLCSHELL, SRV_SHELL_CANCEL, NULL, 0, &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_OK);
}

int main(void)
{
    RUN(help_names_every_command);
    RUN(an_unknown_command_says_where_the_list_is);
    RUN(without_application_it_says_so);
    RUN(the_state_has_its_exception);
    RUN(commands_that_change_something_need_the_right_to);
    RUN(what_the_program_forbids_is_not_done);
    RUN(commands_that_change_something_do_it_once);
    RUN(an_error_is_said);
    RUN(it_needs_a_login);
    RUN(a_long_answer_comes_in_parts);
    RUN(the_load_is_that_of_all_tasks);
    RUN(channels_come_with_what_went_wrong);
    RUN(lines_come_with_what_went_wrong);
    RUN(a_command_need_not_have_a_nul_and_is_bounded);
    return test_result();
}
