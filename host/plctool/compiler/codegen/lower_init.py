"""Initial values: of local variables at every call, of everything else in CodeInit if they are constant, in GlobalInit
if they are calculated.

Memory is zeroed before, so only what is not zero is written. A struct or function block type with defaults gets one
function that writes them; arrays are filled by loops; runs of different numbers are copied from a constant in the
image.
"""

from __future__ import annotations

import struct
from dataclasses import replace

from plctool.compiler.codegen.ir import Value, round_to_single
from plctool.compiler.codegen.lower_arith import constant
from plctool.compiler.codegen.lower_frame import Frame, Ref
from plctool.compiler.codegen.lower_string import copy_literal, encode_text
from plctool.compiler.typed.nodes import Initial, ScalarInit, StructInit, array_runs, struct_members
from plctool.iec.types import BYTE, ArrayType, Elementary, Kind, StringType, StructType, Type, base_of, is_scalar

_LOOP_FROM = 5  # equal scalars that are worth a loop
_CONSTANT_FROM = 4  # different scalars that are worth a constant


def encode_scalar(value: int | float | str, t: Type) -> bytes:
    """A scalar or string constant as it is in memory."""
    if isinstance(t, StringType):
        text = encode_text(str(value)[: t.length], t)
        return text + bytes(t.size - len(text))
    base = base_of(t)
    if isinstance(base, Elementary) and base.kind is Kind.REAL:
        number = float(value)
        return struct.pack("<f", round_to_single(number)) if base.bits == 32 else struct.pack("<d", number)
    return (int(value) & ((1 << 8 * t.size) - 1)).to_bytes(t.size, "little")


def image_of(defaults: dict[str, StructInit], t: Type, initial: Initial | None) -> bytes:
    """The bytes of a variable with its initial value. `defaults`: those of types (`TypedProgram.defaults`)."""
    if isinstance(initial, ScalarInit):
        return encode_scalar(initial.value, t)
    if isinstance(t, ArrayType):
        return b"".join(image_of(defaults, t.element, value) * count for count, value in array_runs(t, initial))
    data = bytearray(t.size)
    if isinstance(t, StructType):
        for f, value in struct_members(t, initial, defaults.get(t.name)):
            member = image_of(defaults, f.type, value)
            if f.bit is None:
                data[f.offset : f.offset + f.type.size] = member
            else:
                data[f.offset] |= member[0] << f.bit
    return bytes(data)


def initialise(frame: Frame, ref: Ref, initial: Initial | None) -> None:
    """Gives zeroed memory its initial value; None is the default of the type."""
    t = ref.type
    if isinstance(initial, ScalarInit):
        _initialise_scalar(frame, ref, initial)
    elif isinstance(t, ArrayType):
        _initialise_array(frame, ref, t, initial)
    elif isinstance(t, StructType):
        _initialise_struct(frame, ref, t, initial)


def _initialise_scalar(frame: Frame, ref: Ref, initial: ScalarInit) -> None:
    if isinstance(ref.type, StringType):
        if initial.value:
            copy_literal(frame, ref, str(initial.value))
    elif any(encode_scalar(initial.value, ref.type)):
        frame.store(ref, constant(initial.value, ref.type))


def _initialise_struct(frame: Frame, ref: Ref, t: StructType, initial: Initial | None) -> None:
    if initial is None and not ref.unaligned:
        if any(image_of(frame.unit.defaults, t, None)):
            frame.fn.call(frame.unit.initialiser(t), [f"ptr {frame.address(ref)}"])
        return
    initialise_members(frame, ref, t, initial)


def initialise_members(frame: Frame, ref: Ref, t: StructType, initial: Initial | None) -> None:
    for f, value in struct_members(t, initial, frame.unit.defaults.get(t.name)):
        member = ref.member(f.offset, f.type)
        initialise(frame, member if f.bit is None else replace(member, type=BYTE, bit=f.bit), value)


def _initialise_array(frame: Frame, ref: Ref, t: ArrayType, initial: Initial | None) -> None:
    if is_scalar(t.element):
        _initialise_scalars(frame, ref, t, initial)
        return
    offset = 0
    for count, value in array_runs(t, initial):
        if any(image_of(frame.unit.defaults, t.element, value)):
            _repeat(frame, ref.member(offset, t), t.element, count, value)
        offset += count * t.element.size


def _initialise_scalars(frame: Frame, ref: Ref, t: ArrayType, initial: Initial | None) -> None:
    data, size = image_of(frame.unit.defaults, t, initial), t.element.size
    first, last = (len(data) - len(data.lstrip(b"\0"))) // size, -(-len(data.rstrip(b"\0")) // size)
    if first >= last:
        return
    part = data[first * size : last * size]
    if last - first >= _LOOP_FROM and part == part[:size] * (last - first):
        value = next(
            v for n, v in array_runs(t, initial) if isinstance(v, ScalarInit) and any(encode_scalar(v.value, t.element))
        )
        _repeat(frame, ref.member(first * size, t), t.element, last - first, value)
        return
    used = [i for i in range(first, last) if any(data[i * size : (i + 1) * size])]
    if len(used) >= _CONSTANT_FROM:
        pointer = frame.unit.module.constant(part, t.element.align)
        source = Ref(pointer, 0, t.element, direct=True)
        frame.copy(ref.member(first * size, t.element), source, len(part))
    else:
        for i in used:
            element = ref.member(i * size, t.element)
            frame.store(element, _constant_at(data, i * size, t.element))


def _constant_at(data: bytes, offset: int, t: Type) -> Value:
    raw = data[offset : offset + t.size]
    base = base_of(t)
    if isinstance(base, Elementary) and base.kind is Kind.REAL:
        return constant(struct.unpack("<f" if base.bits == 32 else "<d", raw)[0], t)
    return constant(int.from_bytes(raw, "little"), t)


def _repeat(frame: Frame, ref: Ref, element: Type, count: int, initial: Initial | None) -> None:
    """The same initial value in `count` elements from `ref` on."""
    if count == 1:
        initialise(frame, ref.member(0, element), initial)
        return
    fn, width = frame.fn, frame.pointer_int
    base, loop, end = frame.address(ref), fn.label("fill"), fn.label("filled")
    counter = fn.slot(width)
    fn.do(f"store {width} 0, ptr {counter}")
    fn.begin(loop)
    index = fn.value(f"load {width}, ptr {counter}")
    initialise(frame, frame.element(Ref(base, 0, element, sure=ref.align), index, element, counted=True), initial)
    following = fn.value(f"add {width} {index}, 1")
    fn.do(f"store {width} {following}, ptr {counter}")
    fn.branch_if(fn.value(f"icmp ult {width} {following}, {count}"), loop, end)
    fn.begin(end)
