"""`s := INSERT(s, ...)`, DELETE and REPLACE: what is before the position stays where it is, the rest moves within the
string, so that it is copied once and needs no other string for the result."""

from __future__ import annotations

from dataclasses import dataclass, replace

from plctool.compiler.codegen.ir import Value, number
from plctool.compiler.codegen.lower_calls import is_changing, operand
from plctool.compiler.codegen.lower_frame import Body, Ref
from plctool.compiler.codegen.lower_string import least, move_characters, span, splice_characters
from plctool.compiler.typed.nodes import Call
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import StringType

_SPLICING = {
    name: kind for kind in ("INSERT", "DELETE", "REPLACE") for name in (kind, f"{kind}__WSTRING", f"W{kind}")
}  # the functions of stdlib/strings.st that this does


@dataclass(frozen=True)
class _Splice:
    """What is put in place of how many characters at which index; all are at least 0, and any number above the length
    stands for the end."""

    text: Ref | None
    removed: Value
    index: Value


def may_splice(frame: Body, target: Ref, call: Call) -> bool:
    """Whether a call that assigns its result to its own first argument, and reads it only there, is done in place."""
    result, capacity = call.function.result, target.capacity.constant
    if not call.function.no_init or call.function.name not in _SPLICING or capacity is None or result is None:
        return False
    assert isinstance(result.type, StringType)
    others = (node for argument in call.args[1:] if argument is not None for node in walk(argument))
    return capacity <= result.type.length and not any(is_changing(frame, node) for node in others)


def splice(frame: Body, target: Ref, call: Call) -> None:
    """Does it."""
    change = _evaluated(frame, call)
    known = frame.lengths()
    length = frame.length(target) or span(frame, target)
    text = change.text and replace(change.text, length=frame.length(change.text) or span(frame, change.text))
    index = least(frame, change.index, length)
    rest = frame.fn.value(f"sub i32 {length}, {index}")
    removed = least(frame, change.removed, rest)
    start, count = frame.fn.value(f"add i32 {index}, {removed}"), frame.fn.value(f"sub i32 {rest}, {removed}")
    if text is None:
        end = move_characters(frame, target, index, target, start, count)
    else:
        end = splice_characters(frame, target, index, text, start, count)
    frame.note_length(target, end, known)


def _evaluated(frame: Body, call: Call) -> _Splice:
    """The arguments after the first one."""
    values = [
        operand(frame, call.function, parameter, argument, [], ())
        for parameter, argument in zip(call.function.parameters[1:], call.args[1:], strict=True)
    ]
    text = values.pop(0) if isinstance(values[0], Ref) else None
    assert text is None or isinstance(text, Ref)
    removed, position = (number(0), values[0]) if len(values) == 1 else values
    assert isinstance(removed, Value) and isinstance(position, Value)
    if _SPLICING[call.function.name] == "INSERT":
        return _Splice(text, removed, _at_least(frame, position, 0))
    return _Splice(text, _at_least(frame, removed, 0), _less_one(frame, _at_least(frame, position, 1)))


def _at_least(frame: Body, value: Value, limit: int) -> Value:
    if value.constant is not None:
        return number(max(value.constant, limit))
    return frame.fn.value(f"call i32 @llvm.smax.i32(i32 {value}, i32 {limit})")


def _less_one(frame: Body, value: Value) -> Value:
    return number(value.constant - 1) if value.constant is not None else frame.fn.value(f"sub i32 {value}, 1")
