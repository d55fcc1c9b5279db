/*
 * SimCom.c - serial line 0 and the ports of programs: two queues of bytes each. All other lines are of field buses (SimBus).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Sim.h"
#include "SysCom.h"
#include "rts_config.h"
#include "sim_port.h"

typedef struct {
    RTS_UI8 data[SIM_COM_SIZE];
    RTS_UI32 first;
    RTS_UI32 count;
} QUEUE;

typedef struct {
    QUEUE to_device;
    QUEUE from_device;
    bool open;
} LINE;

enum { FIRST_PORT = 0x10000 }; /* past the lines of buses */

static LINE line;
static LINE ports[IEC_COMS];

static RTS_UI32 put(QUEUE *queue, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 i;

    for (i = 0; i < size && queue->count < SIM_COM_SIZE; i++)
        queue->data[(queue->first + queue->count++) % SIM_COM_SIZE] = data[i];
    return i;
}

static RTS_UI32 get(QUEUE *queue, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 i;

    for (i = 0; i < size && queue->count > 0; i++) {
        data[i] = queue->data[queue->first];
        queue->first = (queue->first + 1) % SIM_COM_SIZE;
        queue->count--;
    }
    return i;
}

void SimComPowerOn(void)
{
    line.to_device.count = 0;
    line.from_device.count = 0;
    line.open = false;
    for (RTS_UI32 i = 0; i < IEC_COMS; i++) {
        ports[i].to_device.count = 0;
        ports[i].from_device.count = 0;
        ports[i].open = false;
    }
}

/* ---- ports of programs ---- */

static LINE *find_port(RTS_UI32 index)
{
    return index >= FIRST_PORT && index - FIRST_PORT < IEC_COMS ? &ports[index - FIRST_PORT] : NULL;
}

/* What comes while the program has not opened it is lost. */
RTS_UI32 SimComPutPort(RTS_UI32 number, const RTS_UI8 *data, RTS_UI32 size)
{
    LINE *port = find_port(FIRST_PORT + number - 1);

    return port != NULL && port->open ? put(&port->to_device, data, size) : 0;
}

RTS_UI32 SimComGetPort(RTS_UI32 number, RTS_UI8 *data, RTS_UI32 size)
{
    LINE *port = find_port(FIRST_PORT + number - 1);

    return port != NULL ? get(&port->from_device, data, size) : 0;
}

RTS_RESULT SysComOpenProgram(RTS_UI32 number, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    LINE *port = number <= IEC_COMS ? find_port(FIRST_PORT + number - 1) : NULL;

    RTS_UNUSED(settings);
    if (port == NULL)
        return ERR_NO_OBJECT;
    if (port->open)
        return ERR_DUPLICATE;
    port->open = true;
    port->to_device.count = 0;
    *index = FIRST_PORT + number - 1;
    return ERR_OK;
}

/* ---- SysCom.h ---- */

RTS_UI32 SimComPut(const RTS_UI8 *data, RTS_UI32 size)
{
    return put(&line.to_device, data, size);
}

RTS_UI32 SimComGet(RTS_UI8 *data, RTS_UI32 size)
{
    return get(&line.from_device, data, size);
}

RTS_UI32 SysComGetCount(void)
{
    return 1;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    if (index != 0)
        return ERR_DEVICE;
    line.open = true;
    return ERR_OK;
}

static bool is_of_bus(RTS_UI32 index)
{
    return index != 0 && index < FIRST_PORT && SimBus != NULL;
}

void SysComClose(RTS_UI32 index)
{
    if (is_of_bus(index))
        SimBus->close(index);
    else if (index == 0)
        line.open = false;
    else if (find_port(index) != NULL)
        find_port(index)->open = false;
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    if (is_of_bus(index))
        return SimBus->read(index, data, size);
    if (find_port(index) != NULL)
        return get(&find_port(index)->to_device, data, size);
    return index == 0 && line.open ? get(&line.to_device, data, size) : 0;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    if (is_of_bus(index))
        return SimBus->write(index, data, size);
    if (find_port(index) != NULL)
        return put(&find_port(index)->from_device, data, size);
    return index == 0 && line.open ? put(&line.from_device, data, size) : 0;
}

RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    return SimBus != NULL ? SimBus->open(name, settings, index) : (RTS_RESULT)ERR_NO_OBJECT;
}

void SysComDiscard(RTS_UI32 index)
{
    if (is_of_bus(index))
        SimBus->discard(index);
}

RTS_I64 SysComGetByteNs(RTS_UI32 index)
{
    return is_of_bus(index) ? SimBus->byte_ns(index) : 0;
}
