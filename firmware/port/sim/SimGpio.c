/*
 * SimGpio.c - digital lines of the simulated board: DI0 .. DI7 and DO0 .. DO7, each in or out. Contract: SysGpio.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Python's simulator has IoDrvSim for all devices; this is for tests of IoDrvGpio.
 */
#include <string.h>

#include "SchedEvents.h"
#include "Sim.h"
#include "SysGpio.h"
#include "rts_config.h"

enum { LINES = 16 };
enum { IS_USED = 0x40000000 }; /* in options: a line without any may be used too */

typedef struct {
    bool level; /* high */
    bool is_taken;
    RTS_UI8 group;
    RTS_UI8 number;
    RTS_UI32 options;
    RTS_HANDLE event;
} LINE;

static struct {
    LINE line[LINES];
    bool is_gone; /* the chip */
} board;

static LINE *find(const char *name)
{
    RTS_UI32 number = (RTS_UI32)(name[0] == 'D' && name[1] != '\0' && name[2] != '\0' ? name[2] - '0' : LINES);

    if (number > 7 || name[3] != '\0' || (name[1] != 'I' && name[1] != 'O'))
        return NULL;
    return &board.line[(name[1] == 'O' ? 8 : 0) + number];
}

static bool is_of(const LINE *line, RTS_UI32 group)
{
    return line->options != 0 && line->group == group;
}

/* ---- what a test does ---- */

RTS_RESULT SimGpioSet(const char *name, int high)
{
    LINE *line = find(name);
    bool was;

    if (line == NULL)
        return ERR_NO_OBJECT;
    was = line->level;
    line->level = high != 0;
    if (was == line->level)
        return ERR_OK;
    was ^= (line->options & GPIO_OPTION_ACTIVE_LOW) != 0;
    if ((line->options & (was ? GPIO_OPTION_FALLING : GPIO_OPTION_RISING)) != 0)
        return SchedPostExternalEvent(line->event);
    return ERR_OK;
}

int SimGpioGet(const char *name)
{
    const LINE *line = find(name);

    return line != NULL ? line->level : -1;
}

RTS_RESULT SimGpioTake(const char *name, int taken)
{
    LINE *line = find(name);

    if (line == NULL)
        return ERR_NO_OBJECT;
    line->is_taken = taken != 0;
    return ERR_OK;
}

void SimGpioUnplug(int gone)
{
    board.is_gone = gone != 0;
}

/* ---- the contract ---- */

RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *what)
{
    LINE *line = find(what->name);

    if (line == NULL)
        return ERR_NO_OBJECT;
    if (line->is_taken || line->options != 0)
        return ERR_OPERATION_DENIED;
    if ((what->options & GPIO_OPTION_OUT) != 0 && what->name[1] == 'I')
        return ERR_NOT_SUPPORTED;
    line->group = (RTS_UI8)group;
    line->number = (RTS_UI8)number;
    line->options = what->options | IS_USED;
    line->event = what->event;
    return ERR_OK;
}

RTS_RESULT SysGpioOpen(RTS_UI32 group, RTS_UI32 outputs)
{
    RTS_UI32 mask = 0;
    RTS_UI32 i;

    for (i = 0; i < LINES; i++) {
        if (is_of(&board.line[i], group) && (board.line[i].options & GPIO_OPTION_OUT) != 0)
            mask |= 1u << board.line[i].number;
    }
    return SysGpioWrite(group, mask, outputs);
}

void SysGpioClose(RTS_UI32 group)
{
    RTS_UI32 i;

    for (i = 0; i < LINES; i++) {
        if (is_of(&board.line[i], group))
            board.line[i].options = 0;
    }
}

RTS_RESULT SysGpioPoll(RTS_UI32 group)
{
    RTS_UNUSED(group);
    return board.is_gone ? ERR_DEVICE : ERR_OK;
}

RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values)
{
    RTS_UI32 i;

    *values = 0;
    for (i = 0; i < LINES; i++) {
        const LINE *line = &board.line[i];
        bool low = (line->options & GPIO_OPTION_ACTIVE_LOW) != 0;
        if (is_of(line, group) && line->level != low)
            *values |= 1u << line->number;
    }
    return board.is_gone ? ERR_DEVICE : ERR_OK;
}

RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values)
{
    RTS_UI32 i;

    for (i = 0; i < LINES && !board.is_gone; i++) {
        LINE *line = &board.line[i];
        if (is_of(line, group) && (mask >> line->number & 1) != 0)
            line->level = ((values >> line->number & 1) != 0) != ((line->options & GPIO_OPTION_ACTIVE_LOW) != 0);
    }
    return board.is_gone ? ERR_DEVICE : ERR_OK;
}
