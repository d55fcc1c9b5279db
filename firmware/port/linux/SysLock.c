/*
 * SysLock.c - the lock of the Linux port: a mutex that lends its holder the priority of the one that waits.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Without that, main or a slow task that holds it could be kept from the processor by tasks of middle priority, while a
 * fast one waits.
 */
#include "SysLock.h"

#include "CmpItf.h"

#include <pthread.h>

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;

RTS_UI32 SysLockEnter(void)
{
    pthread_mutex_lock(&mutex);
    return 0;
}

void SysLockLeave(RTS_UI32 before)
{
    RTS_UNUSED(before);
    pthread_mutex_unlock(&mutex);
}

static RTS_RESULT create(void)
{
    pthread_mutexattr_t attributes;
    int error = pthread_mutexattr_init(&attributes);
    if (error == 0) {
        error = pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    }
    if (error == 0) {
        error = pthread_mutex_init(&mutex, &attributes);
        pthread_mutexattr_destroy(&attributes);
    }
    return error == 0 ? ERR_OK : ERR_FAILED;
}

RTS_RESULT SysLock_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT_SYSTEM ? create() : ERR_OK;
}
