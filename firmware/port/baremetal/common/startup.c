/*
 * startup.c - from reset to main: memory, and everything in its order.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "BareMetal.h"
#include "SysTarget.h"

enum { STACK_PAINT = 0x5A, FRAME_MAX = 128 /* of ResetHandler */ };

/* Of the linker script. */
extern RTS_UI8 data_start[], data_end[], data_load[], bss_start[], bss_end[];

/* Of main, and of everything that interrupts it but application code. */
enum { MAIN_STACK_SIZE = RTS_MAIN_STACK_SIZE + CPU_CONTEXTS_SIZE + STACK_GUARD - STACK_GUARD_LEAST };
__attribute__((section(".noinit.main_stack"), aligned(STACK_GUARD), used)) static RTS_UI8 main_stack[MAIN_STACK_SIZE];

int main(void);

SYS_STACK SysTargetGetStack(void)
{
    SYS_STACK stack = {sizeof(main_stack) - STACK_GUARD, 0};
    while (main_stack[STACK_GUARD + stack.unused] == STACK_PAINT)
        stack.unused++;
    return stack;
}

void ResetHandler(void)
{
    CpuMask();
    memcpy(data_start, data_load, (size_t)(data_end - data_start));
    memset(bss_start, 0, (size_t)(bss_end - bss_start));
    memset(main_stack + STACK_GUARD, STACK_PAINT,
           (size_t)((RTS_UI8 *)__builtin_frame_address(0) - main_stack) - STACK_GUARD - FRAME_MAX);
    CpuInit();
    ResetInit();
    SysExceptInit();
    ClockInit();
    SysTimerInit();
    BoardInit();
    CpuRestore(0);
    main();
    ResetNow(RESET_SOFTWARE, 0);
}
