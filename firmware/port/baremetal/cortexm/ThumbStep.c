/*
 * ThumbStep.c - executes one Thumb instruction of the application for a debugger (Armv7-M, Armv7-A).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The instructions that change the program counter, in the order of the manual: A6.2 (16 bits) and A6.3 (32 bits).
 */
#include "ThumbStep.h"

#include "ArmCondition.h"

enum { SP = 13, LR = 14, PC = 15 };
enum { TRAP = 0xDE01, TRAP_WIDE = 0xF7F0, TRAP_WIDE_END = 0xA000 }; /* as Linux has them */

static RTS_UI32 sign_extend(RTS_UI32 value, RTS_UI32 bits)
{
    return (RTS_UI32)((RTS_I32)(value << (32 - bits)) >> (32 - bits));
}

static RTS_UI32 bits(RTS_UI32 value, RTS_UI32 lowest, RTS_UI32 count)
{
    return value >> lowest & ((1u << count) - 1);
}

RTS_UI32 ThumbSize(RTS_UI16 first)
{
    return first >> 11 >= 0x1D ? 4 : 2;
}

/* ---- IT blocks: the condition of the instruction and what follows are in bits 15 to 10 and 26 to 25 ---- */

enum { IT_MASK = 0x0600FC00, IT_ALWAYS = 0xE8 };

static RTS_UI32 it_state(RTS_UI32 flags)
{
    return bits(flags, 25, 2) | bits(flags, 10, 6) << 2;
}

static RTS_UI32 with_it_state(RTS_UI32 flags, RTS_UI32 it)
{
    return (flags & ~(RTS_UI32)IT_MASK) | (it & 3) << 25 | it >> 2 << 10;
}

static RTS_UI32 advanced(RTS_UI32 it)
{
    return (it & 7) == 0 ? 0 : (it & 0xE0) | (it << 1 & 0x1F);
}

RTS_UI32 ThumbAlone(RTS_UI32 flags)
{
    return it_state(flags) != 0 ? with_it_state(flags, IT_ALWAYS) : flags;
}

RTS_UI32 ThumbAfter(RTS_UI32 before, RTS_UI32 after)
{
    return it_state(before) != 0 ? with_it_state(after, advanced(it_state(before))) : after;
}

/* ---- branches ---- */

static THUMB_STEP branch(THUMB_REGISTERS *at, RTS_UI32 distance)
{
    at->r[PC] = (at->r[PC] + 4 + distance) | 1;
    return THUMB_DONE;
}

static THUMB_STEP branch_if(THUMB_REGISTERS *at, bool taken, RTS_UI32 size, RTS_UI32 distance)
{
    return branch(at, taken ? distance : size - 4);
}

static void link(THUMB_REGISTERS *at, RTS_UI32 size)
{
    at->r[LR] = (at->r[PC] + size) | 1;
}

static THUMB_STEP exchange(THUMB_REGISTERS *at, RTS_UI32 half)
{
    RTS_UI32 target = at->r[bits(half, 3, 4)];

    if (bits(half, 3, 4) == PC)
        return THUMB_STRAIGHT;
    if (half & 0x80)
        link(at, 2);
    at->r[PC] = target;
    return THUMB_DONE;
}

/* Reads the registers of a list from the address on, and returns where it ends; 0 when it cannot be read. */
static RTS_UI32 load_list(THUMB_REGISTERS *at, RTS_UI32 address, RTS_UI32 list)
{
    RTS_UI32 i;

    if (address % 4 != 0 || !ThumbMayRead(address, 4 * (RTS_UI32)__builtin_popcount(list)))
        return 0;
    for (i = 0; i <= PC; i++) {
        if (list >> i & 1) {
            at->r[i] = *(const RTS_UI32 *)(uintptr_t)address;
            address += 4;
        }
    }
    return address;
}

static THUMB_STEP pop(THUMB_REGISTERS *at, RTS_UI32 list)
{
    RTS_UI32 end = load_list(at, at->r[SP], list);

    if (end == 0)
        return THUMB_FAULT;
    at->r[SP] = end;
    return THUMB_DONE;
}

static THUMB_STEP load_multiple(THUMB_REGISTERS *at, RTS_UI32 first, RTS_UI32 list)
{
    RTS_UI32 base = bits(first, 0, 4);
    RTS_UI32 size = 4 * (RTS_UI32)__builtin_popcount(list);
    RTS_UI32 start = at->r[base] - (first & 0x100 ? size : 0); /* LDMDB */
    RTS_UI32 written = first & 0x100 ? start : start + size;

    if (load_list(at, start, list) == 0)
        return THUMB_FAULT;
    if (first & 0x20)
        at->r[base] = written;
    return THUMB_DONE;
}

/* TBB, TBH. */
static THUMB_STEP table_branch(THUMB_REGISTERS *at, RTS_UI32 first, RTS_UI32 second)
{
    bool wide = (second & 0x10) != 0;
    RTS_UI32 base = bits(first, 0, 4) == PC ? at->r[PC] + 4 : at->r[bits(first, 0, 4)];
    RTS_UI32 address = base + (at->r[bits(second, 0, 4)] << wide);

    if (!ThumbMayRead(address, 2))
        return THUMB_FAULT;
    return branch(
        at, 2u * (wide ? *(const RTS_UI16 *)(uintptr_t)address : (RTS_UI32) * (const RTS_UI8 *)(uintptr_t)address));
}

/* LDR to the program counter. */
static THUMB_STEP load_target(THUMB_REGISTERS *at, RTS_UI32 first, RTS_UI32 second)
{
    RTS_UI32 base = bits(first, 0, 4);
    RTS_UI32 before = base == PC ? (at->r[PC] + 4) & ~3u : at->r[base];
    RTS_UI32 distance = bits(second, 0, 12);
    bool indexed = true, subtracts = base == PC && !(first & 0x80), writes = false;

    if (base != PC && !(first & 0x80)) {
        if (second & 0x800) {
            distance = bits(second, 0, 8);
            indexed = (second & 0x400) != 0;
            subtracts = (second & 0x200) == 0;
            writes = (second & 0x100) != 0;
        } else {
            distance = at->r[bits(second, 0, 4)] << bits(second, 4, 2);
        }
    }
    RTS_UI32 after = subtracts ? before - distance : before + distance;
    if (load_list(at, indexed ? after : before, 1u << PC) == 0)
        return THUMB_FAULT;
    if (writes)
        at->r[base] = after;
    return THUMB_DONE;
}

static THUMB_STEP step_short(THUMB_REGISTERS *at, RTS_UI32 half)
{
    RTS_UI32 condition = bits(half, 8, 4);

    if ((half & 0xF000) == 0xD000 && condition < 14)
        return branch_if(at, ArmConditionHolds(condition, at->flags), 2, sign_extend(half << 1, 9));
    if ((half & 0xF800) == 0xE000)
        return branch(at, sign_extend(half << 1, 12));
    if ((half & 0xF500) == 0xB100)
        return branch_if(at, (at->r[half & 7] != 0) == bits(half, 11, 1), 2,
                         bits(half, 9, 1) << 6 | bits(half, 3, 5) << 1);
    if ((half & 0xFF00) == 0x4700)
        return exchange(at, half);
    if ((half & 0xFF00) == 0xBD00)
        return pop(at, (half & 0xFF) | 1u << PC);
    if ((half & 0xFF87) == 0x4687)
        return branch(at, at->r[bits(half, 3, 4)] - at->r[PC] - 4);
    if ((half & 0xFF87) == 0x4487)
        return branch(at, at->r[bits(half, 3, 4)]);
    return THUMB_STRAIGHT;
}

static THUMB_STEP step_branch(THUMB_REGISTERS *at, RTS_UI32 first, RTS_UI32 second)
{
    RTS_UI32 sign = bits(first, 10, 1), j1 = bits(second, 13, 1), j2 = bits(second, 11, 1);
    RTS_UI32 low = bits(second, 0, 11) << 1;
    RTS_UI32 near = sign << 20 | j2 << 19 | j1 << 18 | bits(first, 0, 6) << 12 | low;
    RTS_UI32 far = sign << 24 | (j1 ^ sign ^ 1) << 23 | (j2 ^ sign ^ 1) << 22 | bits(first, 0, 10) << 12 | low;

    if (second & 0x1000) {
        if (second & 0x4000)
            link(at, 4);
        return branch(at, sign_extend(far, 25));
    }
    if ((second & 0x4000) || bits(first, 7, 3) == 7)
        return THUMB_STRAIGHT;
    return branch_if(at, ArmConditionHolds(bits(first, 6, 4), at->flags), 4, sign_extend(near, 21));
}

static THUMB_STEP step_wide(THUMB_REGISTERS *at, RTS_UI32 first, RTS_UI32 second)
{
    if ((first & 0xF800) == 0xF000 && (second & 0x8000))
        return step_branch(at, first, second);
    if (((first & 0xFFD0) == 0xE890 || (first & 0xFFD0) == 0xE910) && (second & 0x8000))
        return load_multiple(at, first, second);
    if ((first & 0xFFF0) == 0xE8D0 && (second & 0xFFE0) == 0xF000)
        return table_branch(at, first, second);
    if ((first & 0xFF70) == 0xF850 && second >> 12 == PC)
        return load_target(at, first, second);
    return THUMB_STRAIGHT;
}

THUMB_STEP ThumbStep(THUMB_REGISTERS *at)
{
    RTS_UI32 code = ThumbRead(at->r[PC]);
    RTS_UI32 first = code & 0xFFFF, second = code >> 16;
    RTS_UI32 size = ThumbSize((RTS_UI16)first);
    RTS_UI32 it = it_state(at->flags);
    THUMB_STEP done;

    if (it != 0 && !ArmConditionHolds(it >> 4, at->flags))
        done = branch(at, size - 4);
    else
        done = size == 2 ? step_short(at, first) : step_wide(at, first, second);
    if (done == THUMB_DONE)
        at->flags = ThumbAfter(at->flags, at->flags);
    return done;
}

/* ---- traps ---- */

RTS_UI32 ThumbRead(uintptr_t address)
{
    const RTS_UI16 *code = (const RTS_UI16 *)address;

    return code[0] | (ThumbSize(code[0]) == 4 ? (RTS_UI32)code[1] << 16 : 0);
}

/* Of two halves the first is a short trap while the second one changes, since a task may execute them at any time. */
static bool replace(uintptr_t address, RTS_UI32 code, PF_STORE_CODE store)
{
    RTS_UI16 first = (RTS_UI16)code;

    if (ThumbSize(first) == 4 && !(store(address, TRAP) && store(address + 2, (RTS_UI16)(code >> 16))))
        return false;
    return store(address, first);
}

bool ThumbWriteTrap(uintptr_t address, PF_STORE_CODE store)
{
    bool wide = ThumbSize(*(const RTS_UI16 *)address) == 4;

    return replace(address, wide ? TRAP_WIDE | (RTS_UI32)TRAP_WIDE_END << 16 : TRAP, store);
}

void ThumbRestore(uintptr_t address, RTS_UI32 original, PF_STORE_CODE store)
{
    (void)replace(address, original, store);
}

/* Also one of the compiler. */
bool ThumbIsTrap(uintptr_t address)
{
    RTS_UI32 code = ThumbRead(address);

    return (code & 0xFF00) == 0xDE00 || code == (TRAP_WIDE | (RTS_UI32)TRAP_WIDE_END << 16);
}
