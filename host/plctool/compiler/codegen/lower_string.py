"""Strings: copying with cutting, comparing.

A STRING is a run of bytes up to a NUL or the capacity, whichever comes first: no memory content makes these functions
read or write outside of it. Bytes after the NUL have no meaning and may be overwritten.
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.codegen.ir import FALSE, Value, number
from plctool.compiler.codegen.lower_arith import compare
from plctool.compiler.codegen.lower_frame import Frame, Ref
from plctool.compiler.typed import BinaryOp
from plctool.iec.types import DINT, StringType

_INLINE_COPY = 128  # bytes that LLVM copies with a few vector moves
_SHORT_COPY = 16  # bytes that it copies without vectors, but with unaligned words
_TINY_COPY = 4
_INLINE_COMPARE = 16


def copy_string(frame: Frame, target: Ref, source: Ref) -> None:
    """target := source, cut to the target's capacity."""
    if target.capacity.constant is not None and source.capacity.constant is not None:
        length = min(target.capacity.constant, source.capacity.constant)
        target_machine = frame.unit.target
        inline = _INLINE_COPY if target_machine.vectors else _SHORT_COPY if target_machine.unaligned else _TINY_COPY
        if length * _unit(target) <= inline:
            frame.copy(target, source, length * _unit(target))
            _terminate(frame, target, length)
            return
    name, room = frame.unit.helper(_helper("copy", target)), f"i32 {source.capacity}"
    to = ["ptr null", f"ptr {frame.address(target)}", f"i32 {target.capacity}", "i32 0"]
    copied = frame.fn.call_value("i32", name, [*to, f"ptr {frame.address(source)}", room, "i32 0", room])
    frame.note_length(target, copied)


def append_string(frame: Frame, target: Ref, length: Value, capacity: Value, source: Ref) -> Value:
    """Adds `source` to a string of the length `length`, up to `capacity`. Returns the new length."""
    name, room = frame.unit.helper(_helper("copy", target)), f"i32 {source.capacity}"
    to = ["ptr null", f"ptr {frame.address(target)}", f"i32 {capacity}", f"i32 {length}"]
    return frame.fn.call_value("i32", name, [*to, f"ptr {frame.address(source)}", room, "i32 0", room])


def copy_literal(frame: Frame, target: Ref, text: str) -> None:
    """target := constant, cut to the target's capacity."""
    wide = _unit(target) == 2
    if target.capacity.constant is None:
        copy_string(frame, target, literal_text(frame, text, wide=wide))
        return
    text = text[: target.capacity.constant]
    if text:
        source = replace(literal_text(frame, text, wide=wide), direct=target.direct)
        frame.copy(target, source, len(text) * _unit(target))
    _terminate(frame, target, len(text))
    frame.note_length(target, number(len(text)))


def literal_text(frame: Frame, text: str, *, wide: bool) -> Ref:
    """A constant string in the image."""
    t = StringType(len(text), wide)
    pointer = frame.unit.module.constant(encode_text(text + "\0", t), t.align)
    return Ref(pointer, 0, t, direct=True, capacity=number(len(text)))


def _terminate(frame: Frame, target: Ref, length: int) -> None:
    unit = _unit(target)
    end = frame.address(replace(target, offset=target.offset + length * unit))
    frame.fn.do(f"store i{8 * unit} 0, ptr {end}, align {unit}")


def compare_strings(frame: Frame, op: BinaryOp, left: Ref, right: Ref) -> Value:
    """The i1 of a comparison, byte by byte, unsigned."""
    arguments = [text for ref in (left, right) for text in (f"ptr {frame.address(ref)}", f"i32 {ref.capacity}")]
    order = frame.fn.call_value("i32", frame.unit.helper(_helper("compare", left)), arguments)
    return compare(frame, op, order, number(0), DINT)


def equals_literal(frame: Frame, ref: Ref, text: str) -> Value | None:
    """The i1 of a comparison with a short constant, without a loop; None when that is not possible."""
    assert isinstance(ref.type, StringType)
    data, at = encode_text(text + "\0", ref.type), 0
    size = len(data)
    if ref.capacity.constant is None or size > _INLINE_COMPARE:
        return None
    if ref.capacity.constant < len(text):
        return FALSE
    fn, parts = frame.fn, []
    while at < size:
        width = max(w for w in (1, 2, 4, 8) if w <= min(size - at, frame.unit.target.pointer_size))
        pointer = frame.address(replace(ref, offset=ref.offset + at))
        loaded = fn.value(f"freeze i{8 * width} {fn.value(f'load i{8 * width}, ptr {pointer}, align 1')}")
        wanted = int.from_bytes(data[at : at + width], "little")
        parts.append(fn.value(f"icmp eq i{8 * width} {loaded}, {wanted}"))
        at += width
    result = parts[0]
    for part in parts[1:]:
        result = fn.value(f"and i1 {result}, {part}")
    return result


def encode_text(text: str, t: StringType) -> bytes:
    """The characters as they are in memory."""
    return text.encode("utf-16-le", "surrogatepass") if t.wide else text.encode("latin-1")


def _unit(ref: Ref) -> int:
    """Bytes of a character."""
    assert isinstance(ref.type, StringType)
    return ref.type.unit


def _helper(name: str, ref: Ref) -> str:
    return f"str.{'w' if _unit(ref) == 2 else ''}{name}"
