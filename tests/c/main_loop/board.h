/* board.h - of the board that test_main_loop.c is. */
