/*
 * CommServices.c - which component takes which packets of the router.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpChannelServerEmbedded.h"
#include "CmpNameServiceServer.h"

const ROUTER_SERVICE RouterServices[] = {
    {ROUTER_SVC_CHANNEL, ChannelHandlePackage},
    {ROUTER_SVC_NAME_REQUEST, NSHandleRequest},
};
const RTS_UI32 RouterServiceCount = RTS_COUNT(RouterServices);
