/*
 * SimModbus.c - the Modbus devices of the description, at the other end of simulated wires (SimWire.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * IoDrvModbus asks them as it asks real ones. A device has the coils and registers that the description names, and those
 * that were written to it, by the program or by SimModbusSet; it refuses to read others (MODBUS_ILLEGAL_ADDRESS). Of a
 * server, which this device is, a test is the client: its memory is written and read at once.
 */
#include "SimModbus.h"

#include <string.h>

#include "../../src/io/ModbusCalls.h"
#include "../../src/io/ModbusDriver.h"
#include "CmpIoMgrEmbedded.h"
#include "IoDrvModbus.h"
#include "IoDrvSim.h"
#include "SimTimes.h"
#include "SysTime.h"
#include "sim_port.h"

enum { VALUES = 0x20000 }; /* twice as many as the areas of a program have bits */
RTS_STATIC_ASSERT(2 * 8 * (APP_INPUT_SIZE + APP_OUTPUT_SIZE) <= VALUES, a_description_does_not_fill_the_table);

#define REPLY_NS ((RTS_I64)2000000) /* before a device replies, besides silence */

typedef struct {
    RTS_UI8 device; /* its number + 1; 0: the entry is free */
    RTS_UI8 table;  /* MODBUS_COILS, ... */
    RTS_UI16 address;
    RTS_UI16 value;
} SIM_VALUE;

RTS_STATIC_ASSERT(MODBUS_MAX_DEVICES < UINT8_MAX, numbers_of_devices_fit);

static SIM_VALUE values[VALUES];
static bool has_values;                                   /* any entry is used */
static RTS_UI32 faults[IO_MAX_CONNECTORS][IO_SIM_FAULTS]; /* by id - IO_SIM_ABSENT */

static MODBUS_SETUP *setup(void)
{
    return IoDrvModbusGetSetup();
}

/* ---- what devices hold ---- */

/* The entry of a coil or register, or the one that is free for it; NULL: there are VALUES others. */
static SIM_VALUE *find_value(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address)
{
    RTS_UI32 at = (device * 31u + table) * 997u + address;

    for (RTS_UI32 i = 0; i < VALUES; i++) {
        SIM_VALUE *value = &values[(at + i) % VALUES];
        if (value->device == 0 || (value->device == device + 1 && value->table == table && value->address == address))
            return value;
    }
    return NULL;
}

static bool set_value(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address, RTS_UI16 number)
{
    SIM_VALUE *value = find_value(device, table, address);

    if (value == NULL)
        return false;
    *value = (SIM_VALUE){(RTS_UI8)(device + 1), table, (RTS_UI16)address, number};
    has_values = true;
    return true;
}

static bool get_value(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address, RTS_UI16 *number)
{
    const SIM_VALUE *value = find_value(device, table, address);

    if (value == NULL || value->device == 0)
        return false;
    *number = value->value;
    return true;
}

static RTS_UI32 number_of(const MODBUS_DEVICE *device)
{
    return (RTS_UI32)(device - setup()->devices);
}

RTS_RESULT SimModbusSet(const char *device, RTS_UI32 table, RTS_UI32 address, RTS_UI32 number)
{
    for (RTS_UI32 i = 0; i < setup()->device_count; i++) {
        if (strcmp(IoMgrConfigGetName(setup()->noted[i].connector), device) != 0)
            continue;
        return set_value(i, (RTS_UI8)table, address, (RTS_UI16)number) ? ERR_OK : ERR_NOMEMORY;
    }
    return ERR_NO_OBJECT;
}

/* ---- requests ---- */

static RTS_UI16 masked(const MODBUS_REQUEST *request, RTS_UI32 device)
{
    RTS_UI16 keep = ModbusGet16(request->data);
    RTS_UI16 now = 0;

    (void)get_value(device, request->function->table, request->write_address, &now);
    return (RTS_UI16)((now & keep) | (ModbusGet16(request->data + 2) & ~keep));
}

static RTS_UI16 written(const MODBUS_REQUEST *request, RTS_UI32 device, RTS_UI32 i)
{
    if (request->function->function == MODBUS_WRITE_COIL)
        return ModbusGet16(request->data) != 0;
    if (request->function->function == MODBUS_MASK_WRITE_REGISTER)
        return masked(request, device);
    if (request->function->count_of_bits == 1)
        return request->data[i / 8] >> i % 8 & 1;
    return ModbusGet16(request->data + 2 * i);
}

static RTS_UI8 write_all(const MODBUS_REQUEST *request, RTS_UI32 device)
{
    for (RTS_UI32 i = 0; i < request->write_count; i++) {
        if (!set_value(device, request->function->table, request->write_address + i, written(request, device, i)))
            return MODBUS_DEVICE_FAILURE;
    }
    return 0;
}

static RTS_UI8 read_all(const MODBUS_REQUEST *request, RTS_UI32 device, RTS_UI8 *data)
{
    RTS_UI16 number;

    memset(data, 0, ModbusDataSize(request->function, request->read_count));
    for (RTS_UI32 i = 0; i < request->read_count; i++) {
        if (!get_value(device, request->function->table, request->read_address + i, &number))
            return MODBUS_ILLEGAL_ADDRESS;
        if (request->function->count_of_bits == 1)
            data[i / 8] |= (RTS_UI8)((number & 1) << i % 8);
        else
            ModbusPut16(data + 2 * i, number);
    }
    return 0;
}

static RTS_UI32 refuse(RTS_UI8 *pdu, RTS_UI8 exception)
{
    pdu[0] |= MODBUS_EXCEPTION;
    pdu[1] = exception;
    return 2;
}

/* What was written repeats the beginning of the request, or all of it. */
static RTS_UI32 end_reply(const MODBUS_REQUEST *request, RTS_UI8 *pdu)
{
    RTS_UI32 bytes = ModbusDataSize(request->function, request->read_count);

    if (request->read_count == 0)
        return request->function->function == MODBUS_MASK_WRITE_REGISTER ? 7 : 5;
    pdu[1] = (RTS_UI8)bytes;
    return 2 + bytes;
}

/* The reply of one device, in place of the request. */
static RTS_UI32 serve(RTS_UI32 device, RTS_UI8 *pdu, RTS_UI32 size)
{
    MODBUS_REQUEST request;
    RTS_UI8 exception = ModbusReadRequest(pdu, size, &request);

    if (exception == 0 && request.function->table == 0)
        exception = MODBUS_ILLEGAL_FUNCTION;
    if (exception == 0 && request.write_count != 0)
        exception = write_all(&request, device);
    if (exception == 0 && request.read_count != 0)
        exception = read_all(&request, device, pdu + 2);
    return exception != 0 ? refuse(pdu, exception) : end_reply(&request, pdu);
}

/* ---- faults ---- */

static RTS_UI32 *fault_of(const IoConfigConnector *connector, RTS_UI32 id)
{
    return &faults[IoMgrConfigGetIndex(connector)][id - IO_SIM_ABSENT];
}

static const IoConfigConnector *connector_of(const MODBUS_DEVICE *device)
{
    return setup()->noted[number_of(device)].connector;
}

static const MODBUS_CLIENT_LINE *line_of(RTS_HANDLE handle)
{
    for (RTS_UI32 i = 0; i < setup()->client_count; i++) {
        if (setup()->clients[i].client.link.handle == handle)
            return &setup()->clients[i];
    }
    return NULL;
}

static bool is_broadcast(const MODBUS_CLIENT_LINE *line, RTS_UI8 unit)
{
    return unit == MODBUS_BROADCAST && line->client.link.type->broadcasts;
}

static const MODBUS_DEVICE *device_at(const MODBUS_CLIENT_LINE *line, RTS_UI8 unit)
{
    for (RTS_UI32 i = 0; i < line->client.device_count; i++) {
        if (line->client.devices[i].unit == unit)
            return &line->client.devices[i];
    }
    return NULL;
}

static bool is_there(const MODBUS_DEVICE *device)
{
    return *fault_of(connector_of(device), IO_SIM_ABSENT) == 0;
}

/* How its next reply arrives, which is one of those that the faults count. */
static SIM_ARRIVAL next_arrival(const MODBUS_DEVICE *device)
{
    RTS_UI32 *damaged = fault_of(connector_of(device), IO_SIM_ANSWERS);
    RTS_UI32 *cut = fault_of(connector_of(device), IO_SIM_CUT);

    if (*damaged != 0) {
        --*damaged;
        return SIM_DAMAGED;
    }
    if (*cut == 0)
        return SIM_WHOLE;
    --*cut;
    return SIM_CUT;
}

/* Another device than the description says has none of its registers; it replies all the same. */
static RTS_UI32 reply_of(const MODBUS_DEVICE *device, RTS_UI8 *pdu, RTS_UI32 size, SIM_ARRIVAL *arrival)
{
    *arrival = next_arrival(device);
    return *fault_of(connector_of(device), IO_SIM_TYPE) != 0 ? refuse(pdu, MODBUS_ILLEGAL_ADDRESS)
                                                             : serve(number_of(device), pdu, size);
}

static void serve_all(const MODBUS_CLIENT_LINE *line, const RTS_UI8 *pdu, RTS_UI32 size)
{
    RTS_UI8 copy[MODBUS_MAX_PDU];

    for (RTS_UI32 i = 0; i < line->client.device_count; i++) {
        if (!is_there(&line->client.devices[i]))
            continue;
        memcpy(copy, pdu, size);
        (void)serve(number_of(&line->client.devices[i]), copy, size);
    }
}

/* ---- at the end of the wire ---- */

bool SimModbusIsPlugged(RTS_HANDLE handle)
{
    const MODBUS_CLIENT_LINE *line = line_of(handle);

    return line != NULL && *fault_of(line->noted.connector, IO_SIM_ABSENT) == 0;
}

bool SimModbusIsRtu(RTS_HANDLE handle)
{
    const MODBUS_CLIENT_LINE *line = line_of(handle);

    return line != NULL && line->client.link.type->broadcasts;
}

RTS_I64 SimModbusGetDelayNs(RTS_HANDLE handle, RTS_UI8 unit)
{
    const MODBUS_CLIENT_LINE *line = line_of(handle);
    const MODBUS_DEVICE *device = line != NULL ? device_at(line, unit) : NULL;

    if (line != NULL && is_broadcast(line, unit))
        return 0;
    if (device == NULL || !is_there(device))
        return -1;
    return REPLY_NS + *fault_of(connector_of(device), IO_SIM_LATE) * NS_PER_MS;
}

RTS_UI32 SimModbusReply(RTS_HANDLE handle, RTS_UI8 unit, RTS_UI8 *pdu, RTS_UI32 size, SIM_ARRIVAL *arrival)
{
    const MODBUS_CLIENT_LINE *line = line_of(handle);
    const MODBUS_DEVICE *device;

    if (line == NULL || size > MODBUS_MAX_PDU)
        return 0;
    if (is_broadcast(line, unit)) {
        serve_all(line, pdu, size);
        return 0;
    }
    device = device_at(line, unit);
    return device != NULL && is_there(device) ? reply_of(device, pdu, size, arrival) : 0;
}

/* ---- channels ---- */

/* What a place is in: the memory of a server, or coils or registers of a device. */
typedef struct {
    RTS_UI8 *memory;
    RTS_UI32 device;
    RTS_UI8 table;
    bool of_bits;
    RTS_UI32 reverse;
    RTS_UI32 address;
    RTS_UI32 bits;
} REGION;

static bool find_of_device(const MODBUS_DEVICE *device, const SIM_IO_PLACE *place, REGION *region)
{
    RTS_UI32 index = place->parameter - MODBUS_PARAM_JOB;
    const MODBUS_FUNCTION *function;
    const MODBUS_JOB *job;

    if (index >= device->job_count)
        return false;
    job = device->jobs[index].job;
    function = ModbusFindFunction(job->function);
    *region = (REGION){NULL,
                       number_of(device),
                       function->table,
                       function->count_of_bits == 1,
                       ModbusJobGetReverse(job, function),
                       place->is_output ? job->write_address : job->read_address,
                       (place->is_output ? job->write_count : job->read_count) * (RTS_UI32)function->count_of_bits};
    return true;
}

/* ERR_NOT_SUPPORTED: the connector is none of Modbus, or the parameter is none of channels. */
static RTS_RESULT find_region(const IoConfigConnector *connector, const SIM_IO_PLACE *place, REGION *region)
{
    const MODBUS_PLACE found = ModbusFindPlace(setup(), connector);

    memset(region, 0, sizeof(*region));
    if (found.device == NULL && found.server == NULL)
        return ERR_NOT_SUPPORTED;
    if (found.server != NULL)
        region->memory = ModbusFindMemory(&found, place->parameter, place->is_output, &region->bits);
    if (found.server != NULL ? region->memory == NULL : !find_of_device(found.device, place, region))
        return ERR_NOT_SUPPORTED;
    return place->bits <= region->bits && place->bit <= region->bits - place->bits ? ERR_OK : ERR_OUT_OF_LIMITS;
}

/* The address of the coil or register of a bit, in the order of MODBUS_JOB_REVERSE_2 .. for registers, and the bit
 * there. */
static RTS_UI32 address_of(const REGION *region, RTS_UI32 bit, RTS_UI32 *shift)
{
    RTS_UI32 byte = region->reverse != 0 ? bit / 8 ^ (region->reverse - 1) : bit / 8;

    *shift = region->of_bits ? 0 : (byte % 2 == 0 ? 8 : 0) + bit % 8;
    return region->address + (region->of_bits ? bit : byte / 2);
}

static bool get_bit(const REGION *region, RTS_UI32 bit)
{
    RTS_UI16 value = 0;
    RTS_UI32 shift;
    RTS_UI32 address = address_of(region, bit, &shift);

    if (region->memory != NULL)
        return (region->memory[bit / 8] >> bit % 8 & 1) != 0;
    (void)get_value(region->device, region->table, address, &value);
    return (value >> shift & 1) != 0;
}

static bool set_bit(const REGION *region, RTS_UI32 bit, bool on)
{
    RTS_UI16 value = 0;
    RTS_UI32 shift;
    RTS_UI32 address = address_of(region, bit, &shift);

    if (region->memory != NULL) {
        region->memory[bit / 8] = (RTS_UI8)((region->memory[bit / 8] & ~(1u << bit % 8)) | (unsigned)on << bit % 8);
        return true;
    }
    (void)get_value(region->device, region->table, address, &value);
    value = (RTS_UI16)((value & ~(1u << shift)) | (unsigned)on << shift);
    return set_value(region->device, region->table, address, value);
}

static RTS_RESULT set_region(const IoConfigConnector *connector, const REGION *region, const SIM_IO_PLACE *place,
                             const RTS_UI8 *data)
{
    RTS_RESULT result = ERR_OK;

    if (region->memory != NULL)
        IoDrvModbusFollowInputs();
    for (RTS_UI32 i = 0; result == ERR_OK && i < place->bits; i++) {
        if (!set_bit(region, place->bit + i, (data[i / 8] >> i % 8 & 1) != 0))
            result = ERR_NOMEMORY;
    }
    if (result == ERR_OK && region->memory != NULL) {
        ModbusFindPlace(setup(), connector).server->server.written++;
        IoMgrConfigNoteData(connector); /* for the next cycle, which may come before the next pass of main */
    }
    return result;
}

RTS_RESULT SimModbusSetPlace(const IoConfigConnector *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data)
{
    REGION region;
    RTS_RESULT result = find_region(connector, place, &region);

    return result == ERR_OK ? set_region(connector, &region, place, data) : result;
}

RTS_RESULT SimModbusGetPlace(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_UI8 *data)
{
    REGION region;
    RTS_RESULT result = find_region(connector, place, &region);

    if (result == ERR_OK)
        memset(data, 0, (place->bits + 7) / 8);
    for (RTS_UI32 i = 0; result == ERR_OK && i < place->bits; i++)
        data[i / 8] |= (RTS_UI8)(get_bit(&region, place->bit + i) << i % 8);
    return result;
}

static bool is_line(const IoConfigConnector *connector)
{
    for (RTS_UI32 i = 0; i < setup()->client_count; i++) {
        if (setup()->clients[i].noted.connector == connector)
            return true;
    }
    return false;
}

/* A line can only be pulled, which is that it is absent. A server here has no client that could fail. */
RTS_RESULT SimModbusFail(const IoConfigConnector *connector, RTS_UI32 fault, RTS_UI32 value)
{
    const MODBUS_PLACE place = ModbusFindPlace(setup(), connector);

    if (place.server != NULL)
        return ERR_NO_OBJECT;
    if (place.device == NULL && !is_line(connector))
        return ERR_NOT_SUPPORTED;
    if (fault - IO_SIM_ABSENT >= IO_SIM_FAULTS || (place.device == NULL && fault != IO_SIM_ABSENT))
        return ERR_NO_OBJECT;
    *fault_of(connector, fault) = value;
    return ERR_OK;
}

RTS_I64 SimModbusGetDueNs(RTS_I64 now_ns)
{
    RTS_I64 due_ns = NEVER;

    for (RTS_UI32 i = 0; i < setup()->client_count; i++) {
        RTS_I64 of_client = ModbusClientGetDueNs(&setup()->clients[i].client, now_ns);
        if (of_client < due_ns)
            due_ns = of_client;
    }
    return due_ns;
}

/* ---- configurations ---- */

static void add_zeros(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address, RTS_UI32 count)
{
    for (RTS_UI32 i = 0; i < count; i++)
        (void)set_value(device, table, address + i, 0);
}

void SimModbusForget(void)
{
    if (has_values)
        memset(values, 0, sizeof(values));
    has_values = false;
    memset(faults, 0, sizeof(faults));
}

void SimModbusMake(void)
{
    for (RTS_UI32 i = 0; i < setup()->device_count; i++) {
        const MODBUS_DEVICE *device = &setup()->devices[i];
        for (RTS_UI32 k = 0; k < device->job_count; k++) {
            const MODBUS_JOB *job = device->jobs[k].job;
            RTS_UI8 table = ModbusFindFunction(job->function)->table;
            add_zeros(i, table, job->read_address, job->read_count);
            add_zeros(i, table, job->write_address, job->write_count);
        }
    }
}

/* Elsewhere a pass comes before the next request of a tool; here virtual time may stand still. */
void SimModbusCancel(void)
{
    if (setup()->client_count != 0)
        ModbusCallsPoll(false, SysTimeGetNs());
}
