/*
 * node.c - a CANopen node on an adapter of CanHub that knows the lines of SLCAN only, as docs/canopen.md has them: it boots
 * and replies to SDO with its device type, 1000h.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * usage: node /dev/pts/5 NODE
 */
#define _DEFAULT_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

enum { DEVICE_TYPE = 0x00020192, NO_OBJECT = 0x06020000 };

static int line;

static void send(unsigned id, unsigned size, const unsigned char *data)
{
    char text[32];
    int at = sprintf(text, "t%03X%u", id, size);

    for (unsigned i = 0; i < size; i++)
        at += sprintf(text + at, "%02X", data[i]);
    text[at++] = '\r';
    if (write(line, text, (size_t)at) != at)
        exit(1);
}

static void put32(unsigned char *data, unsigned long value)
{
    for (int i = 0; i < 4; i++)
        data[i] = (unsigned char)(value >> 8 * i);
}

static void take(unsigned node, const char *text)
{
    unsigned id, size, byte;
    unsigned char data[8] = {0};

    if (sscanf(text, "t%3x%1u", &id, &size) != 2 || size > 8)
        return;
    for (unsigned i = 0; i < size && sscanf(text + 5 + 2 * i, "%2x", &byte) == 1; i++)
        data[i] = (unsigned char)byte;
    if (id != 0x600 + node || data[0] != 0x40)
        return;
    int is_type = data[1] == 0x00 && data[2] == 0x10 && data[3] == 0;
    data[0] = is_type ? 0x43 : 0x80;
    put32(data + 4, is_type ? DEVICE_TYPE : NO_OBJECT);
    send(0x580 + node, 8, data);
}

int main(int count, char **words)
{
    static const unsigned char boot_up[] = {0};
    struct termios mode;
    char text[64];
    size_t used = 0;

    if (count != 3 || (line = open(words[1], O_RDWR | O_NOCTTY)) < 0 || tcgetattr(line, &mode) != 0)
        return 1;
    unsigned node = (unsigned)atoi(words[2]);
    cfmakeraw(&mode);
    tcsetattr(line, TCSANOW, &mode);
    if (write(line, "S6\rO\r", 5) != 5)
        return 1;
    send(0x700 + node, 1, boot_up);
    while (used < sizeof(text) - 1 && read(line, text + used, 1) == 1) {
        if (text[used] != '\r') {
            used++;
            continue;
        }
        text[used] = '\0';
        take(node, text);
        used = 0;
    }
    return 0;
}
