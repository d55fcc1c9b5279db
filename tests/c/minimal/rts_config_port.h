/*
 * rts_config_port.h - the sizes of the smallest firmware, for tests on the host.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#include "rts_config_size.h"

#endif
