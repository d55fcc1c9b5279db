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
extern RTS_UI8 data_start[], data_end[], data_load[], bss_start[], bss_end[], stack_bottom[];

/* Of main, and of everything that interrupts it but application code. */
enum { MAIN_STACK_SIZE = RTS_MAIN_STACK_SIZE + CPU_CONTEXTS_SIZE + STACK_GUARD - STACK_GUARD_LEAST };
__attribute__((section(".noinit.main_stack"), aligned(STACK_GUARD), used)) static RTS_UI8 main_stack[MAIN_STACK_SIZE];

/* A large guard may be locked since before a reset (the PMP of QEMU 7.2). A small one is painted with the stack: where that
 * begins is an address that the program has anyway. */
enum { UNPAINTED = STACK_GUARD > STACK_GUARD_LEAST ? STACK_GUARD : 0 };

int main(void);

SYS_STACK SysTargetGetStack(void)
{
    SYS_STACK stack = {sizeof(main_stack) - STACK_GUARD, 0};
    while (main_stack[STACK_GUARD + stack.unused] == STACK_PAINT)
        stack.unused++;
    return stack;
}

bool SysTargetIsBoard(const char *name)
{
    return strcmp(name, SysTargetGet()->device_name) == 0;
}

void ResetHandler(void)
{
    RTS_UI8 *const lowest = stack_bottom + UNPAINTED;
    CpuMask();
    memcpy(data_start, data_load, (size_t)(data_end - data_start));
    memset(bss_start, 0, (size_t)(bss_end - bss_start));
    memset(lowest, STACK_PAINT, (size_t)((RTS_UI8 *)__builtin_frame_address(0) - lowest) - FRAME_MAX);
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
