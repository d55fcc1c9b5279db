/*
 * main.c - the communication loop.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

/*
 * Write here: what has to happen before the first component (clocks, memory, interrupts), the start of the hardware
 * watchdog, its kick in the loop, and sleeping (WFI) when the loop has nothing to do. When CMInit fails, say so by a
 * LED or a line of text and reset: it means a mistake in the port, such as a flash geometry that cannot be, and
 * CMGetFailure names the component.
 */
int main(void)
{
    if (CMInit() != ERR_OK)
        return 1;
    for (;;)
        (void)CMCallHook(CH_COMM_CYCLE);
}
