/*
 * RetainFile.h - the retain variables as a file, to save them elsewhere and put them back.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The file is a head and the retain area as it was saved last. It fits the program that saved it, and the one that has
 * replaced that in an online change, as long as no other one has. From main, with
 * FILE_STORE_FILES.
 */
#ifndef RETAINFILE_H
#define RETAINFILE_H

#include "CmpErrors.h"
#include "FileStore.h"

#define FILE_NAME_RETAIN "Retain.bin"

/* Fills in size and CRC of the file as it is now. ERR_NO_OBJECT: the program keeps nothing, or there is none. */
RTS_RESULT RetainFileFind(FILE_ENTRY *entry);

/* ERR_NO_CONSISTENCY: they have been saved again since. */
RTS_RESULT RetainFileRead(const FILE_ENTRY *entry, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size);

/* Whether a file may be put now. ERR_CALL_AGAIN: the program runs; ERR_APP_NOT_LOADED: none that keeps values. */
RTS_RESULT RetainFileMayPut(void);

/* Puts the values of a file in the store back, all or none. Errors as RetainFileMayPut; ERR_CRC_FAILED: it is damaged, or
 * another kind of file; ERR_VERSION_MISMATCH: another program saved it; ERR_DEVICE. */
RTS_RESULT RetainFilePut(const FILE_ENTRY *file);

#endif
