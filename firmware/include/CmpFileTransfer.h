/*
 * CmpFileTransfer.h - the file services (group 8): what tools keep on the device (FileStore.h), its program, its log.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * codesys-v3-protocol 4.12; layouts in docs/protocol.md. A client has one file open for reading. One client at a time
 * writes one; what it has begun ends with its session. With FILE_STORE_FILES only.
 */
#ifndef CMPFILETRANSFER_H
#define CMPFILETRANSFER_H

#include "CmpItf.h"

RTS_RESULT CmpFileTransfer_Hook(CMP_HOOK hook);

#endif
