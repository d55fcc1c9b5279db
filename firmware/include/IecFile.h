/*
 * IecFile.h - the files of a program: the blocks FILE.Open, FILE.Read .. of the library.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * They are those of FileStore.h, which tools read and write, too. A program has IEC_FILES of them open at a time, one for
 * writing: the store has one writer, a tool or the program. What a program writes takes the place of the previous file when
 * it closes it; a power cut, a reset and another program before that leave the previous one. It needs HAS_IecFile,
 * HAS_CmpAppCalls and HAS_CmpFileTransfer in cmp_list.c.
 */
#ifndef IECFILE_H
#define IECFILE_H

#include "CmpItf.h"
#include "rts_config.h"

/* What a call does; with its data, and the value and the handle that it takes. */
enum {
    IEC_FILE_OPEN = 1,      /* name; IEC_FILE_MODE_*; the result is a handle */
    IEC_FILE_CLOSE = 2,     /* handle */
    IEC_FILE_READ = 3,      /* handle, count; the result is how many bytes there are */
    IEC_FILE_WRITE = 4,     /* handle; all of the data */
    IEC_FILE_SET_POS = 5,   /* handle, position; of a file that is written forward only, while it is updated */
    IEC_FILE_GET_POS = 6,   /* handle */
    IEC_FILE_AT_END = 7,    /* handle; the result is 0 or 1 */
    IEC_FILE_DELETE = 8,    /* name */
    IEC_FILE_RENAME = 9,    /* name, NUL, new name */
    IEC_FILE_SIZE = 10,     /* name */
    IEC_FILE_OPEN_DIR = 11, /* path; "" is the folder of all */
    IEC_FILE_LIST = 12, /* handle; gives the next name in the folder, the result is the size; a folder ends with "/" */
    IEC_FILE_COPY = 13, /* name, NUL, new name; 1: in place of a file; the result is the size */
    IEC_FILE_CREATE_DIR = 14, /* path; 1: also the folders above it that are missing */
    IEC_FILE_DELETE_DIR = 15, /* path; 1: also if it is not empty */
    IEC_FILE_RENAME_DIR = 16, /* path, NUL, new path */
    IEC_FILE_IS_DIR = 17,     /* path; the result is 0 or 1 */
    IEC_FILE_OPEN_SIZE = 18,  /* handle */
};

/* The modes and errors of CODESYS' library CAA File; stdlib/files.st has them as FILE.MODE and FILE.ERROR. */
enum {
    IEC_FILE_MODE_WRITE = 0,
    IEC_FILE_MODE_READ = 1,
    IEC_FILE_MODE_APPEND = 3,
    IEC_FILE_MODE_APPEND_OR_CREATE = 5,
    IEC_FILE_MODE_UPDATE = 6, /* own: from the begin on, and what is not written over stays */
    IEC_FILE_MODE_UPDATE_OR_CREATE = 7,
};
enum {
    IEC_FILE_HANDLE_INVALID = 5103,
    IEC_FILE_NOT_EXIST = 5104,
    IEC_FILE_EXIST = 5105,
    IEC_FILE_NO_MORE_ENTRIES = 5106,
    IEC_FILE_NOT_EMPTY = 5107,
    IEC_FILE_READ_ONLY = 5108,
    IEC_FILE_WRONG_PARAMETER = 5109,
    IEC_FILE_UNKNOWN = 5110,    /* the flash has a fault */
    IEC_FILE_INCOMPLETE = 5111, /* no room for it */
    IEC_FILE_NOT_IMPLEMENTED = 5112,
    IEC_FILE_TOO_MANY = 5113, /* own: open files, or writers */
};

RTS_RESULT IecFile_Hook(CMP_HOOK hook);

#endif
