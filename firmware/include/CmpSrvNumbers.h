/*
 * CmpSrvNumbers.h - every number of the communication protocol (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Names and values as in codesys-v3-protocol; what is our own is marked "own" and is not wire-compatible with anybody
 * else.
 */
#ifndef CMPSRVNUMBERS_H
#define CMPSRVNUMBERS_H

#include "CmpStd.h"
#include "CompactDownload.h"

/* ---- layer 2: serial framing (1.3) ---- */
enum {
    SIMPLECOM_START_1 = 0x23, /* "#<" starts, "#>" ends a frame; "#" inside becomes "#_" */
    SIMPLECOM_ESCAPE = 0x23,
    SIMPLECOM_START_2 = 0x3C,
    SIMPLECOM_END_2 = 0x3E,
    SIMPLECOM_STUFF = 0x5F,
    BLK_MAX_SIZE = 512, /* largest router packet, bytes */
    BLK_DRV_TYPE_COM = 2,
    BLK_DRV_TYPE_DIRECT = 8,
};

/* ---- layer 3: router (2) ---- */
enum {
    ROUTER_MAGIC = 0xC5,
    ROUTER_HEADER_WORDS = 3,
    ROUTER_HOP_COUNT = 14, /* what real runtimes put into their replies */
    ROUTER_PRIO_NORMAL = 1,
    ROUTER_MAX_ADDRESS = 15, /* words */
    ROUTER_SVC_ADDRESS_REQUEST = 1,
    ROUTER_SVC_ADDRESS_NOTIFY = 2,
    ROUTER_SVC_NAME_REQUEST = 3,
    ROUTER_SVC_NAME_RESPONSE = 4,
    ROUTER_SVC_CHANNEL = 64,
};

/* ---- name service (2.6) ---- */
enum {
    NS_RESOLVE_NAME = 0xC201,
    NS_RESOLVE_ADDRESS = 0xC202,
    NS_IDENTIFICATION = 0xC280,
    NS_VERSION_0400 = 0x0400,
    NS_VERSION_0103 = 0x0103,
    NS_VERSION_0102 = 0x0102,
    NS_VERSION_0101 = 0x0101,
    NS_REQUEST_SIZE = 8,
    NS_MAX_NODE_NAME = 49,  /* characters without NUL, as the two below */
    NS_MAX_TYPE_NAMES = 98, /* device name + vendor name */
    NS_MAX_SERIAL = 64,
    NS_MAX_REPLY = 444,
};

/*
 * ---- layer 4: channel (3) ----
 * Where the spec is silent, our server does this:
 * - Blocks are taken in order only. A later block is dropped and answered at once with one ACK + CHANNEL_FLAG_MISSING;
 *   that is repeated only when the client starts to send again from an earlier block and one is missing again.
 * - In-order blocks of a request are not acknowledged one by one: the reply carries the acknowledgement.
 * - A repeated block is acknowledged again; when the reply has been sent completely and not been acknowledged, a
 *   repeated block also makes the server send the reply again. By itself it repeats the reply after 1, 2, 4 and 8 s.
 *   An empty block with a number that has arrived is a question for both.
 * - An ACK + CHANNEL_FLAG_MISSING from the client makes the server send again from there, at most every 100 ms.
 * - A complete new request acknowledges the reply before it. So a client may send the next request before it has the
 *   reply (two in flight, used by the download); a reply that is lost then is not sent again: the client takes the
 *   next first block and goes on from its block number.
 * - An open request with the same request id from the same address is answered with the same channel as long as no
 *   block has arrived on it. With another request id it replaces the channel. Another address gets a free channel of
 *   the COMM_MAX_CLIENTS; without one it replaces the one that has been silent for longest, of those that have no
 *   login or have been silent for CHANNEL_IDLE_MS; otherwise it gets CHANNEL_OPEN_NO_CHANNEL.
 * - A package with a channel id the server does not know is answered with CHANNEL_PKG_CLOSE ERR_CHS_CHINVALID, at
 *   most one per CHANNEL_COMPLAINT_MS. Close requests are not answered.
 */
enum {
    CHANNEL_VERSION = 0x0101,
    CHANNEL_PKG_DATA = 0x01,
    CHANNEL_PKG_ACK = 0x02,
    CHANNEL_PKG_KEEPALIVE = 0x03,
    CHANNEL_PKG_RTSINFO_RESP = 0x82,
    CHANNEL_PKG_OPEN_RESP = 0x83,
    CHANNEL_PKG_CLOSE = 0x84,
    CHANNEL_PKG_RTSINFO_REQ = 0xC2,
    CHANNEL_PKG_OPEN_REQ = 0xC3,
    CHANNEL_PKG_CLOSE_REQ = 0xC4,
    CHANNEL_FLAG_FIRST = 0x01,
    CHANNEL_FLAG_MISSING = 0x02, /* in an ACK: please send again from the block after the acknowledged one */
    CHANNEL_FLAG_TO_SERVER = 0x80,
    CHANNEL_META = 0x80, /* in the package type: has version and CRC */
    CHANNEL_META_SIZE = 8,
    CHANNEL_DATA_SIZE = 12, /* header of a DATA package; the first block of a message has CHANNEL_FIRST_SIZE */
    CHANNEL_FIRST_SIZE = 20,
    CHANNEL_ACK_SIZE = 8,
    CHANNEL_KEEPALIVE_SIZE = 4,
    CHANNEL_OPEN_REQ_SIZE = 20, /* version 1.0: 16 */
    CHANNEL_OPEN_RESP_SIZE = 24,
    CHANNEL_CLOSE_SIZE = 12,
    CHANNEL_ID_NONE = 0xFFFF,
    CHANNEL_ID_MAX = 0xFFFC,
    CHANNEL_OPEN_OK = 0,
    CHANNEL_OPEN_NO_CHANNEL = 1,
    CHANNEL_OPEN_NO_SERVER = 2,
    CHANNEL_KEEPALIVE_MS = 1000,
    CHANNEL_TIMEOUT_MS = 30000,
    CHANNEL_IDLE_MS = 5000,
    CHANNEL_COMPLAINT_MS = 100,
    CHANNEL_MIN_MESSAGE = 128, /* an open request for a smaller buffer is ignored */
};

/*
 * ---- layer 7 (4.1) ----
 * The reply has the same header form (12 or 16 bytes) as the request and echoes its session id. A service that fails
 * as a whole (malformed request, unknown service, no session) is answered with TAG_ERROR u16 ERR_* alone; a service
 * that was understood but refused has its result in TAG_SERVICE_RESULT or where the layout says. Services marked L
 * below need in the header the session id of a login (SRV_DEV_LOGIN), otherwise TAG_ERROR ERR_INVALID_SESSION_ID (or
 * ERR_NO_ACCESS_RIGHTS when the session has been created but not logged in). Integers in requests may have 1, 2 or 4
 * bytes unless a layout fixes them. A message with a broken layer-7 header closes the channel with
 * ERR_CHS_REQNOTHANDLED.
 */
enum {
    L7_PROTOCOL = 0xCD55,
    L7_HEADER_LENGTH = 16,
    L7_HEADER_LENGTH_SHORT = 12,
    L7_HEADER_LENGTH_MAX = 64,
    L7_HEADER_PREFIX = 4, /* bytes before the part that the header length counts */
    L7_REPLY = 0x0080,
    L7_SESSION_EMPTY = 0,
    L7_SESSION_INITIAL = 0x11,
    TAG_SERVICE_RESULT = 0x01, /* u16 */
    TAG_ERROR = 0xFF7F,        /* u16 */
};

/* Service groups (4.3). */
enum {
    SG_DEVICE = 1,
    SG_APPLICATION = 2,
    SG_LOG = 5,
    SG_MONITORING2 = 0x1B,
};

/*
 * Device services and tags (4.4, 4.5).
 *
 * GET_TARGET_IDENT  request: [TAG_DEV_IDENT 3 x u32: type, id, version expected]. Reply, session id 0: TAG_DEV_RESULT
 *   u16 (OK, or ERR_TYPE_MISMATCH when another type or id was expected), TAG_DEV_IDENT 3 x u32, TAG_DEV_RTS_VERSION
 *   u32, TAG_DEV_DEVICE_NAME, TAG_DEV_VENDOR_NAME, TAG_DEV_NODE_NAME (each u32 byte length with NUL, UTF-16LE text,
 *   NUL, zero padding), TAG_DEV_MAX_CHANNELS u16, TAG_DEV_SERIAL_NUMBER u16 length, ASCII, zero padding, [TAG_DEV_STACK
 *   2 x u32 (own): bytes of the main stack, 0 when not known, and how many of them have never been used].
 * SESSION_CREATE    request: [TAG_DEV_CLIENT_INFO], [TAG_DEV_AUTH_TYPE u32]. Reply: TAG_DEV_SESSION_ID u32,
 *   TAG_DEV_AUTH_TYPE u32 = DEV_CRYPT_XOR. The session has no rights before the login.
 * LOGIN             header session id: L7_SESSION_INITIAL, L7_SESSION_EMPTY or that of SESSION_CREATE. Request:
 *   TAG_DEV_CRYPT_TYPE with bit DEV_CRYPT_XOR, [TAG_DEV_CREDENTIALS {TAG_DEV_USER}] (ignored: no user management).
 *   Reply: TAG_DEV_LOGIN_REPLY {TAG_DEV_LOGIN_RESULT u16, TAG_DEV_SESSION_ID u32, TAG_DEV_SETTINGS u32}; on failure
 *   the result alone.
 * LOGOUT            request: TAG_DEV_LOGOUT_SESSION u32. Reply: TAG_DEV_LOGOUT_REPLY u16 result.
 * ECHO              request: [TAG_DEV_ECHO_LENGTH u32], TAG_DEV_ECHO_REPLY_LENGTH u32, [TAG_DEV_ECHO_DATA]. Reply:
 *   TAG_SERVICE_RESULT, TAG_DEV_ECHO_REPLY_LENGTH u32 (limited to what fits), TAG_DEV_ECHO_DATA exactly that many
 *   bytes (the request's data, then zeros). Without TAG_DEV_ECHO_REPLY_LENGTH the reply is empty.
 */
enum {
    SRV_DEV_GET_TARGET_IDENT = 1,
    SRV_DEV_LOGIN = 2,
    SRV_DEV_LOGOUT = 3,
    SRV_DEV_ECHO = 5,
    SRV_DEV_SESSION_CREATE = 0x0A,
    TAG_DEV_LOGOUT_REPLY = 0x00,
    TAG_DEV_LOGOUT_SESSION = 0x01,
    TAG_DEV_IDENT = 0x01,
    TAG_DEV_DEVICE_NAME = 0x02,
    TAG_DEV_VENDOR_NAME = 0x03,
    TAG_DEV_NODE_NAME = 0x04,
    TAG_DEV_RESULT = 0x05,
    TAG_DEV_RTS_VERSION = 0x06,
    TAG_DEV_MAX_CHANNELS = 0x08,
    TAG_DEV_SERIAL_NUMBER = 0x09,
    TAG_DEV_STACK = 0x60, /* own */
    TAG_DEV_CREDENTIALS = 0x81,
    TAG_DEV_USER = 0x10,
    TAG_DEV_LOGIN_REPLY = 0x82,
    TAG_DEV_LOGIN_RESULT = 0x20,
    TAG_DEV_SESSION_ID = 0x21,
    TAG_DEV_CRYPT_TYPE = 0x22,
    TAG_DEV_SETTINGS = 0x24,
    TAG_DEV_AUTH_TYPE = 0x46,
    TAG_DEV_ECHO_LENGTH = 0x51,
    TAG_DEV_ECHO_REPLY_LENGTH = 0x52,
    TAG_DEV_ECHO_DATA = 0x53,
    TAG_DEV_CLIENT_INFO = 0x83,
    DEV_CRYPT_XOR = 1,
    DEV_SETTING_MONITOR2 = 4,
};

/*
 * Application services and tags (4.6). There is one application; its name is not compared.
 *
 * LOGIN L           request: TAG_APP_LOGIN_NAME text, 1..60 bytes, NUL or not. Reply: TAG_APP_DESCRIPTOR
 *   {TAG_APP_OPTION: u16 result, u32 application session, 16 bytes code GUID, 16 bytes data GUID}. Both GUIDs are the
 *   image CRC as u32 and 12 zeros. Without application the result is ERR_APP_NOT_EXIST, the rest 0.
 * LOGOUT L          request: TAG_APP_LOGOUT u32 application session. Reply: TAG_APP_LOGOUT u16 result.
 * CREATE L          request: TAG_APP_DESCRIPTOR {TAG_APP_OPTION name}. Reply as LOGIN, result OK with or without
 *   application.
 * START, STOP L     request: TAG_APP_DESCRIPTOR {TAG_APP_SESSION u32}. Reply: TAG_SERVICE_RESULT u16
 *   (ERR_APP_INVALID_SESSIONID when the application session is not the one of LOGIN or CREATE).
 * RESET L           as START, the container also with TAG_APP_OPTION u32 RESET_OPTION_*.
 * READ_STATUS       request: anything. Reply: TAG_APP_STATUS {TAG_APP_STATE u16 result OK, u32 AS_*, u32 OS_*;
 *   TAG_APP_EXECUTION_POSITION u16 area, u32 offset (only after an exception in the code); TAG_APP_LAST_EXCEPTION;
 *   TAG_APP_IMAGE; TAG_APP_CALLS, after an exception, when something is known, as many as fit}.
 * READ_APPLICATION_LIST  request: [TAG_APP_LIST_RANGE u32 start, u32 max, 8 or 9 bytes]. Reply: TAG_APP_LIST
 *   {TAG_APP_LIST_START u32, one TAG_APP_LIST_NAME text per application}.
 * READ_APPLICATION_INFO  request: anything. Reply: TAG_APP_INFO_* texts, NUL-terminated and zero-padded; TAG_ERROR
 *   ERR_APP_NOT_LOADED without application.
 * READ_TASK_INFO    request: anything. Reply: one TAG_TASK_INFO per task; empty without tasks.
 * The application session ends with the session, the channel or LOGOUT. It survives a download.
 */
enum {
    SRV_APP_LOGIN = 0x01,
    SRV_APP_LOGOUT = 0x02,
    SRV_APP_CREATE = 0x03,
    SRV_APP_START = 0x10,
    SRV_APP_STOP = 0x11,
    SRV_APP_RESET = 0x12,
    SRV_APP_READ_STATUS = 0x14,
    SRV_APP_READ_APPLICATION_LIST = 0x18,
    SRV_APP_READ_APPLICATION_INFO = 0x29,
    SRV_APP_DOWNLOAD_COMPACT = 0x30,
    SRV_APP_READ_TASK_INFO = 0x70, /* own */
    TAG_APP_LOGOUT = 0x00,
    TAG_APP_LOGIN_NAME = 0x01,
    TAG_APP_DESCRIPTOR = 0x81,         /* container {TAG_APP_OPTION, TAG_APP_SESSION} */
    TAG_APP_OPTION = 0x10,             /* name, or u32 reset option */
    TAG_APP_SESSION = 0x11,            /* u32 */
    TAG_APP_STATUS = 0x82,             /* container of the status reply */
    TAG_APP_STATE = 0x13,              /* u16 result, u32 AS_*, u32 OS_* */
    TAG_APP_EXECUTION_POSITION = 0x14, /* u16 area, u32 offset: where the exception was */
    TAG_APP_LAST_EXCEPTION = 0x40,     /* own, in TAG_APP_STATUS: u32 code, u32 code offset, i32 task index */
    TAG_APP_IMAGE = 0x41,              /* own, in TAG_APP_STATUS: u32 image crc, u32 image size */
    TAG_APP_CALLS = 0x42,              /* own, in TAG_APP_STATUS: an EXCEPT_CALL (u32 target, u32 distance) each */
    TAG_APP_LIST = 0x81,
    TAG_APP_LIST_RANGE = 0x01,
    TAG_APP_LIST_START = 0x02,
    TAG_APP_LIST_NAME = 0x03,
    TAG_APP_INFO_PROJECT = 0x01,
    TAG_APP_INFO_VERSION = 0x02,
    TAG_APP_INFO_AUTHOR = 0x04,
    TAG_APP_INFO_DESCRIPTION = 0x05,
    TAG_APP_INFO_PROFILE = 0x06,
    APP_LOGIN_REPLY_SIZE = 38,
};

/*
 * Compact download L, service 2/0x30; body is our own.
 *
 * Request: TAG_CDL_POSITION {u32 flags DLF_*, u32 offset, u32
 * total size, u32 image crc}, TAG_CDL_DATA bytes (absent: only asks how much has arrived). Data at offset 0 without
 * DLF_CONTINUEDOWNLOAD begins anew, all other continues.
 * Reply: TAG_SERVICE_RESULT u16, TAG_CDL_NEXT u32 bytes
 * received so far. The block that completes the image is answered with the result of all checks, and TAG_CDL_REASON
 * (text) when it was refused.
 * - A block at an offset below TAG_CDL_NEXT: the part already received is skipped, the rest (if any) written.
 * - A block beyond TAG_CDL_NEXT: ERR_INVALID_SEQUENCE; so is one with a total size or crc other than those of the
 *   transfer under way (TAG_CDL_NEXT is then 0).
 * - The question (no data): TAG_CDL_NEXT of the transfer under way when total size and crc agree, the total size when
 *   that image is already the application, 0 otherwise; the result is OK. A transfer outlives its channel: open a new
 *   one, ask, continue.
 * - TAG_CDL_NEXT is cumulative, so the next block may be sent before the reply to the one before has arrived.
 */
enum {
    TAG_CDL_POSITION = 0x02,
    TAG_CDL_DATA = 0x03,
    TAG_CDL_NEXT = 0x04,
    TAG_CDL_REASON = 0x05,
    CDL_POSITION_SIZE = 16,
};

/* Task information, service 2/0x70, our own. Reply: one TAG_TASK_INFO per task: ten u32 in the order of
 * IEC_TASK_INFO after its name, then the name with its NUL. */
enum { TAG_TASK_INFO = 0x42, TASK_INFO_WORDS = 10 };

/*
 * Monitoring, group 0x1B (4.9), L. Both requests have TAG_MON2_APPLICATION: u32 application session, 16 bytes data
 * GUID as LOGIN of the application gave them. A request that fails as a whole is answered with TAG_MON2_ERROR u32:
 * below 0x100 a MONITORING_ERR_*, otherwise ERR_APP_NOT_LOADED, ERR_APP_INVALID_SESSIONID, or ERR_APP_INVALID_DATAID
 * (another image has been loaded: fetch its symbols).
 *
 * READ   request: TAG_MON2_READ_LIST { n x TAG_MON2_READ_VAR { [TAG_MON2_VAR_ID 0..0x7FFF, default: index in the
 *   list], TAG_MON2_VAR_SIZE, [TAG_MON2_VAR_TYPE_CLASS], [TAG_MON2_VAR_CODE_SIZE], TAG_MON2_VAR_CODE } }. Code is
 *   `02 lo hi 06 area` or `03 b0 b1 b2 b3 06 area`, then any number of steps `09 08 02 lo hi 0E` (or with 03): to the
 *   offset `hi lo` from where the pointer there leads, which must be in one of the areas (otherwise
 *   MONITORING_ERR_INVALID_POINTER); with or without a final 01 and zero padding. Unpadded and
 *   with the optional tags left out a variable takes 13 bytes: `82 01 0A  02 01 04  05 05 02 lo hi 06 area`, 150 in
 *   one request. Neighbouring variables may be read as one. Reply: TAG_MON2_VALUES = per variable, in the order of
 *   the request: u16 id, u32 size, value. A variable that cannot be read has (own): u16 id | MON2_ID_FAILED, u32 1,
 *   u8 MONITORING_ERR_*. What does not fit the message has MONITORING_ERR_BUFFERSIZE_EXCEEDED; ask for it again in a
 *   request of its own. Padding: less than 6 bytes at the end. TAG_MON2_CONSISTENT u16 1 (own) follows when no task was
 *   in its cycle while the values were copied: together they are a state between two cycles. Otherwise ask again.
 * WRITE  request: TAG_MON2_WRITE_LIST = n x { u16 id, u32 size, value, u16 code size, code }. Code as for reading, or
 *   the program with Cpy of 4.9 (`15 0C 00` address `17 0C 09 04 1B 06 00 01 00 00 17 04 09 04 17 08 09 04 04`), or
 *   (own) an address and `40 mask`: of the byte there the bits in the mask are set to those of the value (its first byte),
 *   in one step, so that nothing is lost that tasks write to the other bits meanwhile.
 *   Reply: empty = all written; TAG_MON2_ERROR and TAG_MON2_ERROR_INDEX u32 (own): the first bad entry, nothing has
 *   been written (but the entries before it when a pointer to it changed just then). Writable are the areas data,
 *   retain, input, output and memory.
 * Values of 1, 2, 4 and 8 bytes at a multiple of their size are read in one access where the CPU can; values of up to
 * MON2_ONE_STEP_SIZE bytes are written in one step for tasks that take inputs and give outputs; on one core for all.
 */
enum {
    SRV_MON2_READ = 1,
    SRV_MON2_WRITE = 2,
    TAG_MON2_APPLICATION = 0x01, /* u32 application session, 16 bytes data GUID */
    TAG_MON2_WRITE_LIST = 0x03,
    TAG_MON2_READ_LIST = 0x81,
    TAG_MON2_READ_VAR = 0x82,
    TAG_MON2_VAR_ID = 0x01,
    TAG_MON2_VAR_SIZE = 0x02,
    TAG_MON2_VAR_TYPE_CLASS = 0x03,
    TAG_MON2_VAR_CODE_SIZE = 0x04,
    TAG_MON2_VAR_CODE = 0x05,
    TAG_MON2_VALUES = 0x40,
    TAG_MON2_ERROR = 0x41,
    TAG_MON2_ERROR_INDEX = 0x42, /* own */
    TAG_MON2_CONSISTENT = 0x43,  /* own */
    MON2_POINTER_SIZE = APP_POINTER_SIZE,
    MON2_ONE_STEP_SIZE = 64,
    MON2_APPLICATION_SIZE = 20,
    MON2_ID_FAILED = 0x8000, /* own */
    MON2_OP_HALT = 0x01,
    MON2_OP_LD16 = 0x02,
    MON2_OP_LD32 = 0x03,
    MON2_OP_CPY = 0x04,
    MON2_OP_RAO = 0x06, /* relative to the area in the next byte: leaves an address */
    MON2_OP_DER = 0x09, /* the value, of as many bytes as the next byte says, at an address */
    MON2_OP_ADD = 0x0E,
    MON2_OP_MASK = 0x40, /* own: of the byte at an address only the bits that are 1 in the next byte are written */
};

/*
 * Log, group 5 (4.10). GET_ENTRIES request: [TAG_LOG_NAME], [TAG_LOG_START_HANDLE u32, default 0], [TAG_LOG_COUNT
 * u32, default all]. Reply: per entry, oldest first, TAG_LOG_RECORD {TAG_LOG_HANDLE u32, TAG_LOG_TIME_NS u64,
 * TAG_LOG_ENTRY {u32 component id, u32 class, u32 error, u32 info id = 0}, TAG_LOG_TEXT, TAG_LOG_COMPONENT_NAME}
 * (texts NUL-terminated, zero-padded), as many as fit. Ask again from the last handle + 1; an empty reply is the end.
 */
enum {
    SRV_LOG_GET_ENTRIES = 1,
    TAG_LOG_NAME = 0x01,
    TAG_LOG_START_HANDLE = 0x02,
    TAG_LOG_COUNT = 0x04,
    TAG_LOG_RECORD = 0x82,
    TAG_LOG_HANDLE = 0x01,
    TAG_LOG_TIME_NS = 0x08,
    TAG_LOG_ENTRY = 0x03,
    TAG_LOG_TEXT = 0x04,
    TAG_LOG_COMPONENT_NAME = 0x05,
};

#endif
