/*
 * AppIo.c - where the I/O manager registers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppIo.h"

#if IO_MAX_CONNECTORS > 0

static const APP_IO *manager;

void AppIoRegister(const APP_IO *io)
{
    manager = io;
}

const APP_IO *AppIoGet(void)
{
    return manager;
}

#endif
