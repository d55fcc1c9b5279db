/*
 * CanopenSetup.c - the networks, nodes and PDOs of CANopen that the configuration asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenSetup.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpIoMgrEmbedded.h"
#include "SysTime.h"

#if CANOPEN_MAX_DEVICES > 0

enum { DEFAULT_TIMEOUT_MS = 1000, MAX_MS = 60000, MAX_LIFE = 255, LEAST_SYNC_US = 500, MAX_US = 1000 * MAX_MS };

static RTS_UI32 number(const IoConfigConnector *connector, RTS_UI32 id, RTS_UI32 otherwise)
{
    RTS_RESULT result;
    const IoConfigParameter *parameter = IoMgrConfigGetParameter(connector, id);
    RTS_UI32 value = IoMgrConfigGetParameterValueDword(parameter, &result);

    return result == ERR_OK ? value : otherwise;
}

/* The bytes of a parameter; NULL: it is missing, or has none. */
static const RTS_UI8 *bytes(const IoConfigConnector *connector, RTS_UI32 id, RTS_UI32 *size)
{
    const IoConfigParameter *parameter = IoMgrConfigGetParameter(connector, id);

    *size = parameter != NULL ? parameter->bits / 8 : 0;
    return *size != 0 ? IoMgrConfigGetParameterValuePointer(parameter, NULL) : NULL;
}

static bool is_pdo_good(const CANOPEN_PDO *pdo)
{
    return pdo->cob > CANOPEN_SYNC && pdo->cob < 0x800 && pdo->size >= 1 && pdo->size <= CANOPEN_PDO_SIZE;
}

/* Returns where the identifier is in the list of inputs, or belongs. */
static RTS_UI32 place_of(const CANOPEN_LINE *line, RTS_UI32 cob)
{
    const RTS_UI32 *first = line->inputs;
    RTS_UI32 key = cob << CANOPEN_INPUT_COB;

    for (RTS_UI32 count = line->input_count; count > 0;) {
        RTS_UI32 half = count / 2;
        if (first[half] < key) {
            first += half + 1;
            count -= half + 1;
        } else {
            count = half;
        }
    }
    return (RTS_UI32)(first - line->inputs);
}

CANOPEN_PDO_STATE *CanopenFindInput(const CANOPEN_LINE *line, RTS_UI32 cob)
{
    RTS_UI32 place = place_of(line, cob);

    if (place == line->input_count || line->inputs[place] >> CANOPEN_INPUT_COB != cob)
        return NULL;
    return line->pdos + (line->inputs[place] & ((1u << CANOPEN_INPUT_COB) - 1));
}

static void add_input(CANOPEN_SETUP *setup, CANOPEN_LINE *line, RTS_UI32 cob)
{
    RTS_UI32 place = place_of(line, cob);

    memmove(line->inputs + place + 1, line->inputs + place, (line->input_count - place) * sizeof(*line->inputs));
    line->inputs[place] = cob << CANOPEN_INPUT_COB | setup->pdo_count;
    line->input_count++;
    setup->input_count++;
}

static RTS_RESULT add_pdo(CANOPEN_SETUP *setup, CANOPEN_LINE *line, CANOPEN_DEVICE *device, const CANOPEN_PDO *pdo)
{
    CANOPEN_PDO_STATE *state = &setup->pdos[setup->pdo_count];
    bool is_input = (pdo->flags & CANOPEN_PDO_OUTPUT) == 0;

    if (setup->pdo_count == CANOPEN_MAX_PDOS)
        return IoMgrConfigRefuse(device->connector, ERR_NOMEMORY, "this device has room for %u PDOs.",
                                 (unsigned)CANOPEN_MAX_PDOS);
    if (!is_pdo_good(pdo) || (is_input && CanopenFindInput(line, pdo->cob) != NULL))
        return IoMgrConfigRefuse(device->connector, ERR_PARAMETER, "PDO %u cannot have the identifier 0x%X.",
                                 (unsigned)device->pdo_count, (unsigned)pdo->cob);
    state->cob = pdo->cob & 0x7FFu;
    state->last = (pdo->size - 1u) & 7u;
    state->flags = pdo->flags & 3u;
    state->within_ms = is_input ? pdo->deadline_ms : pdo->event_ms;
    if (is_input)
        add_input(setup, line, pdo->cob);
    setup->pdo_count++;
    device->pdo_count++;
    return ERR_OK;
}

static RTS_RESULT add_pdos(CANOPEN_SETUP *setup, CANOPEN_LINE *line, CANOPEN_DEVICE *device)
{
    const CANOPEN_PDO *pdo;
    RTS_RESULT result = ERR_OK;
    RTS_UI32 before, size;

    device->pdos = setup->pdos + setup->pdo_count;
    do {
        before = device->pdo_count;
        pdo = (const CANOPEN_PDO *)bytes(device->connector, CANOPEN_PARAM_PDO + before, &size);
        if (pdo != NULL && size == sizeof(*pdo))
            result = add_pdo(setup, line, device, pdo);
    } while (result == ERR_OK && device->pdo_count != before);
    return result;
}

static RTS_RESULT describe(CANOPEN_NODE *node, const IoConfigConnector *connector)
{
    RTS_UI32 size;
    const RTS_UI8 *expected = bytes(connector, CANOPEN_PARAM_EXPECTED, &size);

    for (RTS_UI32 i = 0; i < EXPECTED_COUNT && expected != NULL && size == 4 * EXPECTED_COUNT; i++)
        node->expected[i] = BytesGet32(expected + 4 * i);
    node->heartbeat_ms = number(connector, CANOPEN_PARAM_HEARTBEAT, 0);
    node->guard_ms = number(connector, CANOPEN_PARAM_GUARD, 0);
    node->guard_life = number(connector, CANOPEN_PARAM_GUARD_LIFE, 1);
    node->config = bytes(connector, CANOPEN_PARAM_CONFIG, &node->config_size);
    if (node->config != NULL && !CanopenIsConfig(node->config, node->config_size))
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "its concise DCF is damaged.");
    return ERR_OK;
}

static RTS_RESULT add_device(CANOPEN_SETUP *setup, CANOPEN_LINE *line, const IoConfigConnector *connector)
{
    CANOPEN_DEVICE *device = &setup->devices[setup->device_count];
    RTS_UI32 node = number(connector, CANOPEN_PARAM_NODE, 0);

    if (setup->device_count == CANOPEN_MAX_DEVICES)
        return IoMgrConfigRefuse(connector, ERR_NOMEMORY, "this device has room for %u CANopen nodes.",
                                 (unsigned)CANOPEN_MAX_DEVICES);
    if (node < 1 || node > CANOPEN_MAX_NODE || node == line->own_node || line->by_node[node] != 0)
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "it cannot have the node number %u.", (unsigned)node);
    if (number(connector, CANOPEN_PARAM_TIMEOUT, DEFAULT_TIMEOUT_MS) - 1 >= MAX_MS ||
        number(connector, CANOPEN_PARAM_HEARTBEAT, 0) > MAX_MS || number(connector, CANOPEN_PARAM_GUARD, 0) > MAX_MS ||
        number(connector, CANOPEN_PARAM_GUARD_LIFE, 1) - 1 >= MAX_LIFE)
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "its time-out, heartbeat or guarding cannot be.");
    device->connector = connector;
    device->line = line;
    device->required = number(connector, CANOPEN_PARAM_REQUIRED, 0) != 0;
    device->on_lost = (RTS_UI8)number(connector, CANOPEN_PARAM_ON_LOST, CANOPEN_LOST_CONTINUE);
    device->node.node = (RTS_UI8)node;
    setup->device_count++;
    line->device_count++;
    line->by_node[node] = (RTS_UI8)line->device_count;
    RTS_RESULT result = describe(&device->node, connector);
    if (result == ERR_OK)
        result = add_pdos(setup, line, device);
    CanopenNodeBegin(&device->node, number(connector, CANOPEN_PARAM_TIMEOUT, DEFAULT_TIMEOUT_MS), SysTimeGetMs());
    return result;
}

static bool read_sync(CANOPEN_SYNC_STATE *sync, const IoConfigConnector *connector)
{
    sync->kind = number(connector, CANOPEN_PARAM_SYNC, CANOPEN_SYNC_NONE);
    sync->every_us = number(connector, CANOPEN_PARAM_SYNC_EVERY, 0);
    sync->window_us = number(connector, CANOPEN_PARAM_SYNC_WINDOW, 0);
    sync->last = (RTS_UI8)number(connector, CANOPEN_PARAM_SYNC_COUNTER, 0);
    sync->timer = sync->window_timer = sync->sync_event = sync->window_event = RTS_INVALID_HANDLE;
    return sync->every_us <= MAX_US && sync->window_us <= MAX_US &&
           (sync->kind != CANOPEN_SYNC_BY_TIMER || sync->every_us >= LEAST_SYNC_US);
}

static RTS_RESULT add_line(CANOPEN_SETUP *setup, const IO_DRIVER *driver, const IoConfigConnector *connector)
{
    RTS_UI32 network = number(connector, CANOPEN_PARAM_NETWORK, 0);
    RTS_UI32 index = IoMgrConfigGetIndex(connector);
    const IoConfigConnector *child;
    RTS_RESULT result = ERR_OK;

    if (network >= CAN_CONTROLLERS || network >= SysCanGetCount())
        return IoMgrConfigRefuse(connector, ERR_NO_OBJECT, "this device has no CAN network %u.", (unsigned)network);
    if (number(connector, CANOPEN_PARAM_NODE, 0) > CANOPEN_MAX_NODE ||
        number(connector, CANOPEN_PARAM_HEARTBEAT, 0) > MAX_MS)
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "its own node number or heartbeat cannot be.");
    CANOPEN_LINE *line = &setup->lines[network];
    if (line->connector != NULL)
        return IoMgrConfigRefuse(connector, ERR_DUPLICATE, "the CAN network %u is in use.", (unsigned)network);
    line->connector = connector;
    line->network = network;
    line->own_node = (RTS_UI8)number(connector, CANOPEN_PARAM_NODE, 0);
    line->heartbeat_ms = number(connector, CANOPEN_PARAM_HEARTBEAT, 0);
    line->time_ms = number(connector, CANOPEN_PARAM_TIME, 0);
    if (!read_sync(&line->sync, connector))
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "its SYNC cannot be.");
    line->devices = setup->devices + setup->device_count;
    line->pdos = setup->pdos;
    line->inputs = setup->inputs + setup->input_count;
    setup->line_count++;
    for (RTS_UI32 i = index + 1; result == ERR_OK && (child = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (child->parent == index && IoMgrConfigIsMine(child, driver))
            result = add_device(setup, line, child);
    }
    return result;
}

RTS_RESULT CanopenSetUp(CANOPEN_SETUP *setup, const IO_DRIVER *driver)
{
    const IoConfigConnector *connector;
    RTS_RESULT result = ERR_OK;

    memset(setup, 0, sizeof(*setup));
    for (RTS_UI32 i = 0; result == ERR_OK && (connector = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (connector->parent == IO_CONFIG_NONE && IoMgrConfigIsMine(connector, driver))
            result = add_line(setup, driver, connector);
    }
    return result;
}

#if ONLINE_CHANGE
/* The transfer of a concise DCF may be under way. */
static void follow_device(CANOPEN_DEVICE *device)
{
    device->connector = IoMgrConfigFollow(device->connector);
    device->node.config = IoMgrConfigFollow(device->node.config);
    device->node.sdo.out = IoMgrConfigFollow(device->node.sdo.out);
}

void CanopenSetupFollow(CANOPEN_SETUP *setup)
{
    RTS_UI32 i;

    for (i = 0; i < CAN_CONTROLLERS; i++)
        setup->lines[i].connector = IoMgrConfigFollow(setup->lines[i].connector);
    for (i = 0; i < setup->device_count; i++)
        follow_device(&setup->devices[i]);
}
#endif

CANOPEN_DEVICE *CanopenFindDevice(CANOPEN_SETUP *setup, const IoConfigConnector *connector)
{
    for (RTS_UI32 i = 0; i < setup->device_count; i++)
        if (setup->devices[i].connector == connector)
            return &setup->devices[i];
    return NULL;
}

CANOPEN_PDO_STATE *CanopenFindPdo(CANOPEN_SETUP *setup, const IoConfigConnector *connector, RTS_UI32 parameter)
{
    const CANOPEN_DEVICE *device = CanopenFindDevice(setup, connector);
    RTS_UI32 index = parameter - CANOPEN_PARAM_PDO;

    return device != NULL && index < device->pdo_count ? &device->pdos[index] : NULL;
}

#endif
