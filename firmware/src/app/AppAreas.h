/*
 * AppAreas.h - the RAM of the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPAREAS_H
#define APPAREAS_H

#include "CmpIecAbi.h"

/* Sets all areas to zero. */
void AppAreasClear(void);

/* Sets the outputs to zero. From any context. */
void AppAreasClearOutputs(void);

/* Enters the addresses of the RAM areas. */
void AppAreasSet(IEC_CONTEXT *context);

#endif
