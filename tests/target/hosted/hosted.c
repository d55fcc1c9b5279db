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

void SimSuperviseHold(bool hold)
{
    RTS_UNUSED(hold);
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
    void *memory;      /* NULL: free */
    unsigned mappings; /* that keep it, closed as it may be */
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
    files[file].mappings = 0;
    return files[file].memory != NULL ? 0 : -1;
}

int close(int file)
{
    RTS_UNUSED(file);
    return 0;
}

/* Whether memory is that of a file, which goes with the last mapping. */
static bool unmap_file(const void *memory)
{
    for (size_t i = 0; i < RTS_COUNT(files); i++) {
        if (files[i].memory != memory)
            continue;
        if (--files[i].mappings == 0) {
            free(files[i].memory);
            files[i].memory = NULL;
        }
        return true;
    }
    return false;
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
    if (file >= 0)
        files[file].mappings++;
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
    if (!unmap_file(memory))
        free(memory);
    return 0;
}
