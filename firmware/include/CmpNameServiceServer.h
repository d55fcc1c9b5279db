/*
 * CmpNameServiceServer.h - replies with the identity of this node (network scan). codesys-v3-protocol 2.6.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPNAMESERVICESERVER_H
#define CMPNAMESERVICESERVER_H

#include "CmpRouterEmbedded.h"

/* ROUTER_HANDLER of service ROUTER_SVC_NAME_REQUEST. */
void NSHandleRequest(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size);

RTS_RESULT CmpNameServiceServer_Hook(CMP_HOOK hook);

#endif
