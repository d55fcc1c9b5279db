/*
 * tag_sweep.h - every service of a group with an element of every tag, of many sizes, with and without a container.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef TAG_SWEEP_H
#define TAG_SWEEP_H

#include "comm_client.h"
#include "test.h"

enum { SWEEP_LAST_TAG = 0x90, SWEEP_LONG_CONTENT = 1000 };

/* An element of this tag and of `size` bytes, in a container if there is one. */
static inline void sweep_send(CLIENT *client, RTS_UI32 group, RTS_UI32 service, RTS_UI32 container, RTS_UI32 tag,
                              RTS_UI32 size, REPLY *answer)
{
    static RTS_UI8 content[SWEEP_LONG_CONTENT + 32];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    if (container != 0)
        BTagOpen(&writer, container, BTAG_ALIGN_0);
    BTagOpen(&writer, tag, BTAG_ALIGN_0);
    memset(BTagReserve(&writer, size), 0xFF, size);
    BTagClose(&writer);
    if (container != 0)
        BTagClose(&writer);
    CHECK(client_request(client, (RTS_UI16)group, (RTS_UI16)service, content, writer.size, answer));
}

/* All of that for the services that the group has; returns how many it has. Before each request `log_in` is called. */
static inline RTS_UI32 sweep_tags(CLIENT *client, RTS_UI32 group, void (*log_in)(void))
{
    static const RTS_UI32 containers[] = {0, 0x81, 0x82, 0x83};
    static const RTS_UI32 sizes[] = {0, 1, 2, 3, 4, 7, 8, 12, 16, 61, 255, SWEEP_LONG_CONTENT};
    static REPLY answer;
    RTS_UI32 services = 0;

    for (RTS_UI32 service = 1; service < L7_REPLY; service++)
        for (RTS_UI32 c = 0; c < RTS_COUNT(containers); c++) {
            sweep_send(client, group, service, containers[c], 0, 0, &answer);
            if (reply_error(&answer) == ERR_L7_UNKNOWNCMD)
                break;
            services += c == 0;
            for (RTS_UI32 tag = 0; tag <= SWEEP_LAST_TAG; tag++)
                for (RTS_UI32 s = 0; s < RTS_COUNT(sizes); s++) {
                    log_in();
                    sweep_send(client, group, service, containers[c], tag, sizes[s], &answer);
                }
        }
    return services;
}

#endif
