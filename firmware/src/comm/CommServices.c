/*
 * CommServices.c - which component takes which packets of the router.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpChannelServerEmbedded.h"
#include "CmpNameServiceServer.h"

#if COMM_ENDPOINTS
#define SERVICE(number, handler, needs, unreachable) {number, handler, needs, unreachable}
#else
#define SERVICE(number, handler, needs, unreachable) {number, handler}
#endif

const ROUTER_SERVICE RouterServices[] = {
    SERVICE(ROUTER_SVC_CHANNEL, ChannelHandlePackage, ChannelNeeds, ChannelUnreachable),
    SERVICE(ROUTER_SVC_NAME_REQUEST, NSHandleRequest, NULL, NULL),
};
const RTS_UI32 RouterServiceCount = RTS_COUNT(RouterServices);
