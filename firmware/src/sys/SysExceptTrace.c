/*
 * SysExceptTrace.c - what the stack tells about an exception: the portable half of SysExcept.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Only words that may be return addresses are kept. The debugging information on the host says which of them are:
 * it has how much stack each function holds at each instruction: it costs the running program nothing.
 */
#include "SysExcept.h"

#include <string.h>

#include "SysAtomic.h"
#include "rts_config.h"

/* Set before code runs, and not changed while it does. */
static struct {
    uintptr_t start;
    RTS_UI32 size;
} code;

void SysExceptCodeRange(const RTS_UI8 *start, RTS_UI32 size)
{
    code.start = (uintptr_t)start;
    code.size = size;
}

bool SysExceptIsCode(uintptr_t address)
{
    return address - code.start < code.size;
}

RTS_UI32 SysExceptCodeOffset(uintptr_t address)
{
    return (RTS_UI32)(address - code.start);
}

/* The last byte of the call is code: what points to the start of the code is a function. */
bool SysExceptIsReturn(uintptr_t word)
{
    return (word & APP_ENTRY_MODE_BIT) == APP_ENTRY_MODE_BIT && SysExceptIsCode(word - APP_ENTRY_MODE_BIT - 1);
}

#if EXCEPT_MAX_CALLS > 0

static struct {
    RTS_UI32 claims;
    EXCEPT_TRACE trace;
#if EXCEPT_REGISTERS > 0
    RTS_UI32 register_claims;
    const uintptr_t *stack;           /* of the trace */
    const uintptr_t *registers_stack; /* the same, unless they are of another task's exception at this moment */
    EXCEPT_FRAME registers;
#endif
} state;

static void add_call(uintptr_t target, uintptr_t distance)
{
    EXCEPT_CALL *call = &state.trace.call[state.trace.count];

    if (!SysExceptIsReturn(target))
        return;
    call->target = (RTS_UI32)(target - APP_ENTRY_MODE_BIT - code.start);
    call->distance = (RTS_UI32)distance;
    state.trace.count++;
}

/* The stack is read whole, whatever a sanitizer thinks of the gaps between its variables. */
__attribute__((no_sanitize("address"))) void SysExceptTrace(uintptr_t address, const uintptr_t *stack,
                                                            const uintptr_t *end, uintptr_t link)
{
    const uintptr_t *word;

    if (SysAtomicAdd(&state.claims, 1) != 0)
        return;
    state.trace.address = address;
#if EXCEPT_REGISTERS > 0
    state.stack = stack;
#endif
    add_call(link, EXCEPT_LINK);
    for (word = stack; word < end && state.trace.count < EXCEPT_MAX_CALLS; word++)
        add_call(*word, (uintptr_t)word - (uintptr_t)stack);
}

const EXCEPT_TRACE *SysExceptGetTrace(void)
{
    return &state.trace;
}

#if EXCEPT_REGISTERS > 0

void SysExceptNoteRegisters(const uintptr_t *stack, RTS_UI32 kind, const uintptr_t values[EXCEPT_REGISTERS])
{
    if (SysAtomicAdd(&state.register_claims, 1) != 0)
        return;
    memcpy(state.registers.value, values, sizeof state.registers.value);
    state.registers.kind = kind;
    state.registers_stack = stack;
}

const EXCEPT_FRAME *SysExceptGetRegisters(void)
{
    static const EXCEPT_FRAME unknown;
    return state.stack == state.registers_stack ? &state.registers : &unknown;
}

#endif

void SysExceptKeepTrace(uintptr_t address)
{
    if (state.trace.address != address)
        SysExceptForgetTrace();
}

void SysExceptForgetTrace(void)
{
    memset(&state, 0, sizeof state);
}

#endif
