"""Strings: copying with cutting, comparing.

A STRING is a run of bytes up to a NUL or the capacity, whichever comes first: no memory content makes these functions
read or write outside of it. Bytes after the NUL have no meaning and may be overwritten.
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.codegen.ir import FALSE, TRUE, Value, number
from plctool.compiler.codegen.lower_arith import compare
from plctool.compiler.codegen.lower_frame import Frame, Ref
from plctool.compiler.typed.nodes import BinaryOp
from plctool.iec.types import DINT, StringType

_INLINE_COPY = 128  # bytes that LLVM copies with a few vector moves
_SHORT_COPY = 16  # bytes that it copies without vectors, but with unaligned words
_TINY_COPY = 4
_INLINE_COMPARE = 16


def copy_string(frame: Frame, target: Ref, source: Ref) -> None:
    """target := source, cut to the target's capacity."""
    known, lengths = frame.length(source), frame.lengths()
    if target.crosses(source):
        whole = frame.temporary(source.type)
        frame.copy(whole, source, source.type.size)
        source = whole
    if target.capacity.constant is not None and source.capacity.constant is not None:
        length = min(target.capacity.constant, source.capacity.constant)
        target_machine = frame.unit.target
        inline = _INLINE_COPY if target_machine.vectors else _SHORT_COPY if target_machine.unaligned else _TINY_COPY
        if length * _unit(target) <= (inline if known is None else min(inline, _SHORT_COPY)):
            frame.copy(target, source, length * _unit(target))
            _terminate(frame, target, length)
            frame.note_length(target, None if known is None else least(frame, known, number(length)), lengths)
            return
    frame.note_length(target, append_string(frame, target, number(0), target.capacity, source), lengths)


def append_string(frame: Frame, target: Ref, length: Value, capacity: Value, source: Ref) -> Value:
    """Adds `source` to a string of the length `length`, up to `capacity`. Returns the new length."""
    known = frame.length(source)
    target = replace(target, capacity=capacity)
    if known is not None:
        return move_characters(frame, target, length, source, number(0), known)
    return _copy(frame, "copy", target, length, source, number(0), source.capacity)


def move_characters(frame: Frame, target: Ref, position: Value, source: Ref, start: Value, count: Value) -> Value:
    """Puts `count` characters of `source` from `start` on, which are there, into a string at `position`, and ends it
    there. Returns its new length."""
    return _copy(frame, "move", target, position, source, start, count)


def splice_characters(frame: Frame, target: Ref, position: Value, text: Ref, start: Value, count: Value) -> Value:
    """Puts all of `text`, whose length is known, into a string at `position`, and after it `count` characters of the
    string itself from `start` on, which are there, and ends it there. Returns its new length."""
    assert isinstance(target.type, StringType) and target.capacity.constant is not None
    tail = frame.temporary(StringType(target.capacity.constant, target.type.wide))
    frame.unit.helper(_helper("move", target))  # which the other one calls
    arguments = [f"ptr {frame.address(target)}", f"i32 {target.capacity}", f"i32 {position}"]
    arguments += [f"ptr {frame.address(text)}", f"i32 {text.capacity}", f"i32 {text.length}"]
    arguments += [f"i32 {start}", f"i32 {count}", f"ptr {frame.address(tail)}"]
    return frame.fn.call_value("i32", frame.unit.helper(_helper("splice", target)), ["ptr null", *arguments])


def _copy(frame: Frame, helper: str, target: Ref, position: Value, source: Ref, start: Value, count: Value) -> Value:
    arguments = [f"ptr {frame.address(target)}", f"i32 {target.capacity}", f"i32 {position}"]
    arguments += [f"ptr {frame.address(source)}", f"i32 {source.capacity}", f"i32 {start}", f"i32 {count}"]
    return frame.fn.call_value("i32", frame.unit.helper(_helper(helper, target)), ["ptr null", *arguments])


def span(frame: Frame, ref: Ref) -> Value:
    """How many characters a string has, found by looking for its end."""
    arguments = ["ptr null", f"ptr {frame.address(ref)}", f"i32 {ref.capacity}", "i32 0", f"i32 {ref.capacity}"]
    lengths = frame.lengths()
    length = frame.fn.call_value("i32", frame.unit.helper(_helper("span", ref)), arguments)
    frame.keep_lengths(lengths)
    return length


def least(frame: Frame, one: Value, other: Value) -> Value:
    """The lower of two numbers of characters."""
    if one.constant is not None and other.constant is not None:
        return number(min(one.constant, other.constant))
    return frame.fn.value(f"call i32 @llvm.umin.i32(i32 {one}, i32 {other})")


def copy_literal(frame: Frame, target: Ref, text: str) -> None:
    """target := constant, cut to the target's capacity."""
    wide = _unit(target) == 2
    if target.capacity.constant is None:
        copy_string(frame, target, literal_text(frame, text, wide=wide))
        return
    text, lengths = text[: target.capacity.constant], frame.lengths()
    if text:
        source = replace(literal_text(frame, text, wide=wide), direct=target.direct)
        frame.copy(target, source, len(text) * _unit(target))
    _terminate(frame, target, len(text))
    frame.note_length(target, _length_of(text), lengths)


def literal_text(frame: Frame, text: str, *, wide: bool) -> Ref:
    """A constant string in the image."""
    t = StringType(len(text), wide)
    pointer = frame.unit.module.constant(encode_text(text + "\0", t), t.align)
    return Ref(pointer, 0, t, direct=True, capacity=number(len(text)), length=_length_of(text))


def _length_of(text: str) -> Value:
    return number(len(_up_to_nul(text)))


def _up_to_nul(text: str) -> str:
    """What a constant means that has a NUL ('ab$00c')."""
    return text.partition("\0")[0]


def _terminate(frame: Frame, target: Ref, length: int) -> None:
    unit = _unit(target)
    end = frame.address(replace(target, offset=target.offset + length * unit))
    frame.fn.do(f"store i{8 * unit} 0, ptr {end}, align {unit}")


def compare_strings(frame: Frame, op: BinaryOp, left: Ref, right: Ref) -> Value:
    """The i1 of a comparison, byte by byte, unsigned."""
    arguments = [text for ref in (left, right) for text in (f"ptr {frame.address(ref)}", f"i32 {ref.capacity}")]
    lengths = frame.lengths()
    order = frame.fn.call_value("i32", frame.unit.helper(_helper("compare", left)), arguments)
    frame.keep_lengths(lengths)
    return compare(frame, op, order, number(0), DINT)


def equals_literal(frame: Frame, ref: Ref, text: str) -> Value | None:
    """The i1 of a comparison with a short constant, without a loop; None when that is not possible."""
    assert isinstance(ref.type, StringType)
    text, capacity = _up_to_nul(text), ref.capacity.constant
    if capacity is None:
        return None
    end = "\0" if len(text) < capacity else ""  # a string that fills its variable may have none
    data, at = encode_text(text + end, ref.type), 0
    size = len(data)
    if size > _INLINE_COMPARE:
        return None
    if capacity < len(text):
        return FALSE
    if not size:
        return TRUE
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
