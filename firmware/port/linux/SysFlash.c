/*
 * SysFlash.c - the flash of the Linux port: a file, with the rules of NOR flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * What was programmed is in the page cache at once and survives the end of the process; sync makes it survive a power
 * cut. The file is not mapped: a fault of the disk shall be an error that is returned, not a SIGBUS.
 */
#define _GNU_SOURCE
#include "SysFlash.h"

#include "CmpLog.h"
#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

enum { CODE_SLOTS = 2, ERASED = BOARD_FLASH_ERASED };

static struct {
    int file;
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
    return size <= BOARD_FLASH_SIZE && offset <= BOARD_FLASH_SIZE - size;
}

static bool read_all(int file, RTS_UI8 *data, size_t size, off_t offset)
{
    while (size > 0) {
        ssize_t done = pread(file, data, size, offset);
        if (done == 0) {
            errno = EIO; /* another process made the file shorter */
        }
        if (done == 0 || (done < 0 && errno != EINTR)) {
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
    return read_all(state.file, data, size, offset) ? ERR_OK : fault("read failed", offset);
}

static bool is_erased(int file, off_t from, off_t to)
{
    RTS_UI8 block[BOARD_FLASH_SECTOR_SIZE];
    for (; from < to; from += (off_t)sizeof(block)) {
        size_t size = to - from < (off_t)sizeof(block) ? (size_t)(to - from) : sizeof(block);
        if (!read_all(file, block, size, from)) {
            return false;
        }
        for (size_t i = 0; i < size; i++) {
            if (block[i] != ERASED) {
                return false;
            }
        }
    }
    return true;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    if (!inside(offset, size)) {
        return fault("program outside", offset);
    }
    if (offset % BOARD_FLASH_PROGRAM_SIZE != 0 || size % BOARD_FLASH_PROGRAM_SIZE != 0) {
        return fault("program not aligned", offset);
    }
    if (!is_erased(state.file, offset, (off_t)offset + size)) {
        return fault("programmed without erase", offset);
    }
    return write_all(state.file, data, size, offset) ? ERR_OK : fault("write failed", offset);
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    RTS_UI8 sector[BOARD_FLASH_SECTOR_SIZE];
    if (!inside(offset, BOARD_FLASH_SECTOR_SIZE) || offset % BOARD_FLASH_SECTOR_SIZE != 0) {
        return fault("erase inside a sector", offset);
    }
    memset(sector, ERASED, sizeof(sector));
    return write_all(state.file, sector, sizeof(sector), offset) ? ERR_OK : fault("erase failed", offset);
}

static RTS_RESULT flash_sync(void)
{
    return fdatasync(state.file) == 0 ? ERR_OK : fault("sync failed", 0);
}

/* Read-only memory, which no wild pointer changes. */
static const SYS_FLASH flash = {
    .size = BOARD_FLASH_SIZE,
    .sector_size = BOARD_FLASH_SECTOR_SIZE,
    .program_size = BOARD_FLASH_PROGRAM_SIZE,
    .erased = ERASED,
    .read = flash_read,
    .program = flash_program,
    .erase = flash_erase,
    .sync = flash_sync,
};

const SYS_FLASH *SysFlashGet(void)
{
    return &flash;
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
    if (flash_read(offset, code, size) != ERR_OK) {
        return NULL;
    }
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
    RTS_UI8 block[BOARD_FLASH_SECTOR_SIZE];
    memset(block, ERASED, sizeof(block));
    while (from < BOARD_FLASH_SIZE) {
        size_t size = sizeof(block) - (size_t)from % sizeof(block);
        if (!write_all(file, block, size, from)) {
            return false;
        }
        from += (off_t)size;
    }
    return fsync(file) == 0;
}

/* Makes the name of a new file survive a power cut. A folder that may not be read, or of a file system that has no such
 * thing, is left to the system. */
static bool sync_folder(const char *path)
{
    char folder[PATH_MAX];
    if (realpath(path, folder) == NULL) {
        return false;
    }
    strrchr(folder, '/')[1] = '\0';
    int entries = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    bool good = entries < 0 || fsync(entries) == 0 || errno == EINVAL;
    if (entries >= 0) {
        close(entries);
    }
    return good;
}

static bool lock_file(int file, const char *path, PORT_REASON *reason)
{
    if (flock(file, LOCK_EX | LOCK_NB) == 0) {
        return true;
    }
    if (errno == EWOULDBLOCK) {
        PortReason(reason, "flash file %s is in use by another plcrt: end that one or name another file", path);
        reason->busy = true;
    } else {
        PortReason(reason, "cannot lock flash file %s: %s", path, strerror(errno));
    }
    return false;
}

/* A flash file, or the beginning of one: other files are not overwritten. One of a plcrt without the store has the
 * programs alone. */
static bool is_flash_file(int file, off_t size)
{
    enum { PROGRAMS = BOARD_FLASH_SIZE - FILE_STORE_SIZE - LOG_KEEP_SIZE };

    return size == BOARD_FLASH_SIZE ||
           (size < BOARD_FLASH_SIZE && is_erased(file, size < PROGRAMS ? 0 : PROGRAMS, size));
}

static bool prepare_file(int file, const char *path, PORT_REASON *reason)
{
    struct stat info;
    if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) {
        PortReason(reason, "%s is not a flash file of plcrt: name another file", path);
        return false;
    }
    if (!is_flash_file(file, info.st_size)) {
        PortReason(
            reason,
            "%s is not a flash file of plcrt, or not all of one: it has %lld bytes and not %d; it is left as it is, "
            "put a copy of it in its place or name another file",
            path, (long long)info.st_size, BOARD_FLASH_SIZE);
        return false;
    }
    if (!fill_erased(file, lseek(file, 0, SEEK_END)) || !sync_folder(path)) {
        PortReason(reason, "cannot write flash file %s: %s", path, strerror(errno));
        return false;
    }
    return true;
}

static bool reserve_code(PORT_REASON *reason)
{
    for (int i = 0; i < CODE_SLOTS; i++) {
        void *code = mmap(NULL, PORT_CODE_SIZE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (code == MAP_FAILED) {
            PortReason(reason, "not enough memory for the code: %s", strerror(errno));
            return false;
        }
        state.code[i] = code;
    }
    return true;
}

static const char *advice(int error)
{
    bool no_write = error == EACCES || error == EPERM || error == EROFS;
    return no_write ? "; plcrt has to write it: give it the right to, or name a copy where it has" : "";
}

bool PortFlashOpen(const char *path, PORT_REASON *reason)
{
    state.file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR);
    if (state.file < 0) {
        PortReason(reason, "cannot open flash file %s: %s%s", path, strerror(errno), advice(errno));
        return false;
    }
    if (!lock_file(state.file, path, reason) || !prepare_file(state.file, path, reason) || !reserve_code(reason)) {
        PortFlashClose();
        return false;
    }
    return true;
}

bool PortFlashIsShared(void)
{
    struct stat info;
    return fstat(state.file, &info) == 0 && (info.st_mode & (S_IRWXG | S_IRWXO)) != 0;
}

void PortFlashClose(void)
{
    for (int i = 0; i < CODE_SLOTS; i++) {
        if (state.code[i] != NULL) {
            munmap(state.code[i], PORT_CODE_SIZE);
        }
        state.code[i] = NULL;
    }
    if (state.file >= 0) {
        close(state.file);
    }
    state.file = -1;
}
