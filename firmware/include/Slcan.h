/*
 * Slcan.h - SLCAN: CAN frames as lines of text on a serial line, as adapters of many makers have it (LAWICEL).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For a CAN adapter, and for a line between two machines that stands for a bus. No hardware in here: the line is two
 * functions. All from main.
 *
 *   tIIIL<data>\r TIIIIIIIIL<data>\r    frame with 11 or 29 bits, L bytes; r and R: remote
 *   dIIIL<data>\r DIIIIIIIIL<data>\r    FD, L is the length code 0..F; b and B: with the second bit rate
 *   \r C\r S6\r Y2\r O\r                to an adapter: end of what was cut, close, bit rate, second bit rate, open
 *   F\r -> Fxx\r                       its status flags: 0x04 warning, 0x20 passive, 0x01 and 0x08 frames were lost
 *   sbRRRTTT\r                         the state has changed: a(ctive), w(arning), p(assive), b(us off), and the
 *                                      counters of errors in receiving and sending, decimal
 *
 * Adapters know F (LAWICEL), or send state lines (as Linux takes them), or neither. What is neither a frame nor one of
 * these (another answer of the adapter, noise) is passed over; four digits of a time stamp may follow a frame.
 */
#ifndef SLCAN_H
#define SLCAN_H

#include "SysCan.h"

enum {
    SLCAN_STAMP_SIZE = 4,
    SLCAN_TEXT_SIZE = 1 + 8 + 1 + 2 * CAN_DATA_SIZE + SLCAN_STAMP_SIZE + 1, /* the longest line */
    SLCAN_COMMANDS_SIZE = 16,
    SLCAN_CHUNK = 32,
    SLCAN_FILTERS = CAN_FILTERS,
    SLCAN_ASK_MS = 1000, /* the status flags are asked for so often: adapters want 500 ms at least */
};

/* Writes the line of a frame with its end, SLCAN_TEXT_SIZE at most; returns its length. */
RTS_UI32 SlcanEncode(const CAN_FRAME *frame, char *text);

/* Reads a line without its end. False if it is no frame; time_us is set to 0. */
bool SlcanDecode(const char *text, RTS_UI32 size, CAN_FRAME *frame);

/* The serial line; both return how many bytes were moved, as SysComRead and SysComWrite do. */
typedef struct {
    RTS_UI32 (*read)(RTS_UI8 *data, RTS_UI32 size);
    RTS_UI32 (*write)(const RTS_UI8 *data, RTS_UI32 size);
} SLCAN_LINE;

/* A controller on such a line. The fields are those of Slcan.c. */
typedef struct {
    SLCAN_LINE line;
    RTS_UI32 bit_rate;
    RTS_UI32 data_bit_rate;
    RTS_UI32 lost; /* lines that were damaged, and times the adapter had no room */
    CAN_FILTER filter[SLCAN_FILTERS];
    RTS_UI32 filters;
    RTS_UI32 fill;
    bool too_long;
    RTS_UI8 bus; /* CAN_BUS_STATE, as far as the adapter says it */
    RTS_UI16 tx_errors;
    RTS_UI16 rx_errors;
    RTS_UI32 asked_ms;
    RTS_UI8 chunk[SLCAN_CHUNK];
    RTS_UI32 chunk_size;
    RTS_UI32 chunk_read;
    RTS_UI32 out_size;
    RTS_UI32 out_sent;
    char in[SLCAN_TEXT_SIZE];
    char out[SLCAN_TEXT_SIZE + SLCAN_COMMANDS_SIZE];
} SLCAN;

/* Whether adapters have these bit rates; the second one 0: no CAN FD. */
bool SlcanKnows(RTS_UI32 bit_rate, RTS_UI32 data_bit_rate);

/* Sends the commands that open an adapter; what is none ignores them. ERR_NOT_SUPPORTED: it does not know a bit rate. */
RTS_RESULT SlcanOpen(SLCAN *slcan, SLCAN_LINE line, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate);

/* As the functions of SysCan.h; a frame that the line has not taken yet goes on with each call of these. */
RTS_RESULT SlcanSetFilters(SLCAN *slcan, const CAN_FILTER *filters, RTS_UI32 count);
RTS_RESULT SlcanSend(SLCAN *slcan, const CAN_FRAME *frame);
RTS_RESULT SlcanReceive(SLCAN *slcan, CAN_FRAME *frame);
void SlcanGetState(const SLCAN *slcan, CAN_STATE *state);

/* Ends bus off, by opening the adapter again. */
void SlcanRestart(SLCAN *slcan);

/* Asks the adapter for its state, SLCAN_ASK_MS after the last time. For each cycle; not where the line has no adapter at
 * its other end. */
void SlcanAsk(SLCAN *slcan, RTS_UI32 now_ms);

#endif
