/*
 * CmpSrvNumbers.h - every number of the communication protocol (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Names and values as in codesys-v3-protocol, sections in brackets; what is our own is marked "own", and no other
 * vendor's tools know it. Layouts are in CmpPackets.h; which service takes and gives what is in docs/protocol.md.
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
    BLK_DRV_TYPE_TCP = 1,
    BLK_DRV_TYPE_COM = 2,
    BLK_DRV_TYPE_UDP = 5,
    BLK_DRV_TYPE_CAN = 7,
    BLK_DRV_TYPE_DIRECT = 8,
};

/* ---- layer 2: networks (1.1, 1.2) ---- */
enum {
    TCP_MAGIC = -401145600, /* 0xE8170100 as a signed enum constant */
    TCP_PORT = 11740,
    UDP_PORT = 1740, /* of port index 0 */
    UDP_PORTS = 4,
    UDP_INDEX_BITS = 2,     /* of a network address, above those of the host */
    ROUTER_MAX_NETWORK = 3, /* words of a network address */
};

/* ---- layer 2: CAN (own; docs/can.md) ---- */
enum {
    CAN_ID_BASE = 0x1F400000, /* of 29-bit identifiers: base | target << 8 | source; base has zeros there */
    CAN_TARGET_SHIFT = 8,
    CAN_ADDRESS_MASK = 0xFF,
    CAN_BASE_MASK = 0x1FFF0000, /* what of a base may be set */
    CAN_NODE_MAX = 127,         /* devices are 1..127, as in CANopen */
    CAN_TOOL_MIN = 128,
    CAN_TOOL_MAX = 254,
    CAN_TO_ALL = 255,
    CAN_FRAME_SCAN = 0x40, /* first byte of the frames that are not ISO-TP's */
    CAN_FRAME_CLAIM = 0x41,
    CAN_FRAME_TAKEN = 0x42,
    CAN_SCAN_UNIT_MS = 10, /* of CAN_SCAN.window */
};

/* ---- layer 3: router (2) ---- */
enum {
    ROUTER_MAGIC = 0xC5,
    ROUTER_HOP_COUNT = 14, /* what real runtimes put into their replies */
    ROUTER_HOP_SHIFT = 3,  /* in ROUTER_HEADER.hops, below it the words of the header */
    ROUTER_PRIO_SHIFT = 6,
    ROUTER_PRIO_NORMAL = 1,
    ROUTER_FLAG_SIGNAL = 0x20,
    ROUTER_FLAG_RELATIVE = 0x10,
    ROUTER_BLOCK_UNIT = 32,  /* bytes per step of the longest packet in ROUTER_HEADER.flags */
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
    NS_MAX_NODE_NAME = 49,  /* characters without NUL, as the two below */
    NS_MAX_TYPE_NAMES = 98, /* device name + vendor name */
    NS_MAX_SERIAL = 64,
    NS_MAX_REPLY = 444,
};

/* ---- layer 4: channel (3) ---- */
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
    CHANNEL_ID_NONE = 0xFFFF,
    CHANNEL_ID_MAX = 0xFFFC,
    CHANNEL_OPEN_OK = 0,
    CHANNEL_OPEN_NO_CHANNEL = 1,
    CHANNEL_OPEN_NO_SERVER = 2,
    CHANNEL_KEEPALIVE_MS = 1000,
    CHANNEL_TIMEOUT_MS = 30000,
    CHANNEL_IDLE_MS = 5000,
    CHANNEL_COMPLAINT_MS = 100,
    CHANNEL_LOGIN_MS = 5000,      /* on a network or bus: a channel ends when it has had no login for so long */
    CHANNEL_REPLY_WAIT_MS = 1000, /* a reply that may wait is sent when nothing has come for so long */
    CHANNEL_PROBE_MS = 200,       /* what has been silent for so long is sent something when all channels are in use */
    CHANNEL_SETTLE_MS = 1000,     /* and is not given to another peer before, once it has been used */
    CHANNEL_MIN_MESSAGE = 128,    /* an open request for a smaller buffer is ignored */
};

/* ---- layer 7 (4.1) ---- */
enum {
    L7_PROTOCOL = 0xCD55,
    L7_HEADER_LENGTH = 16,
    L7_HEADER_LENGTH_SHORT = 12,
    L7_HEADER_LENGTH_MAX = 64,
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
    SG_SETTINGS = 6,
    SG_FILE_TRANSFER = 8,
    SG_IOMGR = 0x0B,
    SG_USERMGR = 0x0C,
    SG_PLCSHELL = 0x11,
    SG_APPLICATION_BP = 0x12,
    SG_MONITORING2 = 0x1B,
    SG_TRACE = 0x60, /* own */
};

/* Device services and tags (4.4, 4.5). */
enum {
    SRV_DEV_GET_TARGET_IDENT = 1,
    SRV_DEV_LOGIN = 2,
    SRV_DEV_LOGOUT = 3,
    SRV_DEV_ECHO = 5,
    SRV_DEV_SET_OPERATION_MODE = 6,
    SRV_DEV_GET_OPERATION_MODE = 7,
    SRV_DEV_SET_NODE_NAME = 9,
    SRV_DEV_SESSION_CREATE = 0x0A,
    TAG_DEV_LOGOUT_REPLY = 0x00,
    TAG_DEV_LOGOUT_SESSION = 0x01,
    TAG_DEV_IDENT = 0x01,
    TAG_DEV_DEVICE_NAME = 0x02,
    TAG_DEV_VENDOR_NAME = 0x03,
    TAG_DEV_NODE_NAME = 0x04,
    TAG_DEV_RESULT = 0x05,
    TAG_DEV_RTS_VERSION = 0x06,
    TAG_DEV_FLAGS = 0x07,
    TAG_DEV_MAX_CHANNELS = 0x08,
    TAG_DEV_SERIAL_NUMBER = 0x09,
    TAG_DEV_NETWORKS = 0x0A,
    TAG_DEV_STACK = 0x60,     /* own */
    TAG_DEV_CHALLENGE = 0x61, /* own */
    TAG_DEV_PROOF = 0x62,     /* own */
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
    TAG_DEV_OPERATION_MODE = 0x54,
    TAG_DEV_NEW_NODE_NAME = 0x58,
    TAG_DEV_ONLINE_ACCESS = 0xFF82,
    TAG_DEV_CLIENT_INFO = 0x83,
    DEV_CRYPT_XOR = 1,
    DEV_CRYPT_ASYMMETRIC = 2,
    DEV_CRYPT_PROOF = 0x100, /* own: DEV_CHALLENGE and DEV_PROOF */
    DEV_SETTING_MONITOR2 = 4,
    DEV_MODE_DEBUG = 1, /* of TAG_DEV_OPERATION_MODE */
};

/* Application services and tags (4.6). */
enum {
    SRV_APP_LOGIN = 0x01,
    SRV_APP_LOGOUT = 0x02,
    SRV_APP_CREATE = 0x03,
    SRV_APP_DELETE = 0x04,
    SRV_APP_START = 0x10,
    SRV_APP_STOP = 0x11,
    SRV_APP_RESET = 0x12,
    SRV_APP_READ_STATUS = 0x14,
    SRV_APP_READ_APPLICATION_LIST = 0x18,
    SRV_APP_RELEASE_FORCE_LIST = 0x20,
    SRV_APP_SINGLE_CYCLE = 0x22,
    SRV_APP_CREATE_BOOTPROJECT = 0x23,
    SRV_APP_READ_APPLICATION_INFO = 0x29,
    SRV_APP_DOWNLOAD_COMPACT = 0x30,
    SRV_APP_GET_AREA_ADDRESS = 0x38,
    SRV_APP_READ_TASK_INFO = 0x70,     /* own */
    SRV_APP_READ_TASK_LATENESS = 0x74, /* own */
    SRV_APP_READ_REGISTERS = 0xA7,     /* own */
    TAG_APP_LOGOUT = 0x00,
    TAG_APP_LOGIN_NAME = 0x01,
    TAG_APP_DESCRIPTOR = 0x81,
    TAG_APP_OPTION = 0x10,
    TAG_APP_SESSION = 0x11,
    TAG_APP_STATUS = 0x82,
    TAG_APP_OPERATION_MODE = 0x32,
    TAG_APP_STATE = 0x13,
    TAG_APP_AREA = 0x13,
    TAG_APP_AREA_ADDRESS = 0x14,
    TAG_APP_EXECUTION_POSITION = 0x14,
    TAG_APP_LAST_EXCEPTION = 0x40, /* own */
    TAG_APP_IMAGE = 0x41,          /* own */
    TAG_APP_CALLS = 0x42,          /* own */
    TAG_APP_FORBIDDEN = 0x43,      /* own; OperationForbidden() (CmpOperationControl.h), left out when it is 0 */
    TAG_APP_REGISTERS = 0x7B,      /* own; u32 EXCEPT_REGISTERS_*, then a word each, of APP_POINTER_SIZE bytes */
    TAG_APP_REASON = 0x48,         /* own; beside TAG_SERVICE_RESULT: why a component denied it */
    TAG_APP_LIST = 0x81,
    TAG_APP_LIST_RANGE = 0x01,
    TAG_APP_LIST_START = 0x02,
    TAG_APP_LIST_NAME = 0x03,
    TAG_APP_INFO_PROJECT = 0x01,
    TAG_APP_INFO_VERSION = 0x02,
    TAG_APP_INFO_AUTHOR = 0x04,
    TAG_APP_INFO_DESCRIPTION = 0x05,
    TAG_APP_INFO_PROFILE = 0x06,
};

/* Compact download (own). */
enum {
    TAG_CDL_POSITION = 0x02,
    TAG_CDL_DATA = 0x03,
    TAG_CDL_NEXT = 0x04,
    TAG_CDL_REASON = 0x05,
    TAG_CDL_PACKED = 0x06,
    TAG_CDL_UNPACKS = 0x07,
    TAG_CDL_TRIES = 0x09,
    TAG_CDL_CHANGES = 0x08,
};

/* Task information (own). */
enum {
    TAG_TASK_INFO = 0x42,
    TAG_TASK_LATENESS = 0x43,
    TAG_TASK_LOAD = 0x44, /* after the TAG_TASK_INFO of the task: u32 percent of one processor (CmpTaskLoad.h) */
};

/* Settings (4.11). */
enum {
    SRV_SETTG_GET_INT = 1,
    SRV_SETTG_SET_INT = 2,
    SRV_SETTG_GET_STRING = 3,
    SRV_SETTG_SET_STRING = 4,
    SRV_SETTG_REMOVE = 5,
    SRV_SETTG_READ_ALL = 6,
    SRV_SETTG_WRITE = 7,
};

/* Monitoring (4.9). */
enum {
    SRV_MON2_READ = 1,
    SRV_MON2_WRITE = 2,
    SRV_MON2_FORCE_LIST = 0x60, /* own, as the next ones */
    SRV_MON2_FORCE = 0x61,
    SRV_MON2_UNFORCE = 0x62,
    TAG_MON2_APPLICATION = 0x01,
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
    TAG_MON2_ERROR_INDEX = 0x42,  /* own */
    TAG_MON2_CONSISTENT = 0x43,   /* own */
    TAG_MON2_FORCE_SERIAL = 0x44, /* own, as the next ones */
    TAG_MON2_FORCE_MAX = 0x45,
    TAG_MON2_FORCE_START = 0x46,
    TAG_MON2_FORCED = 0x47,
    MON2_POINTER_SIZE = APP_POINTER_SIZE,
    MON2_ONE_STEP_SIZE = 64,
    MON2_ID_FAILED = 0x8000,
    MON2_OP_HALT = 0x01,
    MON2_OP_LD16 = 0x02,
    MON2_OP_LD32 = 0x03,
    MON2_OP_CPY = 0x04,
    MON2_OP_RAO = 0x06, /* relative to the area in the next byte: leaves an address */
    MON2_OP_DER = 0x09, /* the value, of as many bytes as the next byte says, at an address */
    MON2_OP_ADD = 0x0E,
    MON2_OP_MASK = 0x40, /* own: of the byte at an address only the bits that are 1 in the next byte are written */
};

/* Traces (own; CmpTraceMgr.h). */
enum {
    SRV_TRACE_CREATE = 1,
    SRV_TRACE_DELETE = 2,
    SRV_TRACE_LIST = 3,
    SRV_TRACE_READ = 4,
    TAG_TRACE_CONFIG = 0x01,
    TAG_TRACE_ID = 0x02,
    TAG_TRACE_FROM = 0x03,
    TAG_TRACE_RESULT = 0x04,
    TAG_TRACE_RECORD = 0x05,
    TAG_TRACE_STATE = 0x06,
    TAG_TRACE_SAMPLES = 0x07,
};

/* Breakpoints (own; docs/debugging.md). */
enum {
    SRV_BP_ATTACH = 0x60,
    SRV_BP_DETACH = 0x61,
    SRV_BP_STATUS = 0x62,
    SRV_BP_SET = 0x63,
    SRV_BP_CLEAR = 0x64,
    SRV_BP_LIST = 0x65,
    SRV_BP_TEMPORARY = 0x66,
    SRV_BP_GO = 0x67,
    SRV_BP_PAUSE = 0x68,
    SRV_BP_READ_STACK = 0x69,
    SRV_BP_WRITE_STACK = 0x6A,
    SRV_BP_WATCH = 0x93,
    TAG_BP_KEEP = 0x02,
    TAG_BP_STATE = 0x03,
    TAG_BP_RECORD = 0x04,
    TAG_BP_OFFSET = 0x05,
    TAG_BP_START = 0x06,
    TAG_BP_OFFSETS = 0x07,
    TAG_BP_MORE = 0x08,
    TAG_BP_HOW = 0x09,
    TAG_BP_SERIAL = 0x0A,
    TAG_BP_DISTANCE = 0x0B,
    TAG_BP_SIZE = 0x0C,
    TAG_BP_DATA = 0x0D,
};

/* Inputs and outputs; what is in them is our own. */
enum {
    SRV_IO_SCAN = 1,
    SRV_IO_IDENTIFY = 2,
    SRV_IO_LIST = 0x70,            /* own */
    SRV_IO_READ_PARAMETER = 0x71,  /* own */
    SRV_IO_WRITE_PARAMETER = 0x72, /* own */
    TAG_IO_CONNECTOR = 0x02,
    TAG_IO_PARAMETER = 0x03,
    TAG_IO_START = 0x04,
    TAG_IO_RESULT = 0x05,
    TAG_IO_DATA = 0x06,
    TAG_IO_ENTRY = 0x82,
    TAG_IO_STATE = 0x07,
    TAG_IO_NAME = 0x08,
    TAG_IO_DRIVER = 0x09,
    TAG_IO_MODULE = 0x0A,
};

/* Users; what is in them is our own (4.14). */
enum {
    SRV_USER_SET_CREDENTIALS = 0x0C,
    TAG_USER_VERIFIER = 0x60,
};

/* A password (own; docs/security.md). */
enum {
    PASSWORD_MIN_ITERATIONS = 4096,
    PASSWORD_MAX_ITERATIONS = 10000000,
    PASSWORD_PAUSE_MS = 600, /* after a wrong proof its channel has to wait for so long; less than CHANNEL_SETTLE_MS */
};

/* Log (4.10). */
enum {
    SRV_LOG_GET_ENTRIES = 1,
    SRV_LOG_GET_COMPONENT = 2,
    SRV_LOG_GET_LOGGERS = 3,
    TAG_LOG_NAME = 0x01,
    TAG_LOG_START_HANDLE = 0x02,
    TAG_LOG_COUNT = 0x04,
    TAG_LOG_RECORD = 0x82,
    TAG_LOG_HANDLE = 0x01,
    TAG_LOG_TIME_NS = 0x08,
    TAG_LOG_ENTRY = 0x03,
    TAG_LOG_TEXT = 0x04,
    TAG_LOG_COMPONENT_NAME = 0x05,
    TAG_LOG_CLOCK = 0x13, /* own, as the following */
    TAG_LOG_UTC_NS = 0x14,
    TAG_LOG_START = 0x15,
};

/* Files (4.12): "upload" goes to the client, "download" to the device. */
enum {
    SRV_FILE_INFO = 1,
    SRV_FILE_START_DOWNLOAD = 2,
    SRV_FILE_DOWNLOAD = 4,
    SRV_FILE_START_UPLOAD = 5,
    SRV_FILE_UPLOAD = 7,
    SRV_FILE_END = 8,
    SRV_FILE_CANCEL = 9,
    SRV_FILE_DIRECTORY = 0x0C,
    SRV_FILE_DELETE = 0x0E,
    TAG_FILE_NAME = 0x01,
    TAG_FILE_CONTENT = 0x02,
    TAG_FILE_HANDLE = 0x03,
    TAG_FILE_POSITION = 0x05,
    TAG_FILE_COUNT = 0x06,
    TAG_FILE_END = 0x07,
    TAG_FILE_RESULT = 0x08,
    TAG_FILE_PATH = 0x0B,
    TAG_FILE_ENTRY_NAME = 0x0E,
    TAG_FILE_ENTRY_CONTENT = 0x0F,
    TAG_FILE_ENTRY_FIXED = 0x60, /* own */
    TAG_FILE_ROOM = 0x60,        /* own */
    TAG_FILE_START = 0x61,       /* own */
    TAG_FILE_DESCRIPTION = 0x81,
    TAG_FILE_STARTED = 0x84,
    TAG_FILE_LIST = 0x8D,
    TAG_FILE_ENTRY = 0x90,
    FILE_NAME_MAX = 32, /* characters */
};

/* PLC shell (4.15). */
enum {
    SRV_SHELL_EXECUTE = 1,
    SRV_SHELL_CANCEL = 2,
    TAG_SHELL_COMMAND = 0x10,
    TAG_SHELL_SESSION = 0x11,
    TAG_SHELL_ARGUMENTS = 0x12,
    TAG_SHELL_BLOCK = 0x13,
    TAG_SHELL_PART = 0x81, /* more follow */
    TAG_SHELL_LAST = 0x82,
    TAG_SHELL_TEXT = 0x20,
    TAG_SHELL_RESULT = 0x21, /* u16, of a command that is refused; ours */
    SHELL_MAX_COMMAND = 33,  /* bytes, with NUL */
};

#endif
