/*
 * SimLink.c - the in-process block driver.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimLink.h"

#include <string.h>

#include "CmpRouterEmbedded.h"
#include "Sim.h"

typedef struct {
    RTS_UI32 size;
    RTS_UI8 data[BLK_MAX_SIZE];
} PACKET;

static struct {
    PACKET packets[SIM_LINK_PACKETS];
    RTS_UI32 first;
    RTS_UI32 count;
} queue;

static RTS_RESULT sim_send(const ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count)
{
    RTS_UI32 size = 0;

    RTS_UNUSED(peer);
    for (RTS_UI32 i = 0; i < count; i++)
        size += parts[i].size;
    if (size > BLK_MAX_SIZE)
        return ERR_NET_MSGSIZE;
    if (queue.count == SIM_LINK_PACKETS)
        return ERR_NOBUFFER;
    PACKET *packet = &queue.packets[(queue.first + queue.count++) % SIM_LINK_PACKETS];
    packet->size = 0;
    for (RTS_UI32 i = 0; i < count; packet->size += parts[i++].size)
        memcpy(packet->data + packet->size, parts[i].data, parts[i].size);
    return ERR_OK;
}

static const BLK_DRV driver = {
    .type = BLK_DRV_TYPE_DIRECT,
    .point_to_point = 1,
    .address_words = 1,
    .address = {0, 1},
    .send = sim_send,
};

static void receive(void *arg)
{
    const BLK_PART *packet = arg;

    RouterHandleData(&driver, packet->data, packet->size);
}

RTS_RESULT SimLinkSend(const RTS_UI8 *packet, RTS_UI32 size)
{
    BLK_PART part = {packet, size};

    return size > BLK_MAX_SIZE ? ERR_NET_MSGSIZE : SimCall(receive, &part);
}

RTS_UI32 SimLinkReceive(RTS_UI8 *packet, RTS_UI32 capacity)
{
    if (queue.count == 0)
        return 0;
    PACKET *first = &queue.packets[queue.first];
    queue.first = (queue.first + 1) % SIM_LINK_PACKETS;
    queue.count--;
    if (first->size > capacity)
        return 0;
    memcpy(packet, first->data, first->size);
    return first->size;
}

void SimLinkReset(void)
{
    queue.first = 0;
    queue.count = 0;
}
