/*
 * CompactDownload.h - the application image on disk, on the wire and in flash (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Layout of manual 2.3.1 and codesys-v3-protocol 5.1..5.4. All little-endian; table entries start at multiples of 4,
 * the code segment at a multiple of APP_CODE_ALIGN. What the field's format lacks (tasks) is in a typed blob.
 */
#ifndef COMPACTDOWNLOAD_H
#define COMPACTDOWNLOAD_H

#include "CmpStd.h"

enum {
    CDL_HEADER_TAG = 0x1234ABCD,
    CDL_HEADER_VERSION = 1,
    CDL_HEADER_SIZE = 104,
    CDL_CRC_OFFSET = 100,
    APP_CODE_ALIGN = 16,
    APP_POINTER_SIZE = 8, /* what a variable that is a pointer takes, on every target; the address comes first */
    APP_NAME_SIZE = 60,   /* of a name or string in an image that the runtime reads, with NUL */
};

/* What a blob begins with; no enum constant of C is so large. */
#ifdef RTS_CFFI
static const RTS_UI32 CDL_BLOB_MAGIC;
#else
#define CDL_BLOB_MAGIC 0xB70BC0DEu
#endif

/* Area indices. Code is position independent and holds the constants; the other areas are RAM owned by the runtime. */
enum {
    APP_AREA_DATA = 0,
    APP_AREA_RETAIN = 1,
    APP_AREA_INPUT = 2,
    APP_AREA_OUTPUT = 3,
    APP_AREA_MEMORY = 4,
    APP_AREA_CODE = 5,
    APP_AREA_COUNT = 6,
    APP_AREA_NONE = 0xFFFF,
};

/* Type flags of an area (5.3). */
enum {
    AREA_TYPE_DATA = 0x0001,
    AREA_TYPE_CONSTANT = 0x0002,
    AREA_TYPE_INPUT = 0x0004,
    AREA_TYPE_OUTPUT = 0x0008,
    AREA_TYPE_MEMORY = 0x0010,
    AREA_TYPE_RETAIN = 0x0020,
    AREA_TYPE_CODE = 0x0040,
    AREA_TYPE_PERSISTENT = 0x0100,
};

/* Offset and size in bytes from the start of the image; 0/0 when the segment is absent. */
typedef struct {
    RTS_UI32 offset;
    RTS_UI32 size;
} CDL_SEGMENT;

typedef struct {
    RTS_UI32 header_tag;
    RTS_UI32 header_version;
    RTS_UI32 header_size;
    RTS_UI32 total_size;
    RTS_UI32 device_type;
    RTS_UI32 device_id; /* vendor << 16 | device */
    RTS_UI32 device_version;
    RTS_UI32 flags; /* low word DLF_*, high word AF_* */
    RTS_UI32 compiler_version;
    RTS_UI32 code_area_size;
    RTS_UI16 code_area_index;
    RTS_UI16 code_area_flags;
    CDL_SEGMENT code;
    CDL_SEGMENT application_info;
    CDL_SEGMENT area_table;
    CDL_SEGMENT function_table;
    CDL_SEGMENT external_function_table;
    CDL_SEGMENT iec_function_table;
    CDL_SEGMENT blob; /* "source code" in the manual */
    RTS_UI32 crc;     /* CRC-32 (zlib) of the whole image with this word zero */
} CDL_HEADER;

/* Entry of the area table. */
typedef struct {
    RTS_UI32 size; /* bytes */
    RTS_UI16 index;
    RTS_UI16 type; /* AREA_TYPE_* */
} AREA_INFO;

/* Entry of the function table, in the order of CDL_FUNCTION_*; area APP_AREA_NONE when the function is absent. */
typedef struct {
    RTS_UI16 dummy;
    RTS_UI16 area;
    RTS_UI32 offset;
} POU_REF;

enum {
    CDL_FUNCTION_CODE_INIT = 0,
    CDL_FUNCTION_GLOBAL_INIT = 1,
    CDL_FUNCTION_GLOBAL_EXIT = 2,
    CDL_FUNCTION_RELOC = 3,
    CDL_FUNCTION_DOWNLOAD_CODE = 4,
    CDL_FUNCTION_TARGET_INFO = 5,
    CDL_FUNCTION_COUNT = 6,
};

/* Entry of the external function table, followed by the lower-case name and a NUL, padded to a multiple of 4. `offset`
 * is the byte offset of the function's slot in the import table (area APP_AREA_NONE: the import table belongs to the
 * loader). */
typedef struct {
    RTS_UI32 signature_id; /* CRC of the interface text */
    RTS_UI32 identifier;
    RTS_UI32 version; /* library version, major << 16 | minor */
    RTS_UI32 offset;
    RTS_UI16 area;
} EXT_REF_INFO;
enum { EXT_REF_INFO_SIZE = 18 }; /* on the wire: the name follows at once */

/* Entry of the IEC function table, followed by name, NUL and padding. `identifier`: the event on which the runtime calls it
 * as an IEC_ENTRY, EVT_* (AppEventIds.h); 0: none. */
typedef struct {
    RTS_UI16 dummy;
    RTS_UI16 area;
    RTS_UI32 offset;
    RTS_UI32 signature_id;
    RTS_UI32 identifier;
    RTS_UI32 version;
} FUNCTION_INFO;

/* Head of every blob; the payload follows, padded to a multiple of 4. */
typedef struct {
    RTS_UI32 magic;
    RTS_UI32 id;   /* CDL_BLOB_* */
    RTS_UI32 size; /* of the payload in bytes */
} CDL_BLOB;

enum {
    CDL_BLOB_TASKS = 1,   /* array of CDL_TASK */
    CDL_BLOB_RETAIN = 2,  /* what is kept: CDL_KEPT, some with a CDL_KEPT_RUN, in ascending order of their hashes */
    CDL_BLOB_EVENTS = 3,  /* names of the external events tasks wait for, each with NUL; for readers of the image */
    CDL_BLOB_CHANGE = 4,  /* a CDL_CHANGE: it can take the place of another image while that runs */
    CDL_BLOB_EXPORTS = 5, /* CDL_EXPORT, each with its name: what components in C find by name */
    CDL_BLOB_IMAGES = 16, /* CDL_IMAGE for inputs and outputs of each task; those it lacks work on the shared areas */
};

/* A runtime that does not know a blob from CDL_BLOB_REQUIRED on refuses the image: the application would not do without
 * it. CDL_BLOB_IO: the I/O configuration, an IO_CONFIG_PLACE (IoConfig.h). */
#ifdef RTS_CFFI
static const RTS_UI32 CDL_BLOB_REQUIRED;
static const RTS_UI32 CDL_BLOB_IO;
#else
#define CDL_BLOB_REQUIRED 0x80000000u
#define CDL_BLOB_IO 0x80000001u
#endif

/* What a task uses of the inputs or of the outputs, in units of CDL_IMAGE_UNIT bytes, so that parts that do not overlap
 * have no word in common. count 0: nothing, or the task has to work on the shared area, because the program keeps
 * addresses in it. */
enum { CDL_IMAGE_UNIT = 8 };
enum {
    CDL_IMAGE_WRITTEN = 1, /* the task changes some of them */
    CDL_IMAGE_SHARED = 2,  /* another task uses some of them too */
};
typedef struct {
    RTS_UI16 first;
    RTS_UI16 count;
    RTS_UI32 flags; /* CDL_IMAGE_* */
} CDL_IMAGE;

enum { CDL_TASK_NAME_SIZE = 32, CDL_PRIORITY_LOWEST = 31 };

/* A runtime refuses an image with a kind that it does not know: KIND_LEVEL is newer than the others. */
enum { KIND_CYCLIC = 0, KIND_EVENT = 1, KIND_EXTERNAL = 2, KIND_FREEWHEELING = 3, KIND_LEVEL = 4 };

/* A task. `kind` is KIND_*. A KIND_EVENT task runs when the byte at `event_offset` of `event_area`, without
 * the bits `event_ignored`, was 0 and is so no more, a KIND_LEVEL task as long as it is not 0; a KIND_EXTERNAL task on the external event whose
 * name has the CRC-32 `event_offset`. */
typedef struct {
    RTS_UI32 interval_us; /* cyclic tasks */
    RTS_UI32 watchdog_us; /* 0: none */
    RTS_UI16 watchdog_sensitivity;
    RTS_UI8 priority; /* 0 highest .. CDL_PRIORITY_LOWEST */
    RTS_UI8 kind;
    RTS_UI32 entry_offset; /* of the task's code in the code segment */
    RTS_UI16 event_area;   /* event tasks; APP_AREA_NONE otherwise */
    RTS_UI8 event_ignored; /* the other bits of the byte, when the event is one of them */
    RTS_UI8 reserved;
    RTS_UI32 event_offset;
    char name[CDL_TASK_NAME_SIZE]; /* NUL-terminated */
} CDL_TASK;

/*
 * A variable that is kept, a member or an element of one: RETAIN, PERSISTENT. A changed program finds it again by the
 * hash, of its full name without the indices of CDL_KEPT_RUN, and of its type.
 */
enum { CDL_KEPT_HASH_SIZE = 8 };
typedef struct {
    RTS_UI8 hash[CDL_KEPT_HASH_SIZE];
    RTS_UI32 place; /* offset in the retain area << CDL_KEPT_OFFSET_SHIFT, and the bits below */
} CDL_KEPT;

enum {
    CDL_KEPT_SHAPE = 3,      /* log2 of its size in bytes, without CDL_KEPT_IS_RUN */
    CDL_KEPT_IS_RUN = 4,     /* a CDL_KEPT_RUN follows */
    CDL_KEPT_PERSISTENT = 8, /* kept over a cold reset and a download, too */
    CDL_KEPT_OFFSET_SHIFT = 4,
};

/* Elements of an array that are `stride` bytes apart, or members of them; a string is a run of one. */
typedef struct {
    RTS_UI16 size;   /* of an element, bytes */
    RTS_UI16 stride; /* at least `size` */
    RTS_UI32 count;
    RTS_I32 first; /* index of the first one in the program */
} CDL_KEPT_RUN;

/*
 * An online change (AppChange.h). The image takes the place of that with the CRC `base` between two cycles. Variables that
 * both have are at the same places, or steps at `offset` of the code move them; then `init` is called.
 */
typedef struct {
    RTS_UI32 base;
    RTS_UI32 init;   /* an IEC_ENTRY: calculated initial values of new variables; CDL_CHANGE_NO_INIT: none */
    RTS_UI32 offset; /* of the steps, a multiple of 4 */
    RTS_UI32 size;   /* of all, bytes */
} CDL_CHANGE;

#ifdef RTS_CFFI
static const RTS_UI32 CDL_CHANGE_NO_INIT;
#else
#define CDL_CHANGE_NO_INIT 0xFFFFFFFFu
#endif

/* Kinds of steps, each for `size` bytes. The new ones are at `to` of `area`, those of the image that ran at `from` of `from_area`.
 * First come the steps with kinds up to CDL_CHANGE_GONE, in ascending order of `from_area` and `from`, none over another:
 * they say where pointers lead on. What is moved has another place than all that the old image has. An instance and its
 * first member begin at the same place, and may move to different ones: CDL_CHANGE_OBJECTS in the `from_area` of a
 * CDL_CHANGE_FOLLOW is for pointers to instances only, which have it in `area`. */
enum {
    CDL_CHANGE_MOVE = 0,   /* they are copied, and pointers to them lead to the copy */
    CDL_CHANGE_FOLLOW = 1, /* pointers to them lead to the new ones */
    CDL_CHANGE_GONE = 2,   /* no pointer may lead there */
    CDL_CHANGE_LEAD = 3,   /* pointers of the old image, in distances of `to` bytes */
    CDL_CHANGE_FORGET = 4, /* the same; those that lead to what is gone become 0 */
    CDL_CHANGE_COPY = 5,   /* they are copied */
    CDL_CHANGE_CLEAR = 6,
    CDL_CHANGE_PUT = 7,  /* they follow, padded to a multiple of 4 */
    CDL_CHANGE_SIGN = 8, /* they get the sign of the number before them */
    CDL_CHANGE_OBJECTS = 0x80,
};
typedef struct {
    RTS_UI32 to;
    RTS_UI32 size;
    RTS_UI32 from;
    RTS_UI8 kind; /* CDL_CHANGE_* */
    RTS_UI8 area;
    RTS_UI8 from_area;
    RTS_UI8 reserved;
} CDL_CHANGE_STEP;

/*
 * A function or variable of the program that components in C find by name (AppByName.h). NUL-terminated name and padding to
 * a multiple of 4 follow. `signature`: the CRC-32 of the layout of the `size` bytes at `offset` of `area`: of the variable,
 * or of the parameters and the result of the function, whose entry (an IEC_ENTRY) is at `entry` of the code.
 */
typedef struct {
    RTS_UI32 signature;
    RTS_UI32 entry; /* CDL_EXPORT_VARIABLE: a variable */
    RTS_UI32 offset;
    RTS_UI32 size;
    RTS_UI32 area;
} CDL_EXPORT;

#ifdef RTS_CFFI
static const RTS_UI32 CDL_EXPORT_VARIABLE;
#else
#define CDL_EXPORT_VARIABLE 0xFFFFFFFFu
#endif

/* Download flags (5.4), low word of CDL_HEADER.flags and of the download service. */
enum {
    DLF_CONTINUEDOWNLOAD = 1,
    DLF_USEBOOTAPPFROMDOWNLOAD = 2,
    DLF_WRITEBOOTAPPLICATION = 4,
    DLF_REPLYMAYWAIT = 0x100, /* own, of the service: the next block follows at once, and its reply will do for both */
    DLF_START = 0x200,        /* own, of the service: the application starts when its last block has installed it */
    DLF_CHANGE = 0x400,       /* own, of the service: an online change, or nothing */
    DLF_TRY = 0x800,          /* own, of the service: not the boot project until SRV_APP_CREATE_BOOTPROJECT */
};

/* Device identities that plctool compiles for. Vendor 0 is the open default; a vendor's own id comes from SysTarget. */
enum {
    TARGET_TYPE_PROGRAMMABLE = 0x1000,
    TARGET_ID_X86_64_LINUX = 0x9001,
    TARGET_ID_AARCH64_LINUX = 0x9002,
    TARGET_ID_CORTEX_M0 = 0x9003,
    TARGET_ID_CORTEX_M3 = 0x9004,
    TARGET_ID_CORTEX_M4F = 0x9005,
    TARGET_ID_CORTEX_M7 = 0x9006,
    TARGET_ID_RV32IMAC = 0x9007,
    TARGET_ID_ARMV7_LINUX = 0x9008,    /* Thumb-2, REAL in registers of the FPU */
    TARGET_ID_X86_64_WINDOWS = 0x9009, /* of the simulator: code as on Linux, C functions as on Windows */
};

#ifndef RTS_CFFI
RTS_STATIC_ASSERT(sizeof(CDL_HEADER) == CDL_HEADER_SIZE, cdl_header_is_104_bytes);
RTS_STATIC_ASSERT(sizeof(AREA_INFO) == 8, area_info_is_8_bytes);
RTS_STATIC_ASSERT(sizeof(POU_REF) == 8, pou_ref_is_8_bytes);
RTS_STATIC_ASSERT(sizeof(FUNCTION_INFO) == 20, function_info_is_20_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_TASK) == 56, cdl_task_is_56_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_KEPT) == 12, cdl_kept_is_12_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_KEPT_RUN) == 12, cdl_kept_run_is_12_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_IMAGE) == 8, cdl_image_is_8_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_CHANGE) == 16, cdl_change_is_16_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_EXPORT) == 20, cdl_export_is_20_bytes);
RTS_STATIC_ASSERT(sizeof(CDL_CHANGE_STEP) == 16, cdl_change_step_is_16_bytes);
#endif

#endif
