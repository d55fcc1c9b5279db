"""Calls of functions and methods."""

from __future__ import annotations

from plctool.compiler.codegen.lower_arith import convert, is_bool, lowest_bit
from plctool.compiler.codegen.lower_frame import Frame, Ref, string_capacity
from plctool.compiler.codegen.lower_places import materialised
from plctool.compiler.codegen.lower_unit import value_type
from plctool.compiler.codegen.signatures import extended, parameter_types
from plctool.compiler.typed import (
    Call,
    Direction,
    Dispatch,
    Expr,
    Parameter,
    Place,
    Pou,
)
from plctool.iec.types import StringType, is_scalar


def call_function(frame: Frame, e: Call, result: Ref | None) -> str:
    """Calls a function. `result`: where a string, array or struct goes; scalars are returned."""
    pou = e.function
    write_back: list[tuple[Ref, Ref]] = []
    arguments = [] if pou.external else ["ptr %ctx"]
    if e.instance is not None:
        arguments.append(f"ptr {frame.address(frame.ref(e.instance))}")
    if result is not None:
        arguments.append(f"ptr {frame.address(result)}")
        arguments += [f"i32 {_result_capacity(frame, pou, result)}"] if pou.cuts_result else []
    for parameter, argument in zip(pou.parameters, e.args, strict=True):
        operands = _operands(frame, pou, parameter, argument, write_back)
        types = parameter_types(pou, parameter)
        arguments += [f"{text} {operand}" for text, operand in zip(types, operands, strict=True)]
    value = _call_instruction(frame, pou, e.dispatch, arguments)
    for temporary, place in write_back:
        wanted = temporary.type if place.bit >= 0 else place.type
        frame.store(place, convert(frame, frame.load(temporary), temporary.type, wanted))
    return value


def _result_capacity(frame: Frame, pou: Pou, result: Ref) -> str:
    """How much of a string result there is room for: at most what the function declares."""
    assert pou.result is not None
    declared = string_capacity(pou.result.type)
    if result.capacity.isdigit():
        return str(min(int(declared), int(result.capacity)))
    return frame.fn.value(f"call i32 @llvm.umin.i32(i32 {declared}, i32 {result.capacity})")


def _call_instruction(frame: Frame, pou: Pou, dispatch: Dispatch | None, arguments: list[str]) -> str:
    unit, fn = frame.unit, frame.fn
    returns = pou.result is not None and is_scalar(pou.result.type)
    text, attributes = "void", ""
    if pou.external:
        target = frame.import_function(unit.import_slot(pou.external))
        attributes = f" {unit.external_call}"
        convention = f"{unit.target.external_convention} " if unit.target.external_convention else ""
    else:
        target, convention = f"@{unit.target_of(pou, dispatch)}", ""
    if not returns:
        fn.do(f"call {convention}void {target}({', '.join(arguments)}){attributes}")
        return ""
    assert pou.result is not None
    t = pou.result.type
    text = value_type(t)
    if pou.external:
        words = extended(t).split()
        text = " ".join(reversed(words))
        return fn.value(f"call {convention}{text} {target}({', '.join(arguments)}){attributes}")
    return fn.value(f"call {text} {target}({', '.join(arguments)})")


def _operands(
    frame: Frame, pou: Pou, parameter: Parameter, argument: Expr | Place | None, write_back: list[tuple[Ref, Ref]]
) -> list[str]:
    """The operands that carry one argument."""
    t = parameter.variable.type
    if argument is None:  # an output that is not used
        ref = frame.temporary(t)
    elif not isinstance(argument, Place):
        if is_scalar(t) and not parameter.by_reference:
            value = frame.value(argument)
            return [lowest_bit(frame, value)] if pou.external and is_bool(t) else [value]
        ref = materialised(frame, argument)
    else:
        ref = frame.ref(argument)
        if parameter.direction is Direction.INPUT and is_scalar(t) and not parameter.by_reference:
            return [frame.load(ref)]
        if ref.bit >= 0 or (is_scalar(t) and value_type(t) != value_type(ref.type)):
            temporary = frame.temporary(t)  # bits have no address; outputs may become a number of another width
            if parameter.direction is not Direction.OUTPUT:
                frame.store(temporary, frame.load(ref))
            write_back.append((temporary, ref))
            ref = temporary
    return [frame.address(ref), ref.capacity] if isinstance(t, StringType) else [frame.address(ref)]
