/*
 * test_comm_device.c - the whole runtime on the simulator, used over the wire: nothing is faked here.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpBytes.h"
#include "CmpLog.h"
#include "SimLink.h"
#include "SysExcept.h"
#include "app_image.h"
#include "comm_client.h"
#include "test.h"

static CLIENT client;
static REPLY reply;
static RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
static BTAG_WRITER writer;

static bool reconnect(void)
{
    SimLinkReset();
    client_init(&client, 0x0102);
    return client_open(&client) && client_login(&client);
}

static void start_blank(void)
{
    CHECK(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF) == ERR_OK);
    CHECK(SimStart() == ERR_OK);
    CHECK(reconnect());
}

/* ---- download ---- */

/* Makes the request for one block. */
static void put_block(const APP_BYTES *image, RTS_UI32 flags, RTS_UI32 offset, RTS_UI32 size)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
    BTagOpen(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0);
    BTagAppend32(&writer, flags);
    BTagAppend32(&writer, offset);
    BTagAppend32(&writer, image->size);
    BTagAppend32(&writer, image_crc(image));
    BTagClose(&writer);
    BTagOpen(&writer, TAG_CDL_DATA, BTAG_ALIGN_0);
    BTagAppend(&writer, image->bytes + offset, size);
    BTagClose(&writer);
}

static RTS_UI32 send_block(const APP_BYTES *image, RTS_UI32 offset, RTS_UI32 size)
{
    put_block(image, offset == 0 ? 0 : DLF_CONTINUEDOWNLOAD, offset, size);
    CHECK(client_call(&client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, &writer, &reply));
    return reply_number(&reply, TAG_SERVICE_RESULT);
}

static RTS_UI32 ask_next(const APP_BYTES *image)
{
    put_block(image, DLF_CONTINUEDOWNLOAD, 0, 0);
    CHECK(client_call(&client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, &writer, &reply));
    return reply_number(&reply, TAG_CDL_NEXT);
}

/* In blocks of 100 bytes, which is no multiple of what flash is programmed in. */
static RTS_UI32 send_image(const APP_BYTES *image, RTS_UI32 from)
{
    enum { BLOCK = 100 };
    RTS_UI32 result = ERR_OK;

    for (RTS_UI32 offset = from; result == ERR_OK && offset < image->size; offset += BLOCK)
        result = send_block(image, offset, image->size - offset < BLOCK ? image->size - offset : BLOCK);
    return result;
}

static RTS_UI32 control(RTS_UI16 service)
{
    BTagWriterInit(&writer, content, sizeof(content));
    BTagOpen(&writer, TAG_APP_DESCRIPTOR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_APP_SESSION, client.app_session);
    BTagWrite32(&writer, TAG_APP_OPTION, RESET_OPTION_ORIGIN);
    BTagClose(&writer);
    CHECK(client_call(&client, SG_APPLICATION, service, &writer, &reply));
    return reply_number(&reply, TAG_SERVICE_RESULT);
}

static void start_with_counter(void)
{
    APP_BYTES image;

    start_blank();
    build_counter(&image, 1);
    CHECK(send_image(&image, 0) == ERR_OK);
    CHECK(client_login_app(&client));
}

static void blank_device_takes_an_image_and_runs_it(void)
{
    start_blank();
    CHECK(!client_login_app(&client));
    start_with_counter();
    CHECK(app_state() == AS_STOP);
    CHECK(control(SRV_APP_START) == ERR_OK);
    CHECK(app_state() == AS_RUN);
    CHECK(SimAdvance(ms(100)) == ERR_OK);
    CHECK(read_u32(APP_AREA_DATA, COUNTER_OFFSET) == 11); /* the first at once */
    CHECK(control(SRV_APP_STOP) == ERR_OK);
    CHECK(app_state() == AS_STOP);
    CHECK(control(SRV_APP_RESET) == ERR_OK);
    CHECK(app_state() == AS_NONE);
}

static void broken_transfer_continues_on_a_new_channel(void)
{
    APP_BYTES image;

    start_blank();
    build_counter(&image, 1);
    CHECK(send_block(&image, 0, 200) == ERR_OK);
    CHECK(reconnect());
    CHECK(ask_next(&image) == 200);
    CHECK(send_image(&image, 200) == ERR_OK);
    CHECK(ask_next(&image) == image.size); /* it is the application now */
}

static void refused_image_names_its_reason_and_the_old_one_runs_on(void)
{
    APP_BYTES image;
    CDL_HEADER header;
    BTAG reason;

    start_with_counter();
    CHECK(control(SRV_APP_START) == ERR_OK);
    build_counter(&image, 2);
    header = image_header(&image);
    header.device_id = TARGET_ID_CORTEX_M3;
    image_set_header(&image, header);
    CHECK(send_image(&image, 0) != ERR_OK);
    CHECK(BTagFind(&reply.tags, TAG_CDL_REASON, 10, APP_REFUSAL_SIZE, &reason) == ERR_OK);
    CHECK(app_state() == AS_RUN);
    CHECK(SimAdvance(ms(50)) == ERR_OK);
    CHECK(read_u32(APP_AREA_DATA, COUNTER_OFFSET) == 6);
}

/* The power goes at every flash operation of a download: the device comes back and takes the image. */
static void power_cut_anywhere_in_a_download_needs_only_another_one(void)
{
    APP_BYTES image;
    RTS_UI32 operations;

    start_blank();
    build_counter(&image, 1);
    operations = SimFlashOps();
    CHECK(send_image(&image, 0) == ERR_OK);
    operations = SimFlashOps() - operations;
    for (RTS_UI32 operation = 1; operation <= operations; operation++) {
        RTS_RESULT result = ERR_OK;
        start_blank();
        SimFlashCut(operation, SIM_CUT_TORN);
        for (RTS_UI32 offset = 0; result == ERR_OK && offset < image.size; offset += 100) {
            RTS_UI8 message[512];
            RTS_UI32 size = image.size - offset < 100 ? image.size - offset : 100;
            put_block(&image, offset == 0 ? 0 : DLF_CONTINUEDOWNLOAD, offset, size);
            size = client_message(&client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, content, writer.size, message);
            client_send_message(&client, message, size);
            result = SimCommCycle();
            (void)client_take_message(&client, reply.message);
        }
        CHECK(result == SIM_POWER_CUT);
        CHECK(SimStart() == ERR_OK);
        CHECK(reconnect());
        CHECK(ask_next(&image) == image.size || send_image(&image, 0) == ERR_OK);
        CHECK(client_login_app(&client));
    }
}

/* ---- monitoring ---- */

static void put_application(RTS_UI32 data_id)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
    BTagOpen(&writer, TAG_MON2_APPLICATION, BTAG_ALIGN_0);
    BTagAppend32(&writer, client.app_session);
    BTagAppend32(&writer, data_id);
    BTagAppendZeros(&writer, 12);
    BTagClose(&writer);
}

static RTS_UI32 running_crc(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.image_crc;
}

/* Reads a DINT of the data area over the wire; 0xFFFFFFFF when it fails. */
static RTS_UI32 read_over_wire(RTS_UI32 data_id, RTS_UI32 offset)
{
    RTS_UI8 code[] = {MON2_OP_LD16, (RTS_UI8)offset, (RTS_UI8)(offset >> 8), MON2_OP_RAO, APP_AREA_DATA};
    BTAG values;

    put_application(data_id);
    BTagOpen(&writer, TAG_MON2_READ_LIST, BTAG_ALIGN_0);
    BTagOpen(&writer, TAG_MON2_READ_VAR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_MON2_VAR_SIZE, 4);
    BTagOpen(&writer, TAG_MON2_VAR_CODE, BTAG_ALIGN_0);
    BTagAppend(&writer, code, sizeof(code));
    BTagClose(&writer);
    BTagClose(&writer);
    BTagClose(&writer);
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_READ, &writer, &reply));
    if (BTagFind(&reply.tags, TAG_MON2_VALUES, 10, 12, &values) != ERR_OK)
        return 0xFFFFFFFF;
    return BytesGet32(values.data + 6);
}

static void variable_is_read_and_written_while_the_program_runs(void)
{
    RTS_UI8 entry[] = {0, 0, 4, 0, 0, 0, 0x00, 0x01, 0, 0, 5, 0, MON2_OP_LD16, COUNTER_OFFSET, 0, MON2_OP_RAO, 0};

    start_with_counter();
    CHECK(control(SRV_APP_START) == ERR_OK);
    CHECK(SimAdvance(ms(30)) == ERR_OK);
    CHECK(read_over_wire(running_crc(), COUNTER_OFFSET) == 4);
    put_application(running_crc());
    BTagOpen(&writer, TAG_MON2_WRITE_LIST, BTAG_ALIGN_0);
    BTagAppend(&writer, entry, sizeof(entry));
    BTagClose(&writer);
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_WRITE, &writer, &reply));
    CHECK(reply.size == 20);
    CHECK(SimAdvance(ms(20)) == ERR_OK);
    CHECK(read_over_wire(running_crc(), COUNTER_OFFSET) == 0x102);
}

static void monitoring_notices_that_another_image_was_loaded(void)
{
    APP_BYTES other;
    RTS_UI32 before;

    start_with_counter();
    before = running_crc();
    CHECK(read_over_wire(before, STEP_OFFSET) == 1);
    build_counter(&other, 2);
    CHECK(send_image(&other, 0) == ERR_OK);
    CHECK(read_over_wire(before, STEP_OFFSET) == 0xFFFFFFFF);
    CHECK(reply_number(&reply, TAG_MON2_ERROR) == ERR_APP_INVALID_DATAID);
    CHECK(read_over_wire(running_crc(), STEP_OFFSET) == 2);
}

/* ---- what happened ---- */

static void exception_is_reported_and_communication_goes_on(void)
{
    APP_SPEC spec;
    APP_BYTES image;
    BTAG_READER status;
    BTAG tag;

    spec_init(&spec);
    emit_divide_by_zero(&spec);
    emit_ret(&spec);
    add_task(&spec, "Main", KIND_CYCLIC, 10000, 0);
    build_image(&image, &spec);
    start_blank();
    CHECK(send_image(&image, 0) == ERR_OK);
    CHECK(client_login_app(&client));
    CHECK(control(SRV_APP_START) == ERR_OK);
    (void)SimAdvance(ms(20));
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_READ_STATUS, NULL, 0, &reply));
    CHECK(BTagFindContainer(&reply.tags, TAG_APP_STATUS, &status) == ERR_OK);
    CHECK(BTagFind(&status, TAG_APP_STATE, 10, 10, &tag) == ERR_OK);
    CHECK(BytesGet32(tag.data + 2) == AS_STOP && (BytesGet32(tag.data + 6) & OS_EXCEPTION) != 0);
    CHECK(BTagFind(&status, TAG_APP_LAST_EXCEPTION, 12, 12, &tag) == ERR_OK);
    CHECK(BytesGet32(tag.data) == RTSEXCPT_DIVIDEBYZERO && BytesGet32(tag.data + 4) == 2);
    CHECK(client_request(&client, SG_LOG, SRV_LOG_GET_ENTRIES, NULL, 0, &reply));
    CHECK(reply.size > 20);
}

static void tasks_are_reported(void)
{
    BTAG tag;

    start_with_counter();
    CHECK(control(SRV_APP_START) == ERR_OK);
    CHECK(SimAdvance(ms(100)) == ERR_OK);
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_READ_TASK_INFO, NULL, 0, &reply));
    CHECK(BTagFind(&reply.tags, TAG_TASK_INFO, 48, 48, &tag) == ERR_OK);
    CHECK(BytesGet32(tag.data + 8) == 10000 && BytesGet32(tag.data + 12) == 11);
    CHECK(strcmp((const char *)tag.data + 40, "Main") == 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(blank_device_takes_an_image_and_runs_it);
    RUN(broken_transfer_continues_on_a_new_channel);
    RUN(refused_image_names_its_reason_and_the_old_one_runs_on);
    RUN(power_cut_anywhere_in_a_download_needs_only_another_one);
    RUN(variable_is_read_and_written_while_the_program_runs);
    RUN(monitoring_notices_that_another_image_was_loaded);
    RUN(exception_is_reported_and_communication_goes_on);
    RUN(tasks_are_reported);
    return test_result();
}
