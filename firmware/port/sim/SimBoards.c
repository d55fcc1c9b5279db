/*
 * SimBoards.c - the boards that plctool knows without their firmware.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimBoards.h"

/* Of the linker: the section of the facts (BoardFactsOwn.h). */
#ifdef __APPLE__
extern const BOARD_FACTS __start_board_facts[] __asm__("section$start$__DATA$board_facts");
extern const BOARD_FACTS __stop_board_facts[] __asm__("section$end$__DATA$board_facts");
#else
extern const BOARD_FACTS __start_board_facts[];
extern const BOARD_FACTS __stop_board_facts[];
#endif

const BOARD_FACTS *SimBoard(RTS_UI32 index)
{
    return index < (RTS_UI32)(__stop_board_facts - __start_board_facts) ? &__start_board_facts[index] : NULL;
}
