/*
 * ModbusLink.h - a serial line or a connection on which Modbus frames come and go: one buffer, one direction at a time.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A frame is received into the buffer of its link, the reply is made there, and sent from there: nothing more is
 * received before it has left, so a flood of requests waits at its sender, or is lost on the line.
 */
#ifndef MODBUSLINK_H
#define MODBUSLINK_H

#include "CmpErrors.h"
#include "Modbus.h"
#include "SysSocket.h"
#include "rts_config.h"

/* Places in the buffer: the header of TCP, of which RTU has only the unit, the PDU, and the CRC of RTU. */
enum {
    MODBUS_AT_TRANSACTION = 0,
    MODBUS_AT_PROTOCOL = 2,
    MODBUS_AT_LENGTH = 4,
    MODBUS_AT_UNIT = 6,
    MODBUS_AT_PDU = 7,
    MODBUS_CRC_SIZE = 2,
    MODBUS_FRAME_SIZE = MODBUS_AT_PDU + MODBUS_MAX_PDU + MODBUS_CRC_SIZE + 1, /* one more: it is too long */
};

typedef struct MODBUS_LINK MODBUS_LINK;

/* What is looked for in what comes on a serial line, where only its contents say for certain where a frame ends: nothing,
 * the reply of `unit` to `function`, or requests to `unit`. */
typedef enum { MODBUS_LOOKS_FOR_NOTHING, MODBUS_LOOKS_FOR_REPLY, MODBUS_LOOKS_FOR_REQUESTS } MODBUS_LOOKS_FOR;

/* The functions of a serial line (ModbusRtu.h), and of the connection of a client or a server (ModbusTcp.h). None of
 * them blocks; `now_ns`: SysTimeGetNs, or the clock of a test. */
typedef struct {
    /* Whether a request may be sent now: the line is quiet, the connection is there. Opens what is not open. */
    bool (*ready)(MODBUS_LINK *link, RTS_I64 now_ns);
    /* Goes on with what is on its way. Size of the PDU of a frame that has come, 0: none. It stays in the buffer until
     * something is sent, or dropped. */
    RTS_UI32 (*receive)(MODBUS_LINK *link, RTS_I64 now_ns);
    /* Begins to send a PDU of this size that is in the buffer, to or from the unit there. */
    void (*send)(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns);
    /* What was sent is of no use any more: nothing more of it leaves. A client on TCP closes, to connect again. */
    void (*give_up)(MODBUS_LINK *link);
    /* Closes a line, or the connection of a client. */
    void (*close)(MODBUS_LINK *link);
    bool broadcasts; /* MODBUS_BROADCAST is all devices, which do not reply; else it is one like others */
} MODBUS_LINK_TYPE;

struct MODBUS_LINK {
    const MODBUS_LINK_TYPE *type;
    RTS_HANDLE handle; /* line of SysCom, or socket; RTS_INVALID_HANDLE: not open */
    bool sending;
    bool connecting;
    RTS_UI16 fill;       /* bytes received, or to be sent */
    RTS_UI16 sent;       /* of them */
    RTS_I64 began_ns;    /* TCP: when the connection began, or was tried */
    RTS_I64 failed_ns;   /* TCP: when a connection without any reply ended last */
    RTS_UI16 breaks;     /* TCP: how often the device may have restarted, as its connections show */
    RTS_UI8 closings;    /* TCP: connections in a row that the device closed after a reply, soon */
    bool accepted;       /* TCP: the peer took this connection, which may have ended */
    bool replied;        /* TCP: a frame has come on this connection */
    RTS_I64 moved_ns;    /* RTU: when the last byte that is sent leaves; TCP: when a byte moved last, or it began */
    RTS_UI32 silence_ns; /* RTU: the shortest pause between frames */
    RTS_UI32 gap_ns;     /* RTU: the longest pause within one, as bytes are handed over; no less than silence_ns */
    RTS_UI32 char_ns;    /* RTU: how long a character takes */
    SOCKADDRESS peer;    /* TCP: the server that a client connects to */
#if SYSSOCK_NAMES
    const char *host;  /* TCP: its name in place of its address; NULL: none */
    RTS_RESULT lookup; /* of the name, in the last attempt: ERR_OK, or what SysSockGetConnected says */
#endif
    RTS_UI8 looks_for;   /* RTU: MODBUS_LOOKS_FOR_* */
    RTS_UI8 unit;        /* RTU: the server's own; of a client, to which a request was sent last, */
    RTS_UI8 function;    /* and its function */
    RTS_UI32 bad_frames; /* of a wrong CRC or length */
    RTS_UI8 frame[MODBUS_FRAME_SIZE];
};

/* Without TCP all links are serial lines, whose functions need not be looked up. */
extern const MODBUS_LINK_TYPE ModbusRtuType;

static inline const MODBUS_LINK_TYPE *ModbusLinkType(const MODBUS_LINK *link)
{
    return MODBUS_MAX_CONNECTIONS > 0 ? link->type : &ModbusRtuType;
}

/* Whether the frame that has come on a serial line is of the device and function that were asked last. */
static inline bool ModbusLinkIsReply(const MODBUS_LINK *link)
{
    return link->frame[MODBUS_AT_UNIT] == link->unit &&
           (link->frame[MODBUS_AT_PDU] & ~MODBUS_EXCEPTION) == link->function;
}

/* What was received is not needed, the next frame may come. */
static inline void ModbusLinkDrop(MODBUS_LINK *link)
{
    link->fill = 0;
}

#endif
