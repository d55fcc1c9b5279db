"""Calls of functions and methods."""

from __future__ import annotations

from collections.abc import Sequence

from plctool.compiler.codegen.ir import Value, number
from plctool.compiler.codegen.lengths import (
    is_appending,
    is_copying,
    is_measuring,
    is_spanning,
    length_variable,
    takes_lengths,
)
from plctool.compiler.codegen.lower_arith import convert, is_bool, to_bool
from plctool.compiler.codegen.lower_frame import Body, Frame, Ref
from plctool.compiler.codegen.lower_places import materialised
from plctool.compiler.codegen.lower_string import append_string, copy_string, least, move_characters
from plctool.compiler.codegen.lower_unit import Form, value_type
from plctool.compiler.codegen.signatures import CONTEXT, parameter_types, returned_type, returned_variable
from plctool.compiler.typed.nodes import (
    AssignedValue,
    Call,
    Const,
    Direction,
    Dispatch,
    Expr,
    IntrinsicCall,
    Load,
    Parameter,
    Place,
    Pou,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import BOOL, OpenArrayType, StringType, is_scalar

_LONGEST = 32_767  # characters that LEN gives

Operand = Value | Ref  # a scalar, or what is passed by its address


def call_function(frame: Frame, e: Call, result: Ref | None) -> Value | None:
    """Calls a function. `result`: where a string, array or struct goes; scalars are returned."""
    pou = e.function
    known_value = _without_scanning(frame, e)
    if known_value is not None:
        return known_value
    write_back: list[tuple[Ref, Ref]] = []
    arguments = [] if pou.external else [CONTEXT]
    form = frame.form_of(pou, e.dispatch)
    if form is Form.RAISING:
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
    given = [
        operand(frame, pou, parameter, argument, write_back, e.args[n:])
        for n, (parameter, argument) in enumerate(zip(pou.parameters, e.args, strict=True), 1)
    ]
    if takes_lengths(pou) and all(frame.length(ref) for ref in given if isinstance(ref, Ref)):
        form = Form.MEASURED
    for parameter, passed in zip(pou.parameters, given, strict=True):
        types = parameter_types(pou, parameter, form)
        values = _values(frame, passed, form)
        arguments += [f"{text} {value}" for text, value in zip(types, values, strict=True)]
    known = frame.lengths() if _leaves_strings(frame, e) else {}
    length = _appended(frame, e, result, given)
    value = _call_instruction(frame, pou, e.dispatch, arguments, form) if length is None else length
    if result is not None:
        frame.note_length(result, value if length_variable(pou) is not None else None, known)
    else:
        frame.keep_lengths(known)
    if form is Form.RAISING:
        frame.after_call(e.pos)
    for temporary, place in write_back:
        if is_scalar(place.type):
            wanted = temporary.type if place.bit >= 0 else place.type
            frame.store(place, convert(frame, frame.load(temporary), temporary.type, wanted))
        else:
            frame.copy(place, temporary, place.type.size)
    return value


def _without_scanning(frame: Frame, e: Call) -> Value | None:
    """What LEN, SPAN__ and COPY__ give of a string whose length is known."""
    number_of_string = 2 if is_copying(e.function) else 0
    if not (number_of_string or is_measuring(e.function) or is_spanning(e.function)):
        return None
    argument = e.args[number_of_string]
    place = argument.place if isinstance(argument, Load) else argument
    if not isinstance(place, VarPlace | Const):
        return None
    string = frame.aggregate(place) if isinstance(place, Const) else frame.ref(place)
    length = frame.length(string)
    if length is None:
        return None
    if is_measuring(e.function):
        return _measured(frame, length)
    start, most = (frame.value(argument) for argument in e.args[-2:] if isinstance(argument, Expr))
    left = frame.fn.value(f"sub i32 {length}, {start}")
    count = least(frame, left, most)
    if is_spanning(e.function):
        return frame.fn.value(f"add i32 {start}, {count}")
    target, position = e.args[:2]
    assert isinstance(target, Place) and isinstance(position, Expr)
    return move_characters(frame, frame.ref(target), frame.value(position), string, start, count)


def _measured(frame: Frame, length: Value) -> Value:
    """What LEN gives."""
    shown = least(frame, length, number(_LONGEST))
    return shown if shown.constant is not None else frame.fn.value(f"trunc i32 {shown} to i16")


def _appended(frame: Frame, e: Call, result: Ref | None, given: list[Operand]) -> Value | None:
    """Adds the second argument to a string that is the first one and the result, if its length is known. Returns the
    new length."""
    if not is_appending(e.function) or result is None:
        return None
    whole, added = given[:2]
    assert isinstance(whole, Ref) and isinstance(added, Ref)
    length, capacity = frame.length(result), _result_capacity(frame, e.function, result)
    if frame.address(whole) != frame.address(result) or length is None or capacity != result.capacity:
        return None
    return append_string(frame, result, length, capacity, added)


def _leaves_strings(frame: Frame, e: Call) -> bool:
    """Whether a call writes nothing but its result."""
    inputs = all(parameter.direction is Direction.INPUT for parameter in e.function.parameters)
    return inputs and e.dispatch is None and isinstance(frame, Body) and frame.effects.is_local(e.function)


def _result_capacity(frame: Frame, pou: Pou, result: Ref) -> Value:
    """How much of a string result there is room for: at most what the function declares."""
    assert pou.result is not None
    assert isinstance(pou.result.type, StringType)
    declared = pou.result.type.length
    return least(frame, result.capacity, number(declared))


def _call_instruction(
    frame: Frame, pou: Pou, dispatch: Dispatch | None, arguments: list[str], form: Form
) -> Value | None:
    unit, fn = frame.unit, frame.fn
    returned = returned_variable(pou, None)
    if pou.external:
        value = frame.call_import(pou.external, returned_type(returned), arguments, unit.external_call)
        if value is not None and returned is not None and is_bool(returned.type):
            return to_bool(frame, value, BOOL)  # TRUE is not 1 everywhere in C
        return value
    symbol = unit.target_of(pou, dispatch, form)
    if returned is not None:
        return fn.call_value(returned_type(returned), symbol, arguments)
    fn.call(symbol, arguments)
    return None


def operand(
    frame: Frame,
    pou: Pou,
    parameter: Parameter,
    argument: Expr | Place | None,
    write_back: list[tuple[Ref, Ref]],
    later: Sequence[Expr | Place | None],
) -> Operand:
    """What carries one argument. What it is made of may be changed by those that come `later`."""
    t = parameter.variable.type
    if argument is None:  # an output that is not used
        ref = frame.temporary(t)
    elif not isinstance(argument, Place):
        if is_scalar(t) and not parameter.by_reference:
            return frame.value(argument)
        ref = _aligned(frame, materialised(frame, argument))
        if isinstance(argument, Load | IntrinsicCall):
            ref = lasting(frame, ref, *later)
    else:
        ref = frame.ref(argument)
        if parameter.direction is Direction.INPUT and is_scalar(t) and not parameter.by_reference:
            return frame.load(ref)
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
        if parameter.direction is Direction.INPUT:
            ref = lasting(frame, ref, *later)
    return ref


def lasting(frame: Frame, ref: Ref, *later: Expr | Place | None) -> Ref:
    """A string, array or structure as it is now: a copy, if what is worked out later may write variables. A string
    of the caller that is longer than its type says stays where it is."""
    parts = (part for node in later if node is not None for part in walk(node))
    if (
        is_scalar(ref.type)
        or isinstance(ref.type, OpenArrayType)
        or not any(is_changing(frame, part) for part in parts)
    ):
        return ref
    if not isinstance(ref.type, StringType):
        copy = frame.temporary(ref.type)
        frame.copy(copy, ref, ref.type.size)
        return copy
    capacity = ref.capacity.constant
    copy = frame.temporary(StringType(ref.type.length if capacity is None else capacity, ref.type.wide))
    copy_string(frame, copy, ref)
    if capacity is not None:
        return copy
    fits = frame.fn.value(f"icmp ule i32 {ref.capacity}, {copy.capacity}")
    pointer = frame.fn.value(f"select i1 {fits}, ptr {frame.address(copy)}, ptr {frame.address(ref)}")
    return Ref(pointer, 0, ref.type, capacity=ref.capacity)


def is_changing(frame: Frame, node: object) -> bool:
    """Whether it may change variables that are not its own."""
    if not isinstance(node, Call):
        return isinstance(node, AssignedValue)
    return node.instance is not None or not _leaves_strings(frame, node)


def _values(frame: Frame, operand: Operand, form: Form) -> list[Value]:
    """The values that an operand is passed as: of a string its capacity and, if the function takes them, its length."""
    if not isinstance(operand, Ref):
        return [operand]
    found = [frame.address(operand)]
    if isinstance(operand.type, StringType):
        found.append(operand.capacity)
        length = frame.length(operand)
        found += [length] if form is Form.MEASURED and length is not None else []
    return found


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
