/*
 * test_canopen_mixed.c - SDO transfers of all kinds, in any order, to one device on a bus that loses, doubles and delays
 * frames: 100 000 of them from one seed. With "campaign" as argument it takes one seed after the other until it is stopped.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The test knows which values the device may have: after a write that has succeeded the new one, after one that has failed
 * the old or the new one. A read without a fault in between says which.
 */
#include "CanopenSdoServer.h"
#include "canopen_transfers.h"
#include "test.h"

enum { MANY = 100000, WORD_SIZE = 4, NO_SUCH_OBJECT = 0x3333 };
enum { READ, WRITE, READ_BY_TESTS, WRITE_BY_TESTS, TOO_LONG, MISSING, CANCEL, WRONG_TOGGLE, KINDS };

typedef struct {
    RTS_UI16 index;
    RTS_UI32 size;
    RTS_UI8 data[LONGEST];
} VALUE;

static VALUE word = {.index = WORD, .size = WORD_SIZE};
static VALUE text = {.index = TEXT};
static VALUE candidate;
static RTS_UI32 random_state;
static RTS_UI32 failed, succeeded;
static bool in_segments; /* the device refuses blocks */

static RTS_UI32 random_below(RTS_UI32 end)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state % end;
}

static RTS_UI32 random_size(void)
{
    static const RTS_UI32 ends[] = {8, 50, 300, LONGEST};

    return 1 + random_below(ends[random_below(RTS_COUNT(ends))]);
}

static bool has_received(const VALUE *value)
{
    return received_size == value->size && memcmp(received, value->data, value->size) == 0;
}

/* A text has no NUL, where it would end. */
static void make_candidate(const VALUE *value)
{
    candidate.index = value->index;
    candidate.size = value->index == WORD ? (RTS_UI32)WORD_SIZE : random_size();
    for (RTS_UI32 i = 0; i < candidate.size; i++)
        candidate.data[i] = (RTS_UI8)(1 + random_below(255));
}

static void adopt_candidate(VALUE *value)
{
    value->size = candidate.size;
    memcpy(value->data, candidate.data, candidate.size);
}

/* ---- faults ---- */

static void choose_fault(void)
{
    RTS_UI32 number = random_below(2 * 40);

    frames = 0;
    lost_frame = doubled_frame = delayed_frame = NO_FAULT;
    switch (random_below(8)) {
    case 0:
        lost_frame = number;
        break;
    case 1:
        doubled_frame = number;
        break;
    case 2:
        delayed_frame = number;
        delay_ms = 1 + random_below(1900);
        break;
    default:
        break;
    }
}

/* What is late has come, and the device has given up what was left. */
static void calm_down(void)
{
    RTS_I64 end_ns = SimCanNow() + (RTS_I64)(held.is_held ? 2 : 1) * TIMEOUT_MS * 1000000;
    CAN_FRAME frame;

    lost_frame = doubled_frame = delayed_frame = NO_FAULT;
    while (receive_until(&frame, end_ns))
        ;
    if (slave.server.state != SERVER_IDLE) { /* an abort was lost */
        while (receive_until(&frame, SimCanNow() + (RTS_I64)SDO_SERVER_MS * 1000000))
            ;
        become_quiet();
    }
    CHECK_EQUAL(slave.server.state, SERVER_IDLE);
    CHECK(!slave.server.has_reply && !client.has_request && client.state != SDO_BUSY);
}

/* ---- transfers ---- */

static bool writes(const VALUE *value, bool by_tests)
{
    if (by_tests && value->index == TEXT)
        return write_blocks(value->data, value->size);
    return (in_segments ? write_segments : write_object)(value->index, value->data, value->size);
}

static bool reads(const VALUE *value, bool by_tests)
{
    if (by_tests && value->index == TEXT)
        return read_blocks();
    return (in_segments ? read_segments : read_object)(value->index);
}

static bool check_write(VALUE *value, bool by_tests)
{
    make_candidate(value);
    if (writes(&candidate, by_tests)) {
        adopt_candidate(value);
        return true;
    }
    calm_down();
    CHECK(read_object(value->index));
    if (has_received(&candidate))
        adopt_candidate(value);
    return has_received(value);
}

static bool check_read(const VALUE *value, bool by_tests)
{
    bool is_read = reads(value, by_tests);

    return !is_read || has_received(value);
}

static bool check_refused(RTS_UI16 index, RTS_UI32 size, RTS_UI32 code)
{
    static RTS_UI8 longer[LONGEST + 1];

    memset(longer, 'x', sizeof longer);
    bool is_done = size != 0 ? write_object(index, longer, size) : read_object(index);
    return !is_done && (client.state == SDO_SILENT || client.abort == code || lost_frame != NO_FAULT ||
                        doubled_frame != NO_FAULT || delayed_frame != NO_FAULT);
}

/* A transfer that is given up somewhere: a write leaves the old value, or has ended. */
static bool check_cancel(VALUE *value)
{
    bool is_write = random_below(2) != 0;
    RTS_UI32 steps = random_below(30);
    CAN_FRAME frame;

    make_candidate(value);
    if (is_write)
        SdoClientWrite(&client, NODE, value->index, 0, candidate.data, candidate.size, now_ms());
    else
        SdoClientRead(&client, NODE, value->index, 0, now_ms());
    for (; steps > 0 && client.state == SDO_BUSY; steps--) {
        (void)SdoClientSend(&client, send_of_client, NULL, now_ms());
        if (receive_until(&frame, SimCanNow() + 1000000))
            SdoClientTake(&client, &frame, now_ms());
    }
    (void)SdoClientCancel(&client);
    (void)end_transfer();
    calm_down();
    CHECK(read_object(value->index));
    if (is_write && has_received(&candidate))
        adopt_candidate(value);
    return has_received(value);
}

/* A segment with the wrong toggle ends the transfer, and nothing is written. */
static bool check_wrong_toggle(void)
{
    static const RTS_UI8 begin_write[8] = {0x21, TEXT & 0xFF, TEXT >> 8, 0, 20},
                         begin_read[8] = {0x40, TEXT & 0xFF, TEXT >> 8};
    static const RTS_UI8 segment[8] = {SDO_TOGGLE, 1, 2, 3, 4, 5, 6, 7}, ask[8] = {SDO_READ_SEGMENT | SDO_TOGGLE};
    bool is_write = random_below(2) != 0 || text.size <= WORD_SIZE;
    CAN_FRAME frame;

    lost_frame = doubled_frame = delayed_frame = NO_FAULT;
    say(is_write ? begin_write : begin_read);
    bool is_begun = receive(&frame) && frame.data[0] == (is_write ? SDO_WRITE_DONE : 0x41);
    say(is_write ? segment : ask);
    bool is_refused = receive(&frame) && frame.data[0] == SDO_ABORT && BytesGet32(frame.data + 4) == SDO_ABORT_TOGGLE;
    return is_begun && is_refused && read_object(TEXT) && has_received(&text);
}

static bool is_well(RTS_UI32 kind)
{
    VALUE *value = random_below(3) == 0 ? &word : &text;

    switch (kind) {
    case READ:
    case READ_BY_TESTS:
        return check_read(value, kind == READ_BY_TESTS);
    case WRITE:
    case WRITE_BY_TESTS:
        return check_write(value, kind == WRITE_BY_TESTS);
    case TOO_LONG:
        return check_refused(TEXT, LONGEST + 1, SDO_ABORT_TOO_LONG);
    case MISSING:
        return check_refused(NO_SUCH_OBJECT, random_below(2) * 300, SDO_ABORT_NO_OBJECT);
    case CANCEL:
        return check_cancel(value);
    default:
        return check_wrong_toggle();
    }
}

static bool transfer(RTS_UI32 seed, RTS_UI32 number)
{
    RTS_UI32 kind = random_below(KINDS);

    in_segments = random_below(8) == 0;
    choose_fault();
    bool is_done = is_well(kind);
    bool had_fault = frames > lost_frame || frames > doubled_frame || frames > delayed_frame;
    if (had_fault || client.state == SDO_SILENT || held.is_held)
        calm_down();
    failed += client.state != SDO_DONE;
    succeeded += client.state == SDO_DONE;
    if (!is_done)
        fprintf(stderr, "seed %u, transfer %u of kind %u\n", (unsigned)seed, (unsigned)number, (unsigned)kind);
    return is_done;
}

static void mix(RTS_UI32 seed, RTS_UI32 count)
{
    begin();
    random_state = seed;
    failed = succeeded = 0;
    memset(word.data, 0, WORD_SIZE);
    text.size = 1;
    text.data[0] = 'a';
    CHECK(write_object(WORD, word.data, WORD_SIZE) && write_object(TEXT, text.data, text.size));
    RTS_UI32 done = 0;
    while (done < count && transfer(seed, done))
        done++;
    CHECK_EQUAL(done, count);
    calm_down();
    CHECK(read_object(WORD) && has_received(&word));
    CHECK(read_object(TEXT) && has_received(&text));
    CHECK(failed > count / 10 && succeeded > count / 3);
    CHECK(slave.counters.transfers >= succeeded);
}

static void transfers_of_all_kinds_with_faults_leave_each_value_right(void)
{
    mix(1, MANY);
}

int main(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "campaign") == 0) {
        for (RTS_UI32 seed = 1; test_failures == 0; seed++) {
            mix(seed, MANY);
            printf("seed %u: %u transfers, %u failed\n", (unsigned)seed, MANY, (unsigned)failed);
            fflush(stdout);
        }
        return test_result();
    }
    RUN(transfers_of_all_kinds_with_faults_leave_each_value_right);
    return test_result();
}
