/*
 * Mman.c - sys/mman.h, and memory at two addresses, on Windows' virtual memory.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <sys/mman.h>

#include "sim_port.h"

#include <windows.h>

static DWORD protection(int access)
{
    static const DWORD of[8] = {
        PAGE_NOACCESS, PAGE_READONLY,     PAGE_READWRITE,         PAGE_READWRITE,
        PAGE_EXECUTE,  PAGE_EXECUTE_READ, PAGE_EXECUTE_READWRITE, PAGE_EXECUTE_READWRITE,
    };
    return of[access & 7];
}

void *mmap(void *address, size_t size, int access, int flags, int file, long offset)
{
    (void)address, (void)flags, (void)file, (void)offset;
    DWORD kind = access == PROT_NONE ? MEM_RESERVE : MEM_RESERVE | MEM_COMMIT;
    void *memory = VirtualAlloc(NULL, size, kind, protection(access));
    return memory != NULL ? memory : MAP_FAILED;
}

/* What is only reserved gets its memory now. */
int mprotect(void *address, size_t size, int access)
{
    DWORD previous;
    if (VirtualProtect(address, size, protection(access), &previous)) {
        return 0;
    }
    return VirtualAlloc(address, size, MEM_COMMIT, protection(access)) != NULL ? 0 : -1;
}

int munmap(void *address, size_t size)
{
    (void)size;
    return UnmapViewOfFile(address) || VirtualFree(address, 0, MEM_RELEASE) ? 0 : -1;
}

bool SimMapTwice(RTS_UI32 size, RTS_UI8 **first, RTS_UI8 **second)
{
    HANDLE memory = CreateFileMappingA(INVALID_HANDLE_VALUE, NULL, PAGE_READWRITE, 0, size, NULL);
    if (memory == NULL) {
        return false;
    }
    *first = MapViewOfFile(memory, FILE_MAP_WRITE, 0, 0, size);
    *second = MapViewOfFile(memory, FILE_MAP_WRITE, 0, 0, size);
    CloseHandle(memory);
    return *first != NULL && *second != NULL;
}
