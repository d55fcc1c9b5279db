/*
 * board.h - of the board that test_main_loop.c is: it has nothing of its own.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
