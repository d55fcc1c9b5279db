"""Strings: copying with cutting, comparing.

A STRING is a run of bytes up to a NUL or the capacity, whichever comes first: no memory content makes these functions
read or write outside of it. Bytes after the NUL have no meaning and may be overwritten.
"""

from __future__ import annotations

from dataclasses import replace

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
    if target.capacity.isdigit() and source.capacity.isdigit():
        length = min(int(target.capacity), int(source.capacity))
        target_machine = frame.unit.target
        inline = _INLINE_COPY if target_machine.vectors else _SHORT_COPY if target_machine.unaligned else _TINY_COPY
        if length * _unit(target) <= inline:
            frame.copy(target, source, length * _unit(target))
            _terminate(frame, target, length)
            return
    name, capacity = frame.unit.helper(_helper("copy", target)), source.capacity
    frame.fn.value(
        f"call i32 @{name}(ptr null, ptr {frame.address(target)}, i32 {target.capacity}, i32 0, "
        f"ptr {frame.address(source)}, i32 {capacity}, i32 0, i32 {capacity})"
    )


def copy_literal(frame: Frame, target: Ref, text: str) -> None:
    """target := constant, cut to the target's capacity."""
    wide = _unit(target) == 2
    if not target.capacity.isdigit():
        copy_string(frame, target, literal_text(frame, text, wide=wide))
        return
    text = text[: int(target.capacity)]
    if text:
        source = replace(literal_text(frame, text, wide=wide), direct=target.direct)
        frame.copy(target, source, len(text) * _unit(target))
    _terminate(frame, target, len(text))


def literal_text(frame: Frame, text: str, *, wide: bool) -> Ref:
    """A constant string in the image."""
    t = StringType(len(text), wide)
    pointer = frame.unit.module.constant(encode_text(text + "\0", t), t.align)
    return Ref(pointer, 0, t, direct=True, capacity=str(len(text)))


def _terminate(frame: Frame, target: Ref, length: int) -> None:
    unit = _unit(target)
    end = frame.address(replace(target, offset=target.offset + length * unit))
    frame.fn.do(f"store i{8 * unit} 0, ptr {end}, align {unit}")


def compare_strings(frame: Frame, op: BinaryOp, left: Ref, right: Ref) -> str:
    """The i1 of a comparison, byte by byte, unsigned."""
    order = frame.fn.value(
        f"call i32 @{frame.unit.helper(_helper('compare', left))}(ptr {frame.address(left)}, i32 {left.capacity}, "
        f"ptr {frame.address(right)}, i32 {right.capacity})"
    )
    return compare(frame, op, order, "0", DINT)


def equals_literal(frame: Frame, ref: Ref, text: str) -> str | None:
    """The i1 of a comparison with a short constant, without a loop; None when that is not possible."""
    assert isinstance(ref.type, StringType)
    data, at = encode_text(text + "\0", ref.type), 0
    size = len(data)
    if not ref.capacity.isdigit() or size > _INLINE_COMPARE:
        return None
    if int(ref.capacity) < len(text):
        return "false"
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
