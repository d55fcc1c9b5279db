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
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "Sim.h"
#include "SysExcept.h"
#include "SysMem.h"
#include "sim_port.h"

static struct {
    jmp_buf *jump;
    RTS_EXCEPTION exception;
} except;

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    jmp_buf jump;

    except.exception.code = RTSEXCPT_NOEXCEPTION;
    if (setjmp(jump) == 0) {
        except.jump = &jump;
        fn(arg);
    }
    except.jump = NULL;
    *exception = except.exception;
    return exception->code == RTSEXCPT_NOEXCEPTION;
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

/* The same at each call. */
void *SysMemAllocArea(size_t size)
{
    static void *area;

    if (area == NULL)
        area = memalign(16, size);
    return area;
}

/* There is no host here that could implement functions. */
RTS_RESULT SimFunctionsRegister(void)
{
    return ERR_OK;
}

void SimSetCycleLimit(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}

int nanosleep(const struct timespec *time, struct timespec *left)
{
    RTS_UNUSED(time);
    RTS_UNUSED(left);
    return 0;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    RTS_UNUSED(clock);
    now->tv_sec = 0;
    now->tv_nsec = 0;
    return 0;
}

/* ---- memory that has a file ---- */

static struct {
    void *memory; /* NULL: free */
    size_t size;
} files[4];

int memfd_create(const char *name, unsigned flags)
{
    int file = 0;

    RTS_UNUSED(name);
    RTS_UNUSED(flags);
    while (file < (int)RTS_COUNT(files) && files[file].memory != NULL)
        file++;
    return file < (int)RTS_COUNT(files) ? file : -1;
}

int ftruncate(int file, off_t size)
{
    files[file].memory = memalign(16, (size_t)size);
    files[file].size = (size_t)size;
    return files[file].memory != NULL ? 0 : -1;
}

ssize_t pwrite(int file, const void *data, size_t size, off_t offset)
{
    if (size > files[file].size || (size_t)offset > files[file].size - size)
        return -1;
    memcpy((char *)files[file].memory + offset, data, size);
    return (ssize_t)size;
}

int close(int file)
{
    free(files[file].memory);
    files[file].memory = NULL;
    return 0;
}

static bool has_file(const void *memory)
{
    bool found = false;

    for (size_t i = 0; i < RTS_COUNT(files); i++)
        found = found || files[i].memory == memory;
    return found;
}

void *mmap(void *where, size_t size, int protection, int flags, int file, long offset)
{
    void *memory = file >= 0 ? files[file].memory : memalign(16, size);

    RTS_UNUSED(where);
    RTS_UNUSED(protection);
    RTS_UNUSED(flags);
    RTS_UNUSED(offset);
    if (memory == NULL)
        return MAP_FAILED;
    return memset(memory, 0, size);
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
    if (!has_file(memory))
        free(memory);
    return 0;
}
