/*
 * PortDrivers.h - I/O drivers that a build adds to those of its port: none, unless the build has such a header of its
 * own, which comes first in the include path.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define PORT_DRIVERS(X)
