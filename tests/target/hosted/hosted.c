/*
 * hosted.c - what the simulator takes from an operating system, for the C tests that run on a processor without one.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exceptions are those that code raises itself: what the processor catches has its own tests (test_except.c).
 */
#include <malloc.h>
#include <setjmp.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

#include "Sim.h"
#include "SysExcept.h"
#include "sim_port.h"

static struct {
    jmp_buf *jump;
    RTS_EXCEPTION exception;
} except;

int SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    jmp_buf jump;

    except.exception.code = RTSEXCPT_NOEXCEPTION;
    if (setjmp(jump) == 0) {
        except.jump = &jump;
        fn(arg);
    }
    except.jump = NULL;
    *exception = except.exception;
    return exception->code != RTSEXCPT_NOEXCEPTION;
}

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UNUSED(stack);
    if (except.jump == NULL)
        abort();
    except.exception.code = code;
    except.exception.address = address;
    longjmp(*except.jump, 1);
}

void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    RTS_UNUSED(arg);
    RTS_UNUSED(code);
}

void SysExceptShutdown(void)
{
}

void SimSuperviseStart(void)
{
}

void SimMutexLock(void)
{
}

void SimMutexUnlock(void)
{
}

void SimSetCycleLimit(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    RTS_UNUSED(clock);
    now->tv_sec = 0;
    now->tv_nsec = 0;
    return 0;
}

void *mmap(void *where, size_t size, int protection, int flags, int file, long offset)
{
    void *memory = memalign(16, size);

    RTS_UNUSED(where);
    RTS_UNUSED(protection);
    RTS_UNUSED(flags);
    RTS_UNUSED(file);
    RTS_UNUSED(offset);
    return memory != NULL ? memory : MAP_FAILED;
}

int mprotect(void *memory, size_t size, int protection)
{
    RTS_UNUSED(memory);
    RTS_UNUSED(size);
    RTS_UNUSED(protection);
    return 0;
}

int munmap(void *memory, size_t size)
{
    RTS_UNUSED(size);
    free(memory);
    return 0;
}
