"""Instructions for operators, conversions and intrinsics on scalars. Operands are values; nothing here recurses.

Integers wrap, nothing here has undefined behaviour for any operand, and no conversion needs a library call.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import NULL, Value, float_literal, number
from plctool.compiler.codegen.lower_frame import DIVIDE_BY_ZERO, Frame, zero
from plctool.compiler.codegen.lower_unit import REALS, Check, value_type
from plctool.compiler.typed.nodes import BinaryOp, Const, Intrinsic, Pos, Rounding, UnaryOp
from plctool.iec.types import BOOL, Elementary, Kind, Type, base_of
from plctool.image.targets import Machine

LOGIC = {BinaryOp.AND: "and", BinaryOp.OR: "or", BinaryOp.XOR: "xor"}
_INTEGER = {BinaryOp.ADD: "add", BinaryOp.SUB: "sub", BinaryOp.MUL: "mul", **LOGIC}
_REAL = {BinaryOp.ADD: "fadd", BinaryOp.SUB: "fsub", BinaryOp.MUL: "fmul", BinaryOp.DIV: "fdiv"}
_COMPARE = {
    BinaryOp.EQ: ("eq", "oeq"),
    BinaryOp.NE: ("ne", "une"),
    BinaryOp.LT: ("lt", "olt"),
    BinaryOp.LE: ("le", "ole"),
    BinaryOp.GT: ("gt", "ogt"),
    BinaryOp.GE: ("ge", "oge"),
}
COMPARISONS = frozenset(_COMPARE)


def is_real(t: Type) -> bool:
    base = base_of(t)
    return isinstance(base, Elementary) and base.kind is Kind.REAL


def _suffix(text: str) -> str:
    """What the names of intrinsics have for an LLVM type of reals."""
    return "f32" if text == "float" else "f64"


def is_bool(t: Type) -> bool:
    return base_of(t) is BOOL


def is_signed(t: Type) -> bool:
    base = base_of(t)
    return isinstance(base, Elementary) and base.signed


def bits_of(t: Type) -> int:
    """The width of a scalar's value."""
    base = base_of(t)
    return base.bits if isinstance(base, Elementary) else 64


def constant(value: int | float | str, t: Type) -> Value:
    """A scalar constant as an LLVM operand."""
    text = value_type(t)
    if text in REALS:
        return float_literal(float(value), bits_of(t))
    if text == "ptr":
        return Value(f"inttoptr (i64 {int(value)} to ptr)") if int(value) else NULL
    return number(int(value))


def compare(frame: Frame, op: BinaryOp, left: Value, right: Value, t: Type) -> Value:
    """The i1 of a comparison of two values of `t`."""
    integer, real = _COMPARE[op]
    text = value_type(t)
    if text in REALS:
        return frame.fn.value(f"fcmp {real} {text} {left}, {right}")
    if op not in (BinaryOp.EQ, BinaryOp.NE):
        integer = ("s" if is_signed(t) else "u") + integer
    return frame.fn.value(f"icmp {integer} {text} {left}, {right}")


def binary(frame: Frame, op: BinaryOp, left: Value, right: Value, t: Type) -> Value:
    """An operator that cannot fail. `t`: type of both operands and of the result."""
    text = value_type(t)
    table = _REAL if text in REALS else _INTEGER
    return frame.fn.value(f"{table[op]} {text} {left}, {right}")


def divide(frame: Frame, op: BinaryOp, left: Value, right: Value, t: Type, pos: Pos, divisor: int | None) -> Value:
    """DIV or MOD of integers. `divisor`: its value when it is constant."""
    checked = Check.DIV in frame.checks and (divisor is None or divisor == 0)
    if checked:
        nonzero = frame.fn.value(f"icmp ne {value_type(t)} {right}, 0")
        frame.require(nonzero, DIVIDE_BY_ZERO, pos)
    if not is_signed(t):
        return _divide_unsigned(frame, op, left, right, t, safe=checked or bool(divisor))
    if bits_of(t) < 32:
        return _divide_narrow(frame, op, left, right, t, safe=checked or bool(divisor))
    return _divide_signed(frame, op, left, right, t, checked, divisor)


def _divide_unsigned(frame: Frame, op: BinaryOp, left: Value, right: Value, t: Type, *, safe: bool) -> Value:
    text = value_type(t)
    if not safe:
        right = frame.fn.value(f"call {text} @llvm.umax.{text}({text} {right}, {text} 1)")
    return frame.fn.value(f"{'udiv' if op is BinaryOp.DIV else 'urem'} {text} {left}, {right}")


def _divide_narrow(frame: Frame, op: BinaryOp, left: Value, right: Value, t: Type, *, safe: bool) -> Value:
    """In 32 bits, where MIN / -1 does not overflow."""
    fn, text = frame.fn, value_type(t)
    wide_left = fn.value(f"sext {text} {left} to i32")
    wide_right = fn.value(f"sext {text} {right} to i32")
    if not safe:
        is_zero = fn.value(f"icmp eq i32 {wide_right}, 0")
        wide_right = fn.value(f"select i1 {is_zero}, i32 1, i32 {wide_right}")
    result = fn.value(f"{'sdiv' if op is BinaryOp.DIV else 'srem'} i32 {wide_left}, {wide_right}")
    return fn.value(f"trunc i32 {result} to {text}")


def _divide_signed(
    frame: Frame, op: BinaryOp, left: Value, right: Value, t: Type, checked: bool, divisor: int | None
) -> Value:
    """32 and 64 bits: divisors that LLVM does not define (-1 with MIN, 0 unchecked) are replaced by 1."""
    fn, text = frame.fn, value_type(t)
    word = "sdiv" if op is BinaryOp.DIV else "srem"
    if divisor is not None and divisor not in (0, -1):
        return fn.value(f"{word} {text} {left}, {right}")
    minus_one = fn.value(f"icmp eq {text} {right}, -1")
    special = minus_one
    if not checked:
        special = fn.value(f"icmp ult {text} {fn.value(f'add {text} {right}, 1')}, 2")
    safe = fn.value(f"select i1 {special}, {text} 1, {text} {right}")
    result = fn.value(f"{word} {text} {left}, {safe}")
    if op is BinaryOp.MOD:
        return result
    negated = fn.value(f"sub {text} 0, {left}")
    return fn.value(f"select i1 {minus_one}, {text} {negated}, {text} {result}")


def unary(frame: Frame, op: UnaryOp, operand: Value, t: Type) -> Value:
    text = value_type(t)
    if op is UnaryOp.NOT:
        return frame.fn.value(f"xor {text} {operand}, {1 if is_bool(t) else -1}")
    if text in REALS:
        return frame.fn.value(f"fneg {text} {operand}")
    return frame.fn.value(f"sub {text} 0, {operand}")


def convert(frame: Frame, value: Value, source: Type, target: Type, *, rounding: Rounding = Rounding.EVEN) -> Value:
    """A scalar conversion as typed.Convert defines it."""
    old, new = value_type(source), value_type(target)
    fn = frame.fn
    if is_bool(target):
        return value if is_bool(source) else to_bool(frame, value, source)
    if is_bool(source):  # it may index an array: a wrong byte in it must not lead out of that
        value = to_bool(frame, value, source)
    if old == new:
        return value
    if old == "ptr" or new == "ptr":
        word = "ptrtoint" if old == "ptr" else "inttoptr"
    elif is_real(source) and is_real(target):
        word = "fptrunc" if new == "float" else "fpext"
    elif is_real(source):
        return _to_integer(frame, value, source, target, rounding)
    elif is_real(target):
        word = "sitofp" if is_signed(source) else "uitofp"
    elif bits_of(source) > bits_of(target):
        word = "trunc"
    else:
        word = "sext" if is_signed(source) else "zext"
    return fn.value(f"{word} {old} {value} to {new}")


def to_bool(frame: Frame, value: Value, source: Type) -> Value:
    """0 for what is zero, 1 for everything else."""
    return frame.fn.value(f"zext i1 {is_not_zero(frame, value, source)} to i8")


def is_not_zero(frame: Frame, value: Value, t: Type) -> Value:
    """The i1 of a conversion to BOOL."""
    text = value_type(t)
    return frame.fn.value(f"{'fcmp une' if is_real(t) else 'icmp ne'} {text} {value}, {zero(t)}")


def _to_integer(frame: Frame, value: Value, source: Type, target: Type, rounding: Rounding) -> Value:
    text, integer = value_type(source), value_type(target)
    if rounding is Rounding.EVEN:
        whole = _nearest_integer(frame, value, text, target)
        if whole is not None:
            return whole
        value = _round_to_even(frame, value, text)
    word = "fptosi" if is_signed(target) else "fptoui"
    suffix = _suffix(text)
    whole = frame.fn.value(f"call {integer} @llvm.{word}.sat.{integer}.{suffix}({text} {value})")
    return _away_from_zero(frame, value, text, whole) if rounding is Rounding.AWAY else whole


def _nearest_integer(frame: Frame, value: Value, text: str, target: Type) -> Value | None:
    """The integer by the processor's own instruction, which is in its default mode: to nearest, halves to even. None
    where there is no such instruction."""
    fn, bits = frame.fn, bits_of(target)
    width = 32 if bits < 32 or (bits == 32 and is_signed(target)) else 64
    if bits == 64 and not is_signed(target):
        return None
    whole = _by_instruction(frame, value, text, width)
    if whole is None or bits == width:
        return whole
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if is_signed(target) else (0, (1 << bits) - 1)
    for word, limit in (("smax", low), ("smin", high)):
        whole = fn.value(f"call i{width} @llvm.{word}.i{width}(i{width} {whole}, i{width} {limit})")
    return fn.value(f"trunc i{width} {whole} to i{bits}")


def _by_instruction(frame: Frame, value: Value, text: str, width: int) -> Value | None:
    """The nearest signed integer of 32 or 64 bits; the limits for what is beyond them, and 0 for what is no number."""
    fn, target, real = frame.fn, frame.unit.target, _suffix(text)
    if target.machine is Machine.AARCH64:
        return fn.value(f"call i{width} @llvm.aarch64.neon.fcvtns.i{width}.{real}({text} {value})")
    if target.machine is Machine.THUMB and target.registers[1] and text == "float" and width == 32:
        return fn.value(f"bitcast float {fn.value(f'call float @llvm.arm.vcvtr.f32(float {value})')} to i32")
    if target.machine is not Machine.X86_64:
        return None
    vector, name = ("<4 x float>", "sse.cvtss2si") if text == "float" else ("<2 x double>", "sse2.cvtsd2si")
    operand = fn.value(f"insertelement {vector} poison, {text} {value}, i32 0")
    wide = "64" if width == 64 else ""
    whole = fn.value(f"call i{width} @llvm.x86.{name}{wide}({vector} {operand})")  # the least one if it does not fit
    limit = 2.0**31 - 0.5 if width == 32 and text == "double" else 2.0 ** (width - 1)  # becomes 2^31 (2^63)
    beyond = fn.value(f"fcmp oge {text} {value}, {float_literal(limit, 64)}")
    whole = fn.value(f"select i1 {beyond}, i{width} {(1 << width - 1) - 1}, i{width} {whole}")
    no_number = fn.value(f"fcmp uno {text} {value}, {value}")
    return fn.value(f"select i1 {no_number}, i{width} 0, i{width} {whole}")


def _away_from_zero(frame: Frame, value: Value, text: str, whole: Value) -> Value:
    """`whole`: the LINT of a real, cut towards zero; all that is at most 2^63 in size is exact there."""
    fn = frame.fn
    suffix = _suffix(text)
    rest = fn.value(f"fsub {text} {value}, {fn.value(f'sitofp i64 {whole} to {text}')}")
    for word, limit in (("oge", 0.5), ("ole", -0.5)):
        further = fn.value(f"fcmp {word} {text} {rest}, {float_literal(limit, 64)}")
        step = fn.value(f"zext i1 {further} to i64")
        whole = fn.value(f"{'add' if limit > 0 else 'sub'} i64 {whole}, {step}")
    size = fn.value(f"call {text} @llvm.fabs.{suffix}({text} {value})")
    fits = fn.value(f"fcmp olt {text} {size}, {float_literal(2.0**63, 64)}")
    return fn.value(f"select i1 {fits}, i64 {whole}, i64 {-(2**63)}")


def _round_to_even(frame: Frame, value: Value, text: str) -> Value:
    """Adding and taking away 2^23 (2^52) with the sign of the value leaves no room for a fraction; larger values
    have none. For processors without an instruction for it."""
    fn = frame.fn
    suffix, magic = _suffix(text), 2.0**23 if text == "float" else 2.0**52
    literal = float_literal(magic, 64)
    size = fn.value(f"call {text} @llvm.fabs.{suffix}({text} {value})")
    bias = fn.value(f"call {text} @llvm.copysign.{suffix}({text} {literal}, {text} {value})")
    rounded = fn.value(f"fsub {text} {fn.value(f'fadd {text} {value}, {bias}')}, {bias}")
    small = fn.value(f"fcmp olt {text} {size}, {literal}")
    return fn.value(f"select i1 {small}, {text} {rounded}, {text} {value}")


def shift(
    frame: Frame, op: Intrinsic, value: Value, t: Type, count: Value, count_type: Type, known: int | None
) -> Value:
    """SHL, SHR. `known`: the count when it is constant."""
    fn, text, width = frame.fn, value_type(t), bits_of(t)
    word = "shl" if op is Intrinsic.SHL else "ashr" if is_signed(t) else "lshr"
    if known is not None:
        return fn.value(f"{word} {text} {value}, {known}") if 0 <= known < width else number(0)
    count_text = value_type(count_type)
    fits = fn.value(f"icmp ult {count_text} {count}, {width}")
    shifted = fn.value(f"{word} {text} {value}, {resize(frame, count, count_type, width)}")
    return fn.value(f"select i1 {fits}, {text} {shifted}, {text} 0")


def rotate(frame: Frame, op: Intrinsic, value: Value, t: Type, count: Value, count_type: Type) -> Value:
    text = value_type(t)
    word = "fshl" if op is Intrinsic.ROL else "fshr"
    amount = resize(frame, count, count_type, bits_of(t))
    return frame.fn.value(f"call {text} @llvm.{word}.{text}({text} {value}, {text} {value}, {text} {amount})")


def resize(frame: Frame, value: Value, t: Type, width: int) -> Value:
    """An integer in `width` bits, extended by its own sign."""
    bits = bits_of(t)
    if bits == width or value.constant is not None:
        return value
    word = "trunc" if bits > width else "sext" if is_signed(t) else "zext"
    return frame.fn.value(f"{word} i{bits} {value} to i{width}")


def absolute(frame: Frame, value: Value, t: Type) -> Value:
    text = value_type(t)
    if is_real(t):
        return frame.fn.value(f"call {text} @llvm.fabs.f{bits_of(t)}({text} {value})")
    if not is_signed(t):
        return value
    return frame.fn.value(f"call {text} @llvm.abs.{text}({text} {value}, i1 false)")


def square_root(frame: Frame, value: Value, t: Type) -> Value:
    text = value_type(t)
    return frame.fn.value(f"call {text} @llvm.sqrt.f{bits_of(t)}({text} {value})")


def select(frame: Frame, condition: Value, then: Value, otherwise: Value, t: Type) -> Value:
    text = value_type(t)
    return frame.fn.value(f"select i1 {condition}, {text} {then}, {text} {otherwise}")


def extreme(frame: Frame, op: Intrinsic, left: Value, right: Value, t: Type) -> Value:
    """MIN, MAX of two scalars."""
    text = value_type(t)
    if is_bool(t):
        return binary(frame, BinaryOp.AND if op is Intrinsic.MIN else BinaryOp.OR, left, right, t)
    if text in REALS:
        first = compare(frame, BinaryOp.LT if op is Intrinsic.MIN else BinaryOp.GT, left, right, t)
        return select(frame, first, left, right, t)
    word = ("s" if is_signed(t) else "u") + op.value.lower()
    return frame.fn.value(f"call {text} @llvm.{word}.{text}({text} {left}, {text} {right})")


def bitcast(frame: Frame, value: Value, source: Type, target: Type) -> Value:
    old, new = value_type(source), value_type(target)
    if old == new:
        return value
    return frame.fn.value(f"bitcast {old} {value} to {new}")


def known_integer(e: object) -> int | None:
    """The value of a constant integer expression."""
    return e.value if isinstance(e, Const) and isinstance(e.value, int) else None
