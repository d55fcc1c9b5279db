/*
 * SimBoards.c - the boards that plctool knows without their firmware.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimBoards.h"

/* Of the linker: the section of the facts (BoardFactsOwn.h). */
extern const BOARD_FACTS __start_board_facts[];
extern const BOARD_FACTS __stop_board_facts[];

const BOARD_FACTS *SimBoard(RTS_UI32 index)
{
    return index < (RTS_UI32)(__stop_board_facts - __start_board_facts) ? &__start_board_facts[index] : NULL;
}
