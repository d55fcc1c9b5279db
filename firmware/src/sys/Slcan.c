/*
 * Slcan.c - SLCAN: CAN frames as lines of text on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Slcan.h"

#include <string.h>

enum {
    END = '\r',
    ERROR = '\a', /* of an adapter; ends a line too */
    STANDARD_DIGITS = 3,
    EXTENDED_DIGITS = 8,
    COUNTER_DIGITS = 3,
    STATE_SIZE = 2 + 2 * COUNTER_DIGITS,
    FLAGS_SIZE = 3,
    FLAG_WARNING = 0x04,
    FLAG_PASSIVE = 0x20,
    FLAG_LOST = 0x09, /* its queue was full, or its controller overrun */
    READ_MAX = 2048,  /* bytes per call, so that a babbling line does not stop the rest of the runtime */
};

/* ---- text ---- */

static const struct {
    char letter;
    RTS_UI8 flags;
} kinds[] = {
    {'t', 0},
    {'T', CAN_FLAG_EXTENDED},
    {'r', CAN_FLAG_REMOTE},
    {'R', CAN_FLAG_REMOTE | CAN_FLAG_EXTENDED},
#if CAN_FD
    {'d', CAN_FLAG_FD},
    {'D', CAN_FLAG_FD | CAN_FLAG_EXTENDED},
    {'b', CAN_FLAG_FD | CAN_FLAG_FAST},
    {'B', CAN_FLAG_FD | CAN_FLAG_FAST | CAN_FLAG_EXTENDED},
#endif
};

static RTS_UI32 code_size(RTS_UI32 code)
{
    static const RTS_UI8 sizes[] = {12, 16, 20, 24, 32, 48, 64};

    return code <= CAN_CLASSIC_SIZE ? code : sizes[code - CAN_CLASSIC_SIZE - 1];
}

static RTS_UI32 size_code(RTS_UI32 size)
{
    RTS_UI32 code = 0;

    while (code < 15 && code_size(code) < size)
        code++;
    return code;
}

static char *put_hex(char *text, RTS_UI32 value, RTS_UI32 digits)
{
    while (digits-- > 0)
        *text++ = "0123456789ABCDEF"[value >> 4 * digits & 0x0F];
    return text;
}

/* 16 for what is no digit. */
static RTS_UI32 digit_of(char character)
{
    if (character >= '0' && character <= '9')
        return (RTS_UI32)(character - '0');
    if (character >= 'A' && character <= 'F')
        return (RTS_UI32)(character - 'A' + 10);
    return character >= 'a' && character <= 'f' ? (RTS_UI32)(character - 'a' + 10) : 16;
}

static bool get_hex(const char *text, RTS_UI32 digits, RTS_UI32 *value)
{
    *value = 0;
    for (RTS_UI32 i = 0; i < digits; i++) {
        RTS_UI32 digit = digit_of(text[i]);
        if (digit > 15)
            return false;
        *value = *value << 4 | digit;
    }
    return true;
}

static RTS_UI32 id_digits(RTS_UI32 flags)
{
    return (flags & CAN_FLAG_EXTENDED) != 0 ? EXTENDED_DIGITS : STANDARD_DIGITS;
}

RTS_UI32 SlcanEncode(const CAN_FRAME *frame, char *text)
{
    char *end = text;

    for (RTS_UI32 i = 0; i < RTS_COUNT(kinds); i++)
        if (kinds[i].flags == frame->flags)
            *end = kinds[i].letter;
    end = put_hex(end + 1, frame->id, id_digits(frame->flags));
    end = put_hex(end, size_code(frame->size), 1);
    for (RTS_UI32 i = 0; i < frame->size && (frame->flags & CAN_FLAG_REMOTE) == 0; i++)
        end = put_hex(end, frame->data[i], 2);
    *end++ = END;
    return (RTS_UI32)(end - text);
}

static bool get_kind(char letter, CAN_FRAME *frame)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(kinds); i++) {
        if (kinds[i].letter == letter) {
            frame->flags = kinds[i].flags;
            return true;
        }
    }
    return false;
}

bool SlcanDecode(const char *text, RTS_UI32 size, CAN_FRAME *frame)
{
    RTS_UI32 code;

    if (size == 0 || !get_kind(text[0], frame))
        return false;
    RTS_UI32 head = 1 + id_digits(frame->flags) + 1;
    if (size < head || !get_hex(text + 1, head - 2, &frame->id) || !get_hex(text + head - 1, 1, &code))
        return false;
    if (code > CAN_CLASSIC_SIZE && (frame->flags & CAN_FLAG_FD) == 0)
        return false;
    frame->size = (RTS_UI8)code_size(code);
    frame->time_us = 0;
    RTS_UI32 data = (frame->flags & CAN_FLAG_REMOTE) != 0 ? 0 : frame->size;
    if (size != head + 2 * data && size != head + 2 * data + SLCAN_STAMP_SIZE)
        return false;
    for (RTS_UI32 i = 0; i < data; i++) {
        RTS_UI32 byte;
        if (!get_hex(text + head + 2 * i, 2, &byte))
            return false;
        frame->data[i] = (RTS_UI8)byte;
    }
    return CanIsFrame(frame);
}

/* ---- a controller ---- */

static const struct {
    RTS_UI32 bit_rate;
    char code;
} bit_rates[] = {{10000, '0'},  {20000, '1'},  {50000, '2'},  {100000, '3'},  {125000, '4'},
                 {250000, '5'}, {500000, '6'}, {750000, '7'}, {1000000, '8'}, {83300, '9'}};

static char code_of(RTS_UI32 bit_rate)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(bit_rates); i++)
        if (bit_rates[i].bit_rate == bit_rate)
            return bit_rates[i].code;
    return 0;
}

/* True when the line has taken all. */
static bool flush(SLCAN *slcan)
{
    RTS_UI32 left = slcan->out_size - slcan->out_sent;

    if (left == 0)
        return true;
    slcan->out_sent += slcan->line.write((const RTS_UI8 *)slcan->out + slcan->out_sent, left);
    return slcan->out_sent == slcan->out_size;
}

static void put_command(SLCAN *slcan, char letter, char code)
{
    slcan->out[slcan->out_size++] = letter;
    if (code != 0)
        slcan->out[slcan->out_size++] = code;
    slcan->out[slcan->out_size++] = END;
}

/* Whatever the line has not taken yet is forgotten. The adapter may have the beginning of it, or of what a process sent
 * that was killed: that line ends first, or the first command would be a part of it. */
static void open_adapter(SLCAN *slcan)
{
    slcan->out[0] = END;
    slcan->out_size = 1;
    slcan->out_sent = 0;
    slcan->bus = CAN_BUS_ACTIVE;
    slcan->tx_errors = slcan->rx_errors = 0;
    put_command(slcan, 'C', 0);
    put_command(slcan, 'S', code_of(slcan->bit_rate));
    if (slcan->data_bit_rate != 0)
        put_command(slcan, 'Y', (char)('0' + slcan->data_bit_rate / 1000000));
    put_command(slcan, 'O', 0);
    (void)flush(slcan);
}

bool SlcanKnows(RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    return code_of(bit_rate) != 0 &&
           (data_bit_rate == 0 || (CAN_FD && (data_bit_rate == 2000000 || data_bit_rate == 5000000)));
}

RTS_RESULT SlcanOpen(SLCAN *slcan, SLCAN_LINE line, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    if (!SlcanKnows(bit_rate, data_bit_rate))
        return ERR_NOT_SUPPORTED;
    memset(slcan, 0, sizeof(*slcan));
    slcan->line = line;
    slcan->bit_rate = bit_rate;
    slcan->data_bit_rate = data_bit_rate;
    open_adapter(slcan);
    return ERR_OK;
}

RTS_RESULT SlcanSetFilters(SLCAN *slcan, const CAN_FILTER *filters, RTS_UI32 count)
{
    if (count > SLCAN_FILTERS)
        return ERR_NOMEMORY;
    for (RTS_UI32 i = 0; i < count; i++)
        slcan->filter[i] = filters[i];
    slcan->filters = count;
    return ERR_OK;
}

RTS_RESULT SlcanSend(SLCAN *slcan, const CAN_FRAME *frame)
{
    if (!CanIsFrame(frame))
        return ERR_PARAMETER;
    if (slcan->bus == CAN_BUS_OFF)
        return ERR_DEVICE;
    if (!flush(slcan))
        return ERR_NOBUFFER;
    slcan->out_sent = 0;
    slcan->out_size = SlcanEncode(frame, slcan->out);
    (void)flush(slcan);
    return ERR_OK;
}

/* ---- what the adapter says ---- */

static bool get_counter(const char *text, RTS_UI16 *counter)
{
    RTS_UI32 value = 0;

    for (RTS_UI32 i = 0; i < COUNTER_DIGITS; i++) {
        RTS_UI32 digit = digit_of(text[i]);
        if (digit > 9)
            return false;
        value = 10 * value + digit;
    }
    *counter = (RTS_UI16)value;
    return true;
}

static bool take_state(SLCAN *slcan)
{
    static const char letters[] = "awpb"; /* from CAN_BUS_ACTIVE on */
    const char *letter = memchr(letters, slcan->in[1], sizeof(letters) - 1);
    RTS_UI16 rx, tx;

    if (letter == NULL || !get_counter(slcan->in + 2, &rx) || !get_counter(slcan->in + 2 + COUNTER_DIGITS, &tx))
        return false;
    slcan->bus = (RTS_UI8)(CAN_BUS_ACTIVE + (letter - letters));
    slcan->rx_errors = rx;
    slcan->tx_errors = tx;
    return true;
}

/* They do not say bus off, and so do not end it. */
static bool take_flags(SLCAN *slcan)
{
    RTS_UI32 flags;

    if (!get_hex(slcan->in + 1, 2, &flags))
        return false;
    slcan->lost += (flags & FLAG_LOST) != 0;
    if (slcan->bus != CAN_BUS_OFF)
        slcan->bus = (flags & FLAG_PASSIVE) != 0   ? CAN_BUS_PASSIVE
                     : (flags & FLAG_WARNING) != 0 ? CAN_BUS_WARNING
                                                   : CAN_BUS_ACTIVE;
    return true;
}

static bool take_answer(SLCAN *slcan)
{
    if (slcan->fill == STATE_SIZE && slcan->in[0] == 's')
        return take_state(slcan);
    return slcan->fill == FLAGS_SIZE && slcan->in[0] == 'F' && take_flags(slcan);
}

void SlcanAsk(SLCAN *slcan, RTS_UI32 now_ms)
{
    if (now_ms - slcan->asked_ms < SLCAN_ASK_MS || !flush(slcan))
        return;
    slcan->asked_ms = now_ms;
    slcan->out_size = slcan->out_sent = 0;
    put_command(slcan, 'F', 0);
    (void)flush(slcan);
}

void SlcanGetState(const SLCAN *slcan, CAN_STATE *state)
{
    *state = (CAN_STATE){.bus = (CAN_BUS_STATE)slcan->bus,
                         .bit_rate = slcan->bit_rate,
                         .data_bit_rate = slcan->data_bit_rate,
                         .tx_errors = slcan->tx_errors,
                         .rx_errors = slcan->rx_errors,
                         .lost = slcan->lost};
}

void SlcanRestart(SLCAN *slcan)
{
    if (slcan->bus == CAN_BUS_OFF)
        open_adapter(slcan);
}

/* ---- receiving ---- */

/* True when the byte ends the line of a frame that passes. */
static bool take_byte(SLCAN *slcan, char byte, CAN_FRAME *frame)
{
    if (byte != END && byte != ERROR && byte != '\n') {
        slcan->too_long |= slcan->fill == sizeof(slcan->in);
        if (!slcan->too_long)
            slcan->in[slcan->fill++] = byte;
        return false;
    }
    bool whole = byte == END && !slcan->too_long && SlcanDecode(slcan->in, slcan->fill, frame);
    if (!whole && byte == END && !slcan->too_long)
        (void)take_answer(slcan);
    slcan->lost += slcan->too_long || (!whole && slcan->fill > EXTENDED_DIGITS);
    slcan->fill = 0;
    slcan->too_long = false;
    return whole && CanPasses(slcan->filter, slcan->filters, frame);
}

static bool next_byte(SLCAN *slcan, char *byte)
{
    if (slcan->chunk_read == slcan->chunk_size) {
        slcan->chunk_read = 0;
        slcan->chunk_size = slcan->line.read(slcan->chunk, sizeof(slcan->chunk));
    }
    if (slcan->chunk_size == 0)
        return false;
    *byte = (char)slcan->chunk[slcan->chunk_read++];
    return true;
}

RTS_RESULT SlcanReceive(SLCAN *slcan, CAN_FRAME *frame)
{
    char byte;

    (void)flush(slcan);
    for (RTS_UI32 i = 0; i < READ_MAX && next_byte(slcan, &byte); i++)
        if (take_byte(slcan, byte, frame))
            return ERR_OK;
    return ERR_NOTHING_TO_DO;
}
