/*
 * SimBoards.h - the boards that plctool knows without their firmware (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMBOARDS_H
#define SIMBOARDS_H

#include "BoardFacts.h"

/* The facts of plcrt and of each board here in each of its configurations; NULL past the last one. */
const BOARD_FACTS *SimBoard(RTS_UI32 index);

#endif
