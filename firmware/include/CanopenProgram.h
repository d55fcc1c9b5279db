/*
 * CanopenProgram.h - the program of a CANopen device as objects of its dictionary: download, control, identification
 * (CiA 302-3: 1F50h to 1F57h). Shared with the host.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The image has their entries (CANOPEN_PROGRAM_OBJECT in CanopenObject.h); who owns the application has the functions.
 */
#ifndef CANOPENPROGRAM_H
#define CANOPENPROGRAM_H

#include "CmpStd.h"

/* place of an entry */
enum {
    PROGRAM_DATA = 0,           /* 1F50h:1, a DOMAIN: the image */
    PROGRAM_CONTROL = 1,        /* 1F51h:1, U8 */
    PROGRAM_IDENTIFICATION = 2, /* 1F56h:1, U32: CRC of the image that is loaded */
    PROGRAM_STATUS = 3,         /* 1F57h:1, U32: PROGRAM_ERROR << 1 */
    PROGRAM_REASON = 4,         /* 5FFFh:1, a string: why the image was refused */
    PROGRAM_OBJECTS = 5,
};

/* Commands of 1F51h; it reads 0 stopped, 1 started, 3 no program. */
enum { PROGRAM_STOP = 0, PROGRAM_START = 1, PROGRAM_RESET = 2, PROGRAM_CLEAR = 3 };

typedef enum {
    PROGRAM_OK = 0,
    PROGRAM_UNKNOWN_FORMAT = 2,
    PROGRAM_BAD_IMAGE = 3, /* format or CRC */
    PROGRAM_FLASH_FAULT = 5,
    PROGRAM_BAD_ADDRESS = 6, /* it is too large */
    PROGRAM_SECURED = 7,
} PROGRAM_ERROR;

#ifndef RTS_CFFI
/* Instead of an abort code: the owner replies to a command when it has been carried out. */
enum { CANOPEN_REPLIES_LATER = 1 };

/* From main. Functions return an abort code, 0: done. */
typedef struct {
    /* A download begins; `size` if the manager has said it. */
    RTS_UI32 (*begin)(bool has_size, RTS_UI32 size);
    RTS_UI32 (*write)(const RTS_UI8 *data, RTS_UI32 size);
    /* All bytes were written. */
    RTS_UI32 (*end)(void);
    RTS_UI32 (*control)(RTS_UI8 command);
    /* Reads an object with room for `*size` bytes, and sets it to those that there are. */
    void (*read)(RTS_UI32 place, RTS_UI8 *data, RTS_UI32 *size);
} CANOPEN_PROGRAM;
#endif

#endif
