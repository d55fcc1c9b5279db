/*
 * SysFlash.c - the flash of the Linux port: a file, with the rules of NOR flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Reading is a shared mapping of the file, writing goes through the file, so what was programmed is in the page cache
 * at once and survives the end of the process; sync makes it survive a power cut.
 */
#define _GNU_SOURCE
#include "SysFlash.h"

#include "CmpLog.h"
#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

enum { CODE_SLOTS = 2, ERASED = 0xFF };

static struct {
    int file;
    SYS_FLASH flash;
    RTS_UI8 *code[CODE_SLOTS];
} state = {.file = -1};

/* ---- the flash ---- */

static RTS_RESULT fault(const char *what, RTS_UI32 offset)
{
    LogAdd(CMPID_SysFlash, LOG_ERROR, ERR_DEVICE, "Flash: %s at offset %u", what, offset);
    return ERR_DEVICE;
}

static bool inside(RTS_UI32 offset, RTS_UI32 size)
{
    return size <= PORT_FLASH_SIZE && offset <= PORT_FLASH_SIZE - size;
}

static bool write_all(int file, const RTS_UI8 *data, size_t size, off_t offset)
{
    while (size > 0) {
        ssize_t done = pwrite(file, data, size, offset);
        if (done < 0 && errno != EINTR) {
            return false;
        }
        if (done > 0) {
            data += done;
            size -= (size_t)done;
            offset += done;
        }
    }
    return true;
}

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    if (!inside(offset, size)) {
        return fault("read outside", offset);
    }
    memcpy(data, state.flash.mapped + offset, size);
    return ERR_OK;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    if (!inside(offset, size)) {
        return fault("program outside", offset);
    }
    if (offset % PORT_FLASH_PROGRAM_SIZE != 0 || size % PORT_FLASH_PROGRAM_SIZE != 0) {
        return fault("program not aligned", offset);
    }
    for (RTS_UI32 i = 0; i < size; i++) {
        if (state.flash.mapped[offset + i] != ERASED) {
            return fault("programmed without erase", offset + i);
        }
    }
    return write_all(state.file, data, size, offset) ? ERR_OK : fault("write failed", offset);
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    RTS_UI8 sector[PORT_FLASH_SECTOR_SIZE];
    if (!inside(offset, PORT_FLASH_SECTOR_SIZE) || offset % PORT_FLASH_SECTOR_SIZE != 0) {
        return fault("erase of no sector", offset);
    }
    memset(sector, ERASED, sizeof(sector));
    return write_all(state.file, sector, sizeof(sector), offset) ? ERR_OK : fault("erase failed", offset);
}

static RTS_RESULT flash_sync(void)
{
    return fdatasync(state.file) == 0 ? ERR_OK : fault("sync failed", 0);
}

const SYS_FLASH *SysFlashGet(void)
{
    return &state.flash;
}

/* ---- code ---- */

const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    if (slot >= CODE_SLOTS || size > PORT_CODE_SIZE || !inside(offset, size)) {
        return NULL;
    }
    RTS_UI8 *code = state.code[slot];
    if (mprotect(code, PORT_CODE_SIZE, PROT_READ | PROT_WRITE) != 0) {
        return NULL;
    }
    memcpy(code, state.flash.mapped + offset, size);
    __builtin___clear_cache((char *)code, (char *)code + size);
    return mprotect(code, PORT_CODE_SIZE, PROT_READ | PROT_EXEC) == 0 ? code : NULL;
}

void SysFlashReleaseCode(RTS_UI32 slot)
{
    if (slot < CODE_SLOTS) {
        (void)mprotect(state.code[slot], PORT_CODE_SIZE, PROT_NONE);
    }
}

/* ---- opening the file ---- */

/* Brings a new file, or one whose creation was cut short, to full size with erased bytes. */
static bool fill_erased(int file, off_t from)
{
    RTS_UI8 block[PORT_FLASH_SECTOR_SIZE];
    memset(block, ERASED, sizeof(block));
    while (from < PORT_FLASH_SIZE) {
        size_t size = sizeof(block) - (size_t)from % sizeof(block);
        if (!write_all(file, block, size, from)) {
            return false;
        }
        from += (off_t)size;
    }
    return fsync(file) == 0;
}

static bool prepare_file(int file, const char *path, PORT_REASON *reason)
{
    struct stat info;
    if (flock(file, LOCK_EX | LOCK_NB) != 0) {
        PortReason(reason, "flash file %s is in use by another plcrt: end that one or name another file", path);
        return false;
    }
    if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode) || info.st_size > PORT_FLASH_SIZE) {
        PortReason(reason, "%s is not a flash file of plcrt (at most %d bytes): name another file", path,
                   PORT_FLASH_SIZE);
        return false;
    }
    if (!fill_erased(file, info.st_size)) {
        PortReason(reason, "cannot write flash file %s: %s", path, strerror(errno));
        return false;
    }
    return true;
}

static bool map_all(PORT_REASON *reason)
{
    state.flash.mapped = mmap(NULL, PORT_FLASH_SIZE, PROT_READ, MAP_SHARED, state.file, 0);
    bool good = state.flash.mapped != MAP_FAILED;
    for (int i = 0; i < CODE_SLOTS; i++) {
        state.code[i] = mmap(NULL, PORT_CODE_SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        good = good && state.code[i] != MAP_FAILED;
    }
    if (!good) {
        PortReason(reason, "not enough memory for the flash and the code: %s", strerror(errno));
    }
    return good;
}

bool PortFlashOpen(const char *path, PORT_REASON *reason)
{
    state.file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (state.file < 0) {
        PortReason(reason, "cannot open flash file %s: %s", path, strerror(errno));
        return false;
    }
    state.flash = (SYS_FLASH){
        .size = PORT_FLASH_SIZE,
        .sector_size = PORT_FLASH_SECTOR_SIZE,
        .program_size = PORT_FLASH_PROGRAM_SIZE,
        .erased = ERASED,
        .read = flash_read,
        .program = flash_program,
        .erase = flash_erase,
        .sync = flash_sync,
    };
    if (!prepare_file(state.file, path, reason) || !map_all(reason)) {
        PortFlashClose();
        return false;
    }
    return true;
}

void PortFlashClose(void)
{
    if (state.flash.mapped != NULL && state.flash.mapped != MAP_FAILED) {
        munmap((void *)(uintptr_t)state.flash.mapped, PORT_FLASH_SIZE);
    }
    for (int i = 0; i < CODE_SLOTS; i++) {
        if (state.code[i] != NULL && state.code[i] != MAP_FAILED) {
            munmap(state.code[i], PORT_CODE_SIZE);
        }
        state.code[i] = NULL;
    }
    state.flash.mapped = NULL;
    if (state.file >= 0) {
        close(state.file);
    }
    state.file = -1;
}
