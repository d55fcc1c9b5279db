/*
 * IecCom.h - serial ports for programs: the blocks COM.Open, COM.Read .. of the library.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A program has IEC_COMS of them open at a time. They are closed when the program stops, fails, or ends. Which lines a
 * program may open, the port decides (SysComOpenProgram). Needs HAS_IecCom and HAS_CmpAppCalls in cmp_list.c; with IEC_COMS
 * 0 each call has the error IEC_COM_NO_PORT.
 */
#ifndef IECCOM_H
#define IECCOM_H

#include "CmpItf.h"
#include "rts_config.h"

/* Operations of a call. */
enum {
    IEC_COM_OPEN = 1,     /* handle: number of the port, from 1 on; value: baud | IEC_COM_*; the result is a handle */
    IEC_COM_CLOSE = 2,    /* handle */
    IEC_COM_READ = 3,     /* handle, `value` most bytes; the result is how many there are */
    IEC_COM_WRITE = 4,    /* handle; the result is how many bytes of the data were taken */
    IEC_COM_SETTINGS = 5, /* handle; value as of IEC_COM_OPEN; what has come before is lost */
};

/* In the upper bits of a baud rate. */
enum {
    IEC_COM_BAUD = 0x00FFFFFF,
    IEC_COM_PARITY_SHIFT = 24, /* SYSCOM_PARITY_* */
    IEC_COM_TWO_STOP_BITS = 1 << 26,
};

/* Errors of CODESYS' library CAA SerialCom; stdlib/serial.st has them as COM.ERROR. */
enum {
    IEC_COM_WRONG_PARAMETER = 5084, /* also one that the line cannot do */
    IEC_COM_WRONG_HANDLE = 5085,
    IEC_COM_NO_PORT = 5091, /* own: the program may open no port of this number */
    IEC_COM_IN_USE = 5092,  /* own */
};

RTS_RESULT IecCom_Hook(CMP_HOOK hook);

#endif
