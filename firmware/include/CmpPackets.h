/*
 * CmpPackets.h - layouts of the communication protocol (shared with the host); numbers are in CmpSrvNumbers.h, what
 * happens with them in docs/protocol.md.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Names as in codesys-v3-protocol, sections in brackets. All integers are little-endian and are where the packet has
 * them, aligned or not: so they are arrays of bytes, read and written by CmpBytes.h, and a layout has no padding. A
 * pointer to any byte may be cast to a pointer to a layout, once the length is checked against its size.
 */
#ifndef CMPPACKETS_H
#define CMPPACKETS_H

#include "CmpStd.h"

typedef RTS_UI8 WIRE_UI16[2];
typedef RTS_UI8 WIRE_UI32[4];
typedef RTS_UI8 WIRE_UI64[8];

/* ---- layer 2: TCP [1.2] ---- */

/* Then the packet. */
typedef struct {
    WIRE_UI32 magic; /* TCP_MAGIC */
    WIRE_UI32 size;  /* bytes, this header included */
} TCP_HEADER;

/* The network address of an end of a connection: big-endian, as all addresses. */
typedef struct {
    RTS_UI8 port[2];
    RTS_UI8 ip[4];
} TCP_ADDRESS;

/* ---- layer 2: CAN (own) ---- */

/* A name request that fits into a frame. */
typedef struct {
    RTS_UI8 type;   /* CAN_FRAME_SCAN */
    RTS_UI8 window; /* replies come after a random time of up to so many CAN_SCAN_UNIT_MS */
    WIRE_UI16 version;
    WIRE_UI32 request_id; /* both as in NS_REQUEST */
} CAN_SCAN;

/* A tool takes an address (the source in the identifier), or has it already. */
typedef struct {
    RTS_UI8 type; /* CAN_FRAME_CLAIM, CAN_FRAME_TAKEN */
    RTS_UI8 unused[3];
    WIRE_UI32 number; /* random; of the tool that sends the frame */
} CAN_CLAIM;

/* ---- layer 2: within Modbus (own) ---- */

/* Then bytes to the device, none with sequence MODBUS_TUNNEL_BEGIN. */
typedef struct {
    RTS_UI8 function; /* MODBUS_ENCAPSULATED */
    RTS_UI8 mei;      /* MODBUS_TUNNEL_MEI */
    RTS_UI8 sequence; /* MODBUS_TUNNEL_BEGIN, then 1 to 255 and again from 1 on; the last one: the reply was lost */
} MODBUS_TUNNEL_REQUEST;

/* Then bytes from the device. */
typedef struct {
    RTS_UI8 function;
    RTS_UI8 mei;
    RTS_UI8 sequence; /* of the request */
    RTS_UI8 taken;    /* so many of its bytes: the others have to be sent again */
    RTS_UI8 size;     /* of what follows: where the frame ends, for who cannot measure silence */
} MODBUS_TUNNEL_REPLY;

/* ---- layer 3: router [2.1] ---- */

/* Then the receiver's address, the sender's, and zeros up to a multiple of 4. */
typedef struct {
    RTS_UI8 magic;   /* ROUTER_MAGIC */
    RTS_UI8 hops;    /* hop count << 3 | words of this header: a sender may have more than these three */
    RTS_UI8 flags;   /* priority << 6, ROUTER_FLAG_*, longest packet / 32 - 1, or 0 when nothing is said of that */
    RTS_UI8 service; /* ROUTER_SVC_* */
    RTS_UI8 message;
    RTS_UI8 lengths; /* of the addresses, words: sender << 4 | receiver; no receiver: all nodes */
} ROUTER_HEADER;

/* ---- name service [2.6] ---- */

/* Then, for NS_RESOLVE_NAME, the name in UTF-16. */
typedef struct {
    WIRE_UI16 type;    /* NS_RESOLVE_* */
    WIRE_UI16 version; /* newest that is understood */
    WIRE_UI32 request_id;
} NS_REQUEST;

/* Versions 1.02 and 1.03. Then the parent's address, node, device and vendor name, each in UTF-16 with NUL. */
typedef struct {
    WIRE_UI16 type; /* NS_IDENTIFICATION */
    WIRE_UI16 version;
    WIRE_UI32 request_id;
    WIRE_UI16 max_channels;
    RTS_UI8 little_endian;
    RTS_UI8 address_difference;
    WIRE_UI16 parent_words;
    WIRE_UI16 node_length; /* of the names, characters without NUL */
    WIRE_UI16 device_length;
    WIRE_UI16 vendor_length;
    WIRE_UI32 target_type;
    WIRE_UI32 target_id; /* vendor << 16 | device */
    WIRE_UI32 target_version;
} NS_REPLY_0103;

/* Then as 1.03, and after that the serial number with NUL. */
typedef struct {
    NS_REPLY_0103 old;
    WIRE_UI32 flags;
    RTS_UI8 serial_length;
    RTS_UI8 oem_length;
    RTS_UI8 driver_type; /* BLK_DRV_TYPE_* */
    RTS_UI8 left_out;    /* own: 1 if a component failed to start, so that no program runs (CM_LEAVES_OUT) */
    RTS_UI8 reserved[8];
} NS_REPLY_0400;

/* Then the parent's address, node and device name. */
typedef struct {
    WIRE_UI16 type;
    WIRE_UI16 version;
    WIRE_UI32 request_id;
    WIRE_UI32 target_type;
    WIRE_UI16 max_channels;
    RTS_UI8 little_endian;
    RTS_UI8 reserved;
    WIRE_UI16 parent_words;
    WIRE_UI16 node_length;
    WIRE_UI16 device_length;
} NS_REPLY_0101;

/* ---- layer 4: channel [3] ---- */

/* How every meta package starts. */
typedef struct {
    RTS_UI8 type; /* CHANNEL_PKG_*, with CHANNEL_META */
    RTS_UI8 flags;
    WIRE_UI16 version; /* CHANNEL_VERSION */
    WIRE_UI32 crc;     /* CRC-32 of the whole package with zeros here */
} CHANNEL_META_HEADER;

/* Clients of version 1.0 leave out what follows `limit`. */
typedef struct {
    CHANNEL_META_HEADER meta;
    WIRE_UI32 request_id;
    WIRE_UI32 limit;       /* longest message, bytes */
    RTS_UI8 address_words; /* of both addresses together */
    RTS_UI8 unused;
    WIRE_UI16 packet; /* own: longest packet the client would send, bytes; 0: BLK_MAX_SIZE */
} CHANNEL_OPEN_REQUEST;

typedef struct {
    CHANNEL_META_HEADER meta;
    WIRE_UI32 request_id;
    WIRE_UI16 result; /* CHANNEL_OPEN_* */
    WIRE_UI16 id;     /* CHANNEL_ID_NONE when refused */
    WIRE_UI32 limit;
    RTS_UI8 byte_order; /* 1: the device is big-endian */
    RTS_UI8 address_words;
    WIRE_UI16 packet; /* own: longest packet the device takes of it; 0: BLK_MAX_SIZE */
} CHANNEL_OPEN_RESPONSE;

/* From both sides. */
typedef struct {
    CHANNEL_META_HEADER meta;
    WIRE_UI16 id;
    WIRE_UI16 error; /* ERR_CHS_*, 0 for an orderly end */
} CHANNEL_CLOSE;

typedef struct {
    CHANNEL_META_HEADER meta;
    WIRE_UI16 max_channels;
} CHANNEL_RTS_INFO;

/* How every other package starts; the whole of a keepalive. */
typedef struct {
    RTS_UI8 type;  /* CHANNEL_PKG_* */
    RTS_UI8 flags; /* CHANNEL_FLAG_* */
    WIRE_UI16 id;
} CHANNEL_HEADER;

typedef struct {
    CHANNEL_HEADER head;
    WIRE_UI32 acknowledged; /* highest block received in order */
} CHANNEL_ACK;

/* Then a part of a message. */
typedef struct {
    CHANNEL_HEADER head;
    WIRE_UI32 block;
    WIRE_UI32 acknowledged;
} CHANNEL_DATA;

/* At the beginning of the part in a block with CHANNEL_FLAG_FIRST. */
typedef struct {
    WIRE_UI32 size; /* of the message, bytes */
    WIRE_UI32 crc;  /* CRC-32 of the message */
} CHANNEL_MESSAGE;

/* ---- layer 7 [4.1] ---- */

/* Then the content, `length` bytes after that member. With L7_HEADER_LENGTH_SHORT there is no `customer`. */
typedef struct {
    WIRE_UI16 protocol; /* L7_PROTOCOL */
    WIRE_UI16 length;   /* L7_HEADER_LENGTH, counted from after this member */
    WIRE_UI16 group;    /* SG_*, in a reply with L7_REPLY */
    WIRE_UI16 service;  /* SRV_* */
    WIRE_UI32 session;
    WIRE_UI32 size; /* of the content, bytes */
    WIRE_UI32 customer;
} L7_HEADER;

/* ---- contents of elements [4.4 .. 4.10] ---- */

/* TAG_DEV_IDENT. */
typedef struct {
    WIRE_UI32 type;
    WIRE_UI32 id;
    WIRE_UI32 version;
} DEV_IDENT;

/* TAG_DEV_STACK (own). */
typedef struct {
    WIRE_UI32 size;   /* of the main stack, bytes; 0: not known */
    WIRE_UI32 unused; /* bytes of it that were never used */
} DEV_STACK;

/* TAG_DEV_CHALLENGE (own). */
typedef struct {
    RTS_UI8 nonce[16]; /* of the device, for one proof */
    RTS_UI8 salt[16];
    WIRE_UI32 iterations;
} DEV_CHALLENGE;

/* TAG_DEV_PROOF (own). */
typedef struct {
    RTS_UI8 nonce[16]; /* of the client */
    RTS_UI8 proof[32];
} DEV_PROOF;

/* TAG_USER_VERIFIER (own). What a device keeps of a password; no iterations: there is none. */
typedef struct {
    RTS_UI8 key[32]; /* StoredKey of RFC 5802 */
    RTS_UI8 salt[16];
    WIRE_UI32 iterations;
} USER_VERIFIER;

/* The reply to SRV_APP_LOGIN and SRV_APP_CREATE. */
typedef struct {
    WIRE_UI16 result;
    WIRE_UI32 session;     /* of the application */
    RTS_UI8 code_guid[16]; /* CRC of the image, zeros */
    RTS_UI8 data_guid[16];
} APP_LOGIN_REPLY;

/* TAG_APP_STATE. */
typedef struct {
    WIRE_UI16 result;
    WIRE_UI32 state;    /* AS_* */
    WIRE_UI32 op_state; /* OS_* */
} APP_STATE;

/* TAG_APP_EXECUTION_POSITION. */
typedef struct {
    WIRE_UI16 area;
    WIRE_UI32 offset;
} APP_POSITION;

/* TAG_APP_LAST_EXCEPTION (own). */
typedef struct {
    WIRE_UI32 code; /* RTSEXCPT_* */
    WIRE_UI32 code_offset;
    WIRE_UI32 task; /* index, -1: none */
} APP_LAST_EXCEPTION;

/* TAG_APP_IMAGE (own). */
typedef struct {
    WIRE_UI32 crc;
    WIRE_UI32 size;
} APP_IMAGE_IDENTITY;

/* TAG_CDL_POSITION (own). */
typedef struct {
    WIRE_UI32 flags; /* DLF_* */
    WIRE_UI32 offset;
    WIRE_UI32 total_size;
    WIRE_UI32 crc; /* of the image */
} CDL_POSITION;

/* TAG_CDL_PACKED (own). Then the packed data, see Unpack.h. */
typedef struct {
    WIRE_UI32 unpacked; /* bytes of the image that they are */
} CDL_PACKED;

/* TAG_TASK_INFO (own). Then the name with NUL. Times in us. */
typedef struct {
    WIRE_UI32 kind; /* KIND_* */
    WIRE_UI32 priority;
    WIRE_UI32 interval_us;
    WIRE_UI32 cycles;
    WIRE_UI32 last_us;
    WIRE_UI32 avg_us;
    WIRE_UI32 min_us;
    WIRE_UI32 max_us;
    WIRE_UI32 jitter_us;
    WIRE_UI32 overruns;
} TASK_INFO;

/* TAG_TASK_LATENESS (own). One for each class of lateness in which starts were counted, in ascending order. */
typedef struct {
    WIRE_UI32 below_ns; /* where the class ends */
    WIRE_UI32 count;
} TASK_LATENESS;

/* TAG_MON2_APPLICATION. */
typedef struct {
    WIRE_UI32 session;
    RTS_UI8 data_guid[16];
} MON2_APPLICATION;

/* Before each value that was read or is to be written. */
typedef struct {
    WIRE_UI16 id;
    WIRE_UI32 size;
} MON2_VALUE;

/* A place that is forced, traced or compared (own): APP_PLACE. */
typedef struct {
    RTS_UI8 area; /* APP_AREA_*, or TRACE_SYSTEM */
    RTS_UI8 pointers;
    RTS_UI8 size;
    RTS_UI8 mask;
    RTS_UI8 offset[16]; /* four numbers of 4 bytes */
} MON2_PLACE;

/* One of TAG_MON2_FORCED (own): FORCED_VALUE. */
typedef struct {
    MON2_PLACE place;
    RTS_UI8 value[8];
} MON2_FORCED;

/* TAG_TRACE_CONFIG (own): the configuration of a packet. Its records follow, a MON2_PLACE each. */
typedef struct {
    WIRE_UI32 image_crc; /* of the application that it is for */
    char name[16];       /* with NUL; "" if it has none */
    RTS_UI8 flags;       /* TRACE_KEEP and others */
    RTS_UI8 comparison;  /* TRACE_LESS and others */
    RTS_UI8 task;        /* its index */
    RTS_UI8 records;     /* how many */
    WIRE_UI32 every;     /* records each n-th cycle; 1: all */
    WIRE_UI32 samples;   /* how many, those before the trigger among them; 0: without end */
    WIRE_UI32 before;    /* how many of them from before the trigger */
    WIRE_UI64 constant;  /* the trigger compares with it */
    MON2_PLACE trigger;
} TRACE_CONFIG;

/* TAG_TRACE_STATE (own): what a packet has recorded. Samples are numbered from 0. */
typedef struct {
    WIRE_UI32 id;
    WIRE_UI32 state;    /* TRACE_WAITING and others */
    WIRE_UI32 written;  /* the number of the next sample */
    WIRE_UI32 trigger;  /* the number of the first sample from the trigger on */
    WIRE_UI32 first;    /* the number of the first sample that is packed here */
    WIRE_UI32 count;    /* how many are packed here */
    WIRE_UI32 capacity; /* how many samples there is room for */
} TRACE_STATE;

/* TAG_BP_RECORD (own): BP_BREAKPOINT. */
typedef struct {
    WIRE_UI32 code_offset;
    WIRE_UI32 skip;
    WIRE_UI32 hits;
    RTS_UI8 relation;
    RTS_UI8 kind;
    WIRE_UI16 reserved;
    MON2_PLACE place;
    RTS_UI8 value[8];
} BP_RECORD;

/* TAG_BP_STATE (own): BP_STATUS. */
typedef struct {
    WIRE_UI32 supported;
    WIRE_UI32 attached;
    WIRE_UI32 halted;
    WIRE_UI32 serial;
    WIRE_UI32 code;
    WIRE_UI32 task;
    WIRE_UI32 code_offset;
    WIRE_UI32 stack_size;
    RTS_UI8 stack[8];
    RTS_UI8 area[48]; /* six numbers of 8 bytes */
    WIRE_UI32 breakpoints;
    WIRE_UI32 room;
    WIRE_UI32 traps;
    WIRE_UI32 link;
} BP_STATE;

/* TAG_LOG_ENTRY. */
typedef struct {
    WIRE_UI32 component;
    WIRE_UI32 log_class;
    WIRE_UI32 error; /* ERR_* */
    WIRE_UI32 info;
} LOG_RECORD;

/* TAG_IO_STATE (own). Indices are those of the configuration (IoConfig.h). */
typedef struct {
    WIRE_UI16 index;
    WIRE_UI16 parent;  /* IO_CONFIG_NONE: none */
    WIRE_UI16 type;    /* CT_* */
    WIRE_UI16 flags;   /* CF_* */
    WIRE_UI32 errors;  /* since the application was loaded */
    WIRE_UI32 age_ms;  /* since its last good data; 0xFFFFFFFF: none yet, or longer */
    WIRE_UI32 skipped; /* how often a task found its driver busy, since the start of the runtime */
} IO_STATE;

/* TAG_IO_PARAMETER (own). */
typedef struct {
    WIRE_UI16 connector;
    WIRE_UI16 reserved;
    WIRE_UI32 id;
    WIRE_UI32 bits; /* to be read or written */
    WIRE_UI32 bit_offset;
} IO_PARAMETER;

/* TAG_IO_MODULE (own). Then its name with NUL. */
typedef struct {
    WIRE_UI32 vendor;
    WIRE_UI32 product;
    WIRE_UI32 revision;
    WIRE_UI32 slot; /* address on the bus */
} IO_MODULE;

/* TAG_FILE_CONTENT. */
typedef struct {
    WIRE_UI32 crc;
    WIRE_UI32 size;
} FILE_CONTENT;

/* TAG_FILE_POSITION, then the data of a download. */
typedef struct {
    WIRE_UI32 handle;
    WIRE_UI32 offset;
} FILE_POSITION;

#ifndef RTS_CFFI
#define WIRE_SIZE(layout, size) RTS_STATIC_ASSERT(sizeof(layout) == (size), layout##_has_no_padding)
WIRE_SIZE(ROUTER_HEADER, 6);
WIRE_SIZE(NS_REQUEST, 8);
WIRE_SIZE(NS_REPLY_0103, 32);
WIRE_SIZE(NS_REPLY_0400, 48);
WIRE_SIZE(NS_REPLY_0101, 22);
WIRE_SIZE(CHANNEL_META_HEADER, 8);
WIRE_SIZE(CHANNEL_OPEN_REQUEST, 20);
WIRE_SIZE(CHANNEL_OPEN_RESPONSE, 24);
WIRE_SIZE(CHANNEL_CLOSE, 12);
WIRE_SIZE(CHANNEL_RTS_INFO, 10);
WIRE_SIZE(CHANNEL_HEADER, 4);
WIRE_SIZE(CHANNEL_ACK, 8);
WIRE_SIZE(CHANNEL_DATA, 12);
WIRE_SIZE(CHANNEL_MESSAGE, 8);
WIRE_SIZE(L7_HEADER, 20);
WIRE_SIZE(DEV_IDENT, 12);
WIRE_SIZE(DEV_STACK, 8);
WIRE_SIZE(APP_LOGIN_REPLY, 38);
WIRE_SIZE(APP_STATE, 10);
WIRE_SIZE(APP_POSITION, 6);
WIRE_SIZE(APP_LAST_EXCEPTION, 12);
WIRE_SIZE(APP_IMAGE_IDENTITY, 8);
WIRE_SIZE(CDL_POSITION, 16);
WIRE_SIZE(CDL_PACKED, 4);
WIRE_SIZE(TASK_INFO, 40);
WIRE_SIZE(MON2_APPLICATION, 20);
WIRE_SIZE(MON2_VALUE, 6);
WIRE_SIZE(MON2_PLACE, 20);
WIRE_SIZE(MON2_FORCED, 28);
WIRE_SIZE(TRACE_CONFIG, 64);
WIRE_SIZE(TRACE_STATE, 28);
WIRE_SIZE(BP_RECORD, 44);
WIRE_SIZE(BP_STATE, 104);
WIRE_SIZE(LOG_RECORD, 16);
WIRE_SIZE(IO_STATE, 20);
WIRE_SIZE(IO_PARAMETER, 16);
WIRE_SIZE(IO_MODULE, 16);
WIRE_SIZE(FILE_CONTENT, 8);
WIRE_SIZE(FILE_POSITION, 8);
#undef WIRE_SIZE

/* Head of a block that begins a message. */
enum { CHANNEL_FIRST_SIZE = sizeof(CHANNEL_DATA) + sizeof(CHANNEL_MESSAGE) };
#endif

#endif
