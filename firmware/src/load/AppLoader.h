/*
 * AppLoader.h - checks an application image and finds out what the runtime has to know about it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The loader trusts nothing it reads. It has no state and touches nothing that runs. From main only.
 */
#ifndef APPLOADER_H
#define APPLOADER_H

#include "AppLoaded.h"
#include "AppRefusal.h"
#include "CmpErrors.h"

/* Checks the image of `size` bytes in `file`, whose header names `crc`. On an error *refusal says why, and *image is
 * undefined but for its code: none when it is another image, or damaged. */
RTS_RESULT AppLoaderCheck(RTS_UI32 file, RTS_UI32 size, RTS_UI32 crc, APP_IMAGE *image, APP_REFUSAL *refusal);

/* The CRC of the image in `file`, of which only the header has been read; what that says of it becomes 0. */
RTS_RESULT AppLoaderCRC32(RTS_UI32 file, CDL_HEADER *header, RTS_UI32 *crc);

#endif
