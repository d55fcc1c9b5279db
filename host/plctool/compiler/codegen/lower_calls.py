"""Calls of functions and methods."""

from __future__ import annotations

from plctool.compiler.codegen.ir import Value, number
from plctool.compiler.codegen.lengths import is_appending, is_measuring, length_variable
from plctool.compiler.codegen.lower_arith import convert, is_bool, lowest_bit
from plctool.compiler.codegen.lower_frame import Body, Frame, Ref
from plctool.compiler.codegen.lower_places import materialised
from plctool.compiler.codegen.lower_string import append_string
from plctool.compiler.codegen.lower_unit import value_type
from plctool.compiler.codegen.signatures import CONTEXT, extension, parameter_types
from plctool.compiler.typed import (
    Call,
    Direction,
    Dispatch,
    Expr,
    Load,
    Parameter,
    Place,
    Pou,
    VarPlace,
)
from plctool.iec.types import StringType, is_scalar

_LONGEST = 32_767  # characters that LEN gives


def call_function(frame: Frame, e: Call, result: Ref | None) -> Value | None:
    """Calls a function. `result`: where a string, array or struct goes; scalars are returned."""
    pou = e.function
    if is_measuring(pou):
        length = _known_length(frame, e.args[0])
        if length is not None:
            return length
    write_back: list[tuple[Ref, Ref]] = []
    arguments = [] if pou.external else [CONTEXT]
    raises = frame.returns_exceptions(pou, e.dispatch)
    if raises:
        arguments.append(f"ptr {frame.raised}")
    if e.instance is not None:
        arguments.append(f"ptr {frame.address(frame.ref(e.instance))}")
    if result is not None and result.unaligned:
        temporary = frame.temporary(result.type)
        write_back.append((temporary, result))
        result = temporary
    if result is not None:
        arguments.append(f"ptr {frame.address(result)}")
        arguments += [f"i32 {_result_capacity(frame, pou, result)}"] if pou.cuts_result else []
    for parameter, argument in zip(pou.parameters, e.args, strict=True):
        operands = _operands(frame, pou, parameter, argument, write_back)
        types = parameter_types(pou, parameter)
        arguments += [f"{text} {operand}" for text, operand in zip(types, operands, strict=True)]
    known = frame.lengths() if _leaves_strings(frame, e) else {}
    length = _appended(frame, e, result, arguments)
    value = _call_instruction(frame, pou, e.dispatch, arguments, raises=raises) if length is None else length
    if result is not None and length_variable(pou) is not None:
        assert value is not None
        frame.note_length(result, value, known)
    elif result is None or (result.direct and result.pointer.fixed):
        written = None if result is None else (result.pointer, result.offset)
        frame.keep_lengths({place: length for place, length in known.items() if place != written})
    if raises:
        frame.after_call(e.pos)
    for temporary, place in write_back:
        if is_scalar(place.type):
            wanted = temporary.type if place.bit >= 0 else place.type
            frame.store(place, convert(frame, frame.load(temporary), temporary.type, wanted))
        else:
            frame.copy(place, temporary, place.type.size)
    return value


def _known_length(frame: Frame, argument: Expr | Place | None) -> Value | None:
    """What LEN gives, if that is known."""
    place = argument.place if isinstance(argument, Load) else argument
    if not isinstance(place, VarPlace):
        return None
    ref = frame.ref(place)
    length, capacity = frame.length(ref), ref.capacity.constant
    if length is None or capacity is None or capacity > _LONGEST:
        return None
    return number(length.constant) if length.constant is not None else frame.fn.value(f"trunc i32 {length} to i16")


def _appended(frame: Frame, e: Call, result: Ref | None, arguments: list[str]) -> Value | None:
    """Adds the second argument to a string that is the first one and the result, if its length is known. Returns the
    new length."""
    if not is_appending(e.function) or result is None or f"ptr {frame.address(result)}" != arguments[3]:
        return None
    length, capacity = frame.length(result), _result_capacity(frame, e.function, result)
    if length is None or capacity != result.capacity:
        return None
    pointer, room = (Value(text.split()[1]) for text in arguments[5:7])
    return append_string(frame, result, length, capacity, Ref(pointer, 0, result.type, capacity=room))


def _leaves_strings(frame: Frame, e: Call) -> bool:
    """Whether a call writes nothing but its result."""
    inputs = all(parameter.direction is Direction.INPUT for parameter in e.function.parameters)
    return inputs and e.dispatch is None and isinstance(frame, Body) and frame.effects.is_local(e.function)


def _result_capacity(frame: Frame, pou: Pou, result: Ref) -> Value:
    """How much of a string result there is room for: at most what the function declares."""
    assert pou.result is not None
    assert isinstance(pou.result.type, StringType)
    declared = pou.result.type.length
    if result.capacity.constant is not None:
        return number(min(declared, result.capacity.constant))
    return frame.fn.value(f"call i32 @llvm.umin.i32(i32 {declared}, i32 {result.capacity})")


def _call_instruction(
    frame: Frame, pou: Pou, dispatch: Dispatch | None, arguments: list[str], *, raises: bool
) -> Value | None:
    unit, fn = frame.unit, frame.fn
    result = pou.result.type if pou.result is not None and is_scalar(pou.result.type) else None
    if pou.external:
        target = frame.import_function(unit.import_slot(pou.external))
        convention = f"{unit.target.external_convention} " if unit.target.external_convention else ""
        returned = "void" if result is None else f"{extension(result)} {value_type(result)}".lstrip()
        text = f"call {convention}{returned} {target}({', '.join(arguments)}) {unit.external_call}"
        if result is not None:
            return fn.value(text)
        fn.do(text)
        return None
    symbol = unit.target_of(pou, dispatch, raises=raises)
    if length_variable(pou) is not None:
        return fn.call_value("i32", symbol, arguments)
    if result is not None:
        return fn.call_value(value_type(result), symbol, arguments)
    fn.call(symbol, arguments)
    return None


def _operands(
    frame: Frame, pou: Pou, parameter: Parameter, argument: Expr | Place | None, write_back: list[tuple[Ref, Ref]]
) -> list[Value]:
    """The operands that carry one argument."""
    t = parameter.variable.type
    if argument is None:  # an output that is not used
        ref = frame.temporary(t)
    elif not isinstance(argument, Place):
        if is_scalar(t) and not parameter.by_reference:
            value = frame.value(argument)
            return [lowest_bit(frame, value)] if pou.external and is_bool(t) else [value]
        ref = _aligned(frame, materialised(frame, argument))
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
        elif ref.unaligned:
            temporary = _aligned(frame, ref)
            if parameter.direction is not Direction.INPUT:
                write_back.append((temporary, ref))
            ref = temporary
    return [frame.address(ref), ref.capacity] if isinstance(t, StringType) else [frame.address(ref)]


def _aligned(frame: Frame, ref: Ref) -> Ref:
    """A variable, or a copy of it where the callee could not read it at its address."""
    if not ref.unaligned:
        return ref
    copy = frame.temporary(ref.type)
    if is_scalar(ref.type):
        frame.store(copy, frame.load(ref))
    else:
        frame.copy(copy, ref, ref.type.size)
    return copy
