/*
 * TryCatch.c - rts_try on Armv7-M: leads exceptions to the rts_catch that is next.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Try.h"

#if RTS_STRUCTURED_EXCEPTION_HANDLING

#ifdef __ARM_FP
#define SAVE_FPU "vstm r0, {s16-s31}\n\t"
#define LOAD_FPU "vldm r0, {s16-s31}\n\t"
enum { SAVED_BY_TRY = (10 + 16) * 4 };
#else
#define SAVE_FPU ""
#define LOAD_FPU ""
enum { SAVED_BY_TRY = 10 * 4 };
#endif
RTS_STATIC_ASSERT(sizeof(RTS_JMP_BUF) >= SAVED_BY_TRY, buffer_holds_what_is_saved);

__attribute__((naked)) int SysExceptSetJmp(RTS_JMP_BUF buffer)
{
    RTS_UNUSED(buffer);
    __asm__ volatile("mov r1, sp\n\tstmia r0!, {r1, r4-r11, lr}\n\t" SAVE_FPU "movs r0, #0\n\tbx lr");
}

/* Goes on after it. */
__attribute__((naked, noreturn)) static void go_to_catch(const uintptr_t *buffer)
{
    RTS_UNUSED(buffer);
    __asm__ volatile("ldmia r0!, {r1, r4-r11, lr}\n\t" LOAD_FPU "mov sp, r1\n\tmovs r0, #1\n\tbx lr");
}

/* Places: the number of the exception that runs, 0 for main; above those the depth of a Try. */
enum { PLACE_IN_TRY = 0x200 };

static RTS_UI32 place_in_try(void)
{
    return PLACE_IN_TRY + (RTS_UI32)(TryState.top - TryState.tries);
}

/* C code that a program calls without a gate has no right to write the list. */
static bool may_catch_in_try(void)
{
#if RTS_IEC_UNPRIVILEGED
    return TryState.top[-1].gate != 0;
#else
    return true;
#endif
}

RTS_TRY **SysExceptTries(RTS_UI32 *place)
{
    if (!TryRuns()) {
        *place = CpuExceptionNumber();
        return &TryState.newest;
    }
    *place = place_in_try();
    return may_catch_in_try() ? &TryState.newest : NULL;
}

/* Registers of the FPU that wait to be saved are of what is left. */
static void forget_fpu(RTS_UI32 exc_return)
{
#ifdef __ARM_FP
    enum { FPCCR_LSPACT = 1 };
    if (!(exc_return & EXC_RETURN_BASIC))
        FPU_FPCCR &= ~(RTS_UI32)FPCCR_LSPACT;
#else
    RTS_UNUSED(exc_return);
#endif
}

/* Below what is live on the stack of rts_try. */
FRAME *TryFrameTo(const RTS_TRY *found, RTS_UI32 number, RTS_UI32 exc_return)
{
    FRAME *frame = (FRAME *)(found->buffer[0] & ~(uintptr_t)7) - 1;

    forget_fpu(exc_return);
    frame->r0 = (RTS_UI32)(uintptr_t)found->buffer;
    frame->pc = (RTS_UI32)(uintptr_t)go_to_catch & ~1u;
    frame->xpsr = XPSR_THUMB | number;
    __asm__ volatile("msr basepri, %0" ::"r"(0) : "memory");
    return frame;
}

RTS_UI32 TryCatchFault(RTS_UI32 code, uintptr_t address, const FRAME *frame, RTS_UI32 exc_return)
{
    RTS_TRY *found = NULL;

    if (may_catch_in_try() && !SysExceptIsCode(address))
        found = SysExceptCatch(&TryState.newest, place_in_try(), code, address, (uintptr_t)frame);
    if (found == NULL)
        return 0;
    TrySetProcessStack(TryFrameTo(found, 0, exc_return));
    return (RTS_UI32)EXC_RETURN_THREAD_PSP;
}

/* The same stack and rights. */
void TryCatchRaised(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UI32 place;
    RTS_TRY **list = SysExceptTries(&place);
    RTS_TRY *found = NULL;

    if (list != NULL && !SysExceptIsCode(address))
        found = SysExceptCatch(list, place, code, address, (uintptr_t)stack);
    if (found != NULL)
        go_to_catch(found->buffer);
}
#endif
