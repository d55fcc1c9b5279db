/*
 * fuzz_mdns.c - any datagram as a message of multicast DNS.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The first byte chooses the sender: its lowest bit a port that is not that of multicast DNS, the next one this machine.
 */
#include <string.h>

#include "Mdns.h"
#include "fuzz.h"

enum { LEGACY = 1, OWN_HOST = 2, LEGACY_PORT = 50000 };

static const MDNS_DEVICE device = {.instance = "press 1",
                                   .host = "press-1",
                                   .ip = 0x7F000001,
                                   .port = 11740,
                                   .text = {"device=plcrt", "serial=1", "udp=1740"}};

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t queries[][64] = {
        "\0\0\0\0\0\0\1\0\0\0\0\0\0\6_plcrt\4_tcp\5local\0\0\14\0\1",
        "\1\0\1\0\0\0\1\0\0\0\0\0\0\7press-1\5local\0\0\1\0\1",
        "\0\0\0\0\0\0\1\0\1\0\0\0\0\6_plcrt\4_tcp\5local\0\0\14\0\1\300\14\0\14\0\1\0\0\x11\x94\0\12\7press 1\300\14",
    };
    static const uint8_t sizes[] = {36, 32, 58};
    MDNS_DEVICE other = device;

    if (capacity < 1 + MDNS_REPLY_SIZE)
        return 0;
    data[0] = 0;
    other.port++;
    if (index < sizeof(sizes)) {
        memcpy(data, queries[index], sizes[index]);
        return sizes[index];
    }
    index -= (unsigned)sizeof(sizes);
    if (index == 0)
        return 1 + MdnsProbe(&other, data + 1);
    return index == 1 ? 1 + MdnsAnnounce(&other, false, data + 1) : 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    RTS_UI8 reply[MDNS_REPLY_SIZE];
    RTS_UI32 reply_size = 0;

    if (size < 1)
        return 0;
    RTS_UI16 port = (data[0] & LEGACY) != 0 ? LEGACY_PORT : MDNS_PORT;
    (void)MdnsFindClash(&device, data + 1, (RTS_UI32)size - 1, (data[0] & OWN_HOST) != 0);
    if (MdnsReply(&device, data + 1, (RTS_UI32)size - 1, port, reply, &reply_size) == MDNS_SILENCE)
        return 0;
    FUZZ_CHECK(reply_size > 12 && reply_size <= sizeof(reply));
    FUZZ_CHECK(MdnsFindClash(&device, reply, reply_size, false) == MDNS_NO_CLASH);
    return 0;
}
