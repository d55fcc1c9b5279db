/*
 * comm_client.c - a client in C for the tests of the communication.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "comm_client.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "CmpChecksum.h"
#include "SimLink.h"

/* ---- layer 3 ---- */

RTS_UI32 client_packet(const CLIENT *client, RTS_UI8 service, const RTS_UI8 *payload, RTS_UI32 size, RTS_UI8 *packet)
{
    const RTS_UI8 header[CLIENT_HEADER_SIZE] = {
        0xC5, 0x6B, 0x40, service, 0, 0x11, 0, 1, (RTS_UI8)(client->address >> 8), (RTS_UI8)client->address, 0, 0};

    memcpy(packet, header, CLIENT_HEADER_SIZE);
    memcpy(packet + CLIENT_HEADER_SIZE, payload, size);
    return CLIENT_HEADER_SIZE + size;
}

void client_send_package(const CLIENT *client, const RTS_UI8 *package, RTS_UI32 size)
{
    RTS_UI8 packet[CLIENT_LONGEST];

    size = client_packet(client, ROUTER_SVC_CHANNEL, package, size, packet);
    if (client->link != NULL)
        client->link->send(client->link->instance, packet, size);
    else
        (void)SimLinkSend(packet, size);
}

static RTS_UI32 receive(const CLIENT *client, RTS_UI8 *packet, RTS_UI32 capacity)
{
    if (client->link != NULL)
        return client->link->receive(client->link->instance, packet, capacity);
    return SimLinkReceive(packet, capacity);
}

RTS_UI32 client_take(const CLIENT *client, RTS_UI8 *service, RTS_UI8 *payload)
{
    RTS_UI8 packet[BLK_MAX_SIZE];
    RTS_UI32 size = receive(client, packet, sizeof(packet));

    if (size < CLIENT_HEADER_SIZE || (packet[5] & 0x0F) != 1 || (packet[6] << 8 | packet[7]) != client->address)
        return 0;
    RTS_UI32 header = (8u + 2u * (packet[5] >> 4) + 3) & ~3u; /* with the device's address */
    if (size < header)
        return 0;
    if (service != NULL)
        *service = packet[3];
    memcpy(payload, packet + header, size - header);
    return size - header;
}

/* ---- layer 4 ---- */

RTS_UI32 client_room(const CLIENT *client)
{
    return (client->packet > BLK_MAX_SIZE ? client->packet : BLK_MAX_SIZE) - CLIENT_HEADER_SIZE;
}

void client_init(CLIENT *client, RTS_UI16 address)
{
    memset(client, 0, sizeof(*client));
    client->address = address;
    client->session = L7_SESSION_INITIAL;
}

void client_seal(RTS_UI8 *package, RTS_UI32 size)
{
    BytesPut16(package + 2, CHANNEL_VERSION);
    BytesPut32(package + 4, 0);
    BytesPut32(package + 4, CRC32Update(0, package, size));
}

void client_send_open(const CLIENT *client, RTS_UI32 request_id, RTS_UI32 buffer)
{
    RTS_UI8 package[sizeof(CHANNEL_OPEN_REQUEST)] = {CHANNEL_PKG_OPEN_REQ};

    BytesPut32(package + 8, request_id);
    BytesPut32(package + 12, buffer);
    package[16] = 2;
    BytesPut16(package + 18, client->packet);
    client_seal(package, sizeof(package));
    client_send_package(client, package, sizeof(package));
}

int client_take_open(CLIENT *client)
{
    RTS_UI8 package[BLK_MAX_SIZE];

    client->open_size = client_take(client, NULL, package);
    if (client->open_size < CLIENT_OLD_RESPONSE || package[0] != CHANNEL_PKG_OPEN_RESP)
        return -1;
    client->channel = BytesGet16(package + 14);
    client->limit = BytesGet32(package + 16);
    client->packet = client->open_size < sizeof(CHANNEL_OPEN_RESPONSE) ? 0 : BytesGet16(package + 22);
    client->sent = 0;
    client->received = 0;
    return BytesGet16(package + 12);
}

bool client_open(CLIENT *client)
{
    client_send_open(client, 7, NETSERVER_MESSAGE_SIZE);
    return client_take_open(client) == CHANNEL_OPEN_OK;
}

void client_send_close(const CLIENT *client)
{
    RTS_UI8 package[sizeof(CHANNEL_CLOSE)] = {CHANNEL_PKG_CLOSE_REQ};

    BytesPut16(package + 8, client->channel);
    client_seal(package, sizeof(package));
    client_send_package(client, package, sizeof(package));
}

void client_send_guess_and_close(const CLIENT *client)
{
    CLIENT wrong = *client;

    wrong.channel ^= 1;
    client_send_close(&wrong);
    client_send_close(client);
}

void client_send_block(const CLIENT *client, RTS_UI32 number, RTS_UI8 flags, const RTS_UI8 *message, RTS_UI32 length,
                       RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI8 package[CLIENT_LONGEST] = {CHANNEL_PKG_DATA, flags};
    RTS_UI32 header = sizeof(CHANNEL_DATA);

    BytesPut16(package + 2, client->channel);
    BytesPut32(package + 4, number);
    BytesPut32(package + 8, client->received);
    if (flags & CHANNEL_FLAG_FIRST) {
        BytesPut32(package + 12, length);
        BytesPut32(package + 16, CRC32Update(0, message, length));
        header = CHANNEL_FIRST_SIZE;
    }
    memcpy(package + header, message + offset, size);
    client_send_package(client, package, header + size);
}

void client_send_ack(const CLIENT *client, RTS_UI32 ack, RTS_UI8 flags)
{
    RTS_UI8 package[sizeof(CHANNEL_ACK)] = {CHANNEL_PKG_ACK, (RTS_UI8)(CHANNEL_FLAG_TO_SERVER | flags)};

    BytesPut16(package + 2, client->channel);
    BytesPut32(package + 4, ack);
    client_send_package(client, package, sizeof(package));
}

void client_send_message(CLIENT *client, const RTS_UI8 *message, RTS_UI32 size)
{
    RTS_UI8 flags = CHANNEL_FLAG_TO_SERVER | CHANNEL_FLAG_FIRST;
    RTS_UI32 offset = 0;

    do {
        RTS_UI32 room = client_room(client) - (flags & CHANNEL_FLAG_FIRST ? CHANNEL_FIRST_SIZE : sizeof(CHANNEL_DATA));
        RTS_UI32 part = size - offset < room ? size - offset : room;
        client_send_block(client, ++client->sent, flags, message, size, offset, part);
        flags = CHANNEL_FLAG_TO_SERVER;
        offset += part;
    } while (offset < size);
}

RTS_UI32 client_take_message(CLIENT *client, RTS_UI8 *message)
{
    RTS_UI8 package[BLK_MAX_SIZE];
    RTS_UI32 length = 0;
    RTS_UI32 crc = 0;
    RTS_UI32 fill = 0;

    do {
        RTS_UI32 header = sizeof(CHANNEL_DATA);
        RTS_UI32 size = client_take(client, NULL, package);
        if (size < header || package[0] != CHANNEL_PKG_DATA || BytesGet16(package + 2) != client->channel ||
            BytesGet32(package + 4) != client->received + 1)
            return 0;
        if (package[1] & CHANNEL_FLAG_FIRST) {
            length = BytesGet32(package + 12);
            crc = BytesGet32(package + 16);
            header = CHANNEL_FIRST_SIZE;
        }
        client->received++;
        if (size - header > length - fill)
            return 0;
        memcpy(message + fill, package + header, size - header);
        fill += size - header;
    } while (fill < length);
    return CRC32Update(0, message, length) == crc ? length : 0;
}

/* ---- layer 7 ---- */

RTS_UI32 client_message(const CLIENT *client, RTS_UI16 group, RTS_UI16 service, const RTS_UI8 *content, RTS_UI32 size,
                        RTS_UI8 *message)
{
    memset(message, 0, 20);
    BytesPut16(message, L7_PROTOCOL);
    BytesPut16(message + 2, L7_HEADER_LENGTH);
    BytesPut16(message + 4, group);
    BytesPut16(message + 6, service);
    BytesPut32(message + 8, client->session);
    BytesPut32(message + 12, size);
    if (size != 0)
        memcpy(message + 20, content, size);
    return 20 + size;
}

bool client_request(CLIENT *client, RTS_UI16 group, RTS_UI16 service, const RTS_UI8 *content, RTS_UI32 size,
                    REPLY *reply)
{
    RTS_UI8 message[NETSERVER_MESSAGE_SIZE];

    client_send_message(client, message, client_message(client, group, service, content, size, message));
    memset(reply, 0, sizeof(*reply));
    reply->size = client_take_message(client, reply->message);
    if (reply->size < 20 || BytesGet16(reply->message) != L7_PROTOCOL ||
        BytesGet16(reply->message + 4) != (group | L7_REPLY) || BytesGet16(reply->message + 6) != service ||
        BytesGet32(reply->message + 12) != reply->size - 20)
        return false;
    reply->session = BytesGet32(reply->message + 8);
    BTagReaderInit(&reply->tags, reply->message + 20, reply->size - 20);
    return true;
}

bool client_call(CLIENT *client, RTS_UI16 group, RTS_UI16 service, const BTAG_WRITER *content, REPLY *reply)
{
    return BTagIsComplete(content) && client_request(client, group, service, content->data, content->size, reply);
}

RTS_UI32 reply_number(const REPLY *reply, RTS_UI32 id)
{
    RTS_UI32 value = 0xFFFFFFFF;

    return BTagFindUnsigned(&reply->tags, id, &value) == ERR_OK ? value : 0xFFFFFFFF;
}

RTS_UI32 reply_error(const REPLY *reply)
{
    RTS_UI32 value = ERR_OK;

    (void)BTagFindOptional(&reply->tags, TAG_ERROR, &value);
    return value;
}

bool client_learn(CLIENT *client, const BTAG_READER *tags)
{
    BTAG_READER inner;
    BTAG option;

    if (BTagFindContainer(tags, TAG_DEV_LOGIN_REPLY, &inner) == ERR_OK)
        return BTagFindUnsigned(&inner, TAG_DEV_SESSION_ID, &client->session) == ERR_OK;
    if (BTagFindContainer(tags, TAG_APP_DESCRIPTOR, &inner) != ERR_OK ||
        BTagFind(&inner, TAG_APP_OPTION, sizeof(APP_LOGIN_REPLY), sizeof(APP_LOGIN_REPLY), &option) != ERR_OK)
        return false;
    client->app_session = BytesGet32(option.data + 2);
    return BytesGet16(option.data) == ERR_OK;
}

bool client_login(CLIENT *client)
{
    /* As third-party clients send it: type XOR as u16, user two zero bytes. */
    static const RTS_UI8 content[] = {0x22, 0x02, 0x01, 0x00, 0x81, 0x01, 0x04, 0x10, 0x02, 0x00, 0x00};
    REPLY reply;

    return client_request(client, SG_DEVICE, SRV_DEV_LOGIN, content, sizeof(content), &reply) &&
           client_learn(client, &reply.tags);
}

bool client_login_app(CLIENT *client)
{
    static const RTS_UI8 content[] = {0x01, 0x0B, 'A', 'p', 'p', 'l', 'i', 'c', 'a', 't', 'i', 'o', 'n'};
    REPLY reply;

    return client_request(client, SG_APPLICATION, SRV_APP_LOGIN, content, sizeof(content), &reply) &&
           client_learn(client, &reply.tags);
}

bool client_connect(CLIENT *client)
{
    client_init(client, 0x0102);
    return client_open(client) && client_login(client) && client_login_app(client);
}
