/*
 * SysDebug.c - traps in IEC code on RISC-V: C.EBREAK in code that is in RAM; and what a single instruction does.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * What catches traps is in SysExcept.c.
 */
#include "SysDebug.h"

#include "RiscvStep.h"
#include "rts_config.h"

#if BP_MAX > 0

enum { TRAP = 0x9002, TRAP_WIDE = 0x00100073 };

/* CodeInRam.c. */
bool SysDebugCanTrap(void)
{
    return APP_MAX_CODE_SIZE > 0;
}

static void store(uintptr_t address, RTS_UI32 half)
{
    *(volatile RTS_UI16 *)address = (RTS_UI16)half;
    CpuBarrier();
}

static RTS_UI32 read_half(uintptr_t address)
{
    return *(const RTS_UI16 *)address;
}

/* The instructions have two or four bytes: a trap of two is at the beginning of either. */
RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    *original = read_half(address);
    store(address, TRAP);
    return ERR_OK;
}

void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    store(address, original);
}

RTS_UI32 SysDebugTrapSize(uintptr_t address)
{
    RTS_UNUSED(address);
    return sizeof(RTS_UI16);
}

static RTS_UI32 read_code(uintptr_t address)
{
    return read_half(address) | (RiscvSize(address) == 4 ? read_half(address + 2) << 16 : 0);
}

bool SysDebugIsTrap(uintptr_t address)
{
    RTS_UI32 code = read_code(address);
    return code == TRAP || code == TRAP_WIDE;
}

bool SysDebugMayWait(void)
{
    return true;
}

void SysDebugIsMain(void)
{
}

void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value)
{
    RTS_UNUSED(word);
    RTS_UNUSED(value);
}

void SysDebugWake(RTS_UI32 *word)
{
    RTS_UNUSED(word);
}

/* ---- a single instruction ---- */

RTS_UI32 RiscvSize(uintptr_t address)
{
    return (read_half(address) & 3) == 3 ? 4 : 2;
}

/* NULL: x0, and those that programs do not use. */
static RTS_UI32 *find_register(FRAME *frame, RTS_UI32 *saved, RTS_UI32 number)
{
    if (number == 1)
        return &frame->ra;
    if (number == 2)
        return &frame->sp;
    if (number < 5)
        return NULL;
    if (number < 8)
        return &frame->t0 + (number - 5);
    if (number < 10)
        return saved + (number - 8);
    if (number < 18)
        return &frame->a0 + (number - 10);
    return number < 28 ? saved + (number - 16) : &frame->t3 + (number - 28);
}

static RTS_UI32 value_of(FRAME *frame, RTS_UI32 *saved, RTS_UI32 number)
{
    const RTS_UI32 *found = find_register(frame, saved, number);
    return found != NULL ? *found : 0;
}

static RISCV_STEP jump(FRAME *frame, RTS_UI32 *saved, RTS_UI32 link, RTS_UI32 size, RTS_UI32 target)
{
    RTS_UI32 *found = find_register(frame, saved, link);
    if (found != NULL)
        *found = frame->pc + size;
    frame->pc = target & ~1u;
    return RISCV_DONE;
}

static RISCV_STEP jump_if(FRAME *frame, bool taken, RTS_UI32 size, RTS_UI32 distance)
{
    frame->pc += taken ? distance : size;
    return RISCV_DONE;
}

/* `count` bits from `from` on, at `to`. */
static RTS_UI32 bits(RTS_UI32 code, RTS_UI32 from, RTS_UI32 count, RTS_UI32 to)
{
    return (code >> from & ((1u << count) - 1)) << to;
}

/* The sign is the highest bit of the instruction, at `place` of the distance and above. */
static RTS_UI32 sign(bool negative, RTS_UI32 place)
{
    return negative ? ~0u << place : 0;
}

static bool is_taken(RTS_UI32 function, RTS_UI32 a, RTS_UI32 b)
{
    bool less = function & 2 ? a < b : (RTS_I32)a < (RTS_I32)b;
    bool holds = function & 4 ? less : a == b;
    return holds != ((function & 1) != 0);
}

static RISCV_STEP step_wide(FRAME *frame, RTS_UI32 *saved, RTS_UI32 code)
{
    bool negative = code >> 31 != 0;
    RTS_UI32 a = value_of(frame, saved, bits(code, 15, 5, 0)), b = value_of(frame, saved, bits(code, 20, 5, 0));
    RTS_UI32 rd = bits(code, 7, 5, 0), function = bits(code, 12, 3, 0);
    switch (code & 0x7F) {
    case 0x6F: /* JAL */
        return jump(frame, saved, rd, 4,
                    frame->pc +
                        (bits(code, 21, 10, 1) | bits(code, 20, 1, 11) | bits(code, 12, 8, 12) | sign(negative, 20)));
    case 0x67: /* JALR */
        return jump(frame, saved, rd, 4, a + (bits(code, 20, 11, 0) | sign(negative, 11)));
    case 0x63: /* BEQ and the like */
        return jump_if(frame, is_taken(function, a, b), 4,
                       bits(code, 8, 4, 1) | bits(code, 25, 6, 5) | bits(code, 7, 1, 11) | sign(negative, 12));
    case 0x73: /* ECALL and the like */
        return RISCV_FAULT;
    default:
        return RISCV_STRAIGHT;
    }
}

static RISCV_STEP step_compressed(FRAME *frame, RTS_UI32 *saved, RTS_UI32 code)
{
    enum { C_JAL = 0x2001, C_J = 0xA001, C_BEQZ = 0xC001, C_BNEZ = 0xE001, C_JR = 0x8002 };
    bool high = (code & 0x1000) != 0;
    RTS_UI32 operation = code & 0xE003, rs = bits(code, 7, 5, 0);
    RTS_UI32 near =
        bits(code, 3, 2, 1) | bits(code, 10, 2, 3) | bits(code, 2, 1, 5) | bits(code, 5, 2, 6) | sign(high, 8);
    RTS_UI32 far = bits(code, 3, 3, 1) | bits(code, 11, 1, 4) | bits(code, 2, 1, 5) | bits(code, 7, 1, 6) |
                   bits(code, 6, 1, 7) | bits(code, 9, 2, 8) | bits(code, 8, 1, 10) | sign(high, 11);
    if (operation == C_J || operation == C_JAL)
        return jump(frame, saved, operation == C_JAL, 2, frame->pc + far);
    if (operation == C_BEQZ || operation == C_BNEZ)
        return jump_if(frame, (value_of(frame, saved, 8 + bits(code, 7, 3, 0)) == 0) == (operation == C_BEQZ), 2, near);
    if (operation == C_JR && (code & 0x7C) == 0 && rs != 0) /* with bit 12: C.JALR */
        return jump(frame, saved, high, 2, value_of(frame, saved, rs));
    return RISCV_STRAIGHT;
}

RISCV_STEP RiscvStep(FRAME *frame, RTS_UI32 *saved)
{
    RTS_UI32 code = read_code(frame->pc);
    return (code & 3) == 3 ? step_wide(frame, saved, code) : step_compressed(frame, saved, code);
}

#endif
