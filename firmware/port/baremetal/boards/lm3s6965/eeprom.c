/*
 * eeprom.c - SysFlash on a serial EEPROM (AT24C512 at I2C0 or I2C1), with the rules of NOR flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The chip's own flash can only be written while nothing runs from it. The EEPROM cannot be mapped: programs run in RAM
 * (CodeInRam.c). It needs no erase; a sector is what is filled with the erased value at once.
 */
#include "BareMetal.h"
#include "SysFlash.h"

/* A controller, and the pins of its port. */
typedef struct {
    uintptr_t i2c;
    uintptr_t port;
    RTS_UI32 pins;
} BUS;

static const BUS buses[] = {
    {0x40020000u, 0x40005000u, 3u << 2}, /* I2C0: PB2, PB3 */
    {0x40021000u, 0x40004000u, 3u << 6}, /* I2C1: PA6, PA7; where QEMU has the chip from version 10 on */
};
static const BUS *bus;

#define I2C_MSA REG32(bus->i2c + 0x00)
#define I2C_MCS REG32(bus->i2c + 0x04)
#define I2C_MDR REG32(bus->i2c + 0x08)
#define I2C_MTPR REG32(bus->i2c + 0x0C)
#define I2C_MCR REG32(bus->i2c + 0x20)
#define PORT_AFSEL REG32(bus->port + 0x420)
#define PORT_ODR REG32(bus->port + 0x50C)
#define PORT_DEN REG32(bus->port + 0x51C)

enum { MASTER_ENABLE = 1 << 4, PERIOD_400KHZ = BOARD_CLOCK_HZ / (20 * 400000) };
enum { RUN = 1, START = 2, STOP = 4, ACK = 8 }; /* written to MCS */
enum { BUSY = 1, ERROR = 2 };                   /* read from it */
enum { CHIP_WRITE = 0x50 << 1, CHIP_READ = CHIP_WRITE | 1, PAGE_SIZE = 128 };
enum { SECTOR_SIZE = BOARD_FLASH_SECTOR_SIZE, PROGRAM_SIZE = 4, ERASED = BOARD_FLASH_ERASED };
enum { BUSY_TRIES = 1000 };   /* a page takes 5 ms, a refused address 25 us */
enum { STEP_TRIES = 100000 }; /* some 10 ms, a byte takes 25 us: a bus whose clock is held low is never ready */

static bool step(RTS_UI32 what)
{
    RTS_UI32 tries = STEP_TRIES;

    I2C_MCS = what;
    while ((I2C_MCS & BUSY) != 0 && --tries != 0)
        ;
    return tries != 0 && (I2C_MCS & ERROR) == 0;
}

/* Sends the address of a byte. While it writes a page the chip answers to nothing. */
static bool select_byte(RTS_UI32 offset, RTS_UI32 then)
{
    I2C_MSA = CHIP_WRITE;
    for (RTS_UI32 i = 0; i < BUSY_TRIES; i++) {
        I2C_MDR = offset >> 8;
        if (step(START | RUN)) {
            I2C_MDR = offset & 0xFF;
            return step(RUN | then);
        }
        (void)step(STOP);
    }
    return false;
}

static bool is_inside(RTS_UI32 offset, RTS_UI32 size)
{
    return offset <= BOARD_FLASH_SIZE && size <= BOARD_FLASH_SIZE - offset;
}

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_UI8 *to = data;
    if (!is_inside(offset, size) || !select_byte(offset, STOP))
        return ERR_DEVICE;
    I2C_MSA = CHIP_READ;
    for (RTS_UI32 i = 0; i < size; i++) {
        if (!step(RUN | (i == 0 ? START : 0) | (i + 1 == size ? STOP : ACK)))
            return ERR_DEVICE;
        to[i] = (RTS_UI8)I2C_MDR;
    }
    return ERR_OK;
}

/* Writes within pages; the erased value when there is no data. */
static RTS_RESULT write(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    while (size > 0) {
        RTS_UI32 count = PAGE_SIZE - offset % PAGE_SIZE;
        if (count > size)
            count = size;
        if (!select_byte(offset, 0))
            return ERR_DEVICE;
        for (RTS_UI32 i = 0; i < count; i++) {
            I2C_MDR = data != NULL ? *data++ : ERASED;
            if (!step(RUN | (i + 1 == count ? STOP : 0)))
                return ERR_DEVICE;
        }
        offset += count;
        size -= count;
    }
    return ERR_OK;
}

static bool is_erased(RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI8 unit[PROGRAM_SIZE];
    for (RTS_UI32 end = offset + size; offset < end; offset += PROGRAM_SIZE) {
        if (flash_read(offset, unit, PROGRAM_SIZE) != ERR_OK)
            return false;
        for (RTS_UI32 i = 0; i < PROGRAM_SIZE; i++)
            if (unit[i] != ERASED)
                return false;
    }
    return true;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    if (!is_inside(offset, size) || offset % PROGRAM_SIZE || size % PROGRAM_SIZE || !is_erased(offset, size))
        return ERR_DEVICE;
    return write(offset, data, size);
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    return is_inside(offset, SECTOR_SIZE) && offset % SECTOR_SIZE == 0 ? write(offset, NULL, SECTOR_SIZE) : ERR_DEVICE;
}

/* The chip answers again when it has written the last page. */
static RTS_RESULT flash_sync(void)
{
    return select_byte(0, STOP) ? ERR_OK : ERR_DEVICE;
}

static void enable_bus(void)
{
    PORT_AFSEL |= bus->pins;
    PORT_ODR |= bus->pins;
    PORT_DEN |= bus->pins;
    I2C_MCR = MASTER_ENABLE;
    I2C_MTPR = PERIOD_400KHZ - 1;
}

/* Where no chip answers, what uses the flash says so. */
void EepromInit(void)
{
    bus = buses;
    enable_bus();
    if (flash_sync() != ERR_OK) {
        bus = &buses[1];
        enable_bus();
    }
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        .size = BOARD_FLASH_SIZE,
        .sector_size = SECTOR_SIZE,
        .program_size = PROGRAM_SIZE,
        .erased = ERASED,
        .mapped = NULL,
        .read = flash_read,
        .program = flash_program,
        .erase = flash_erase,
        .sync = flash_sync,
    };
    return &flash;
}
