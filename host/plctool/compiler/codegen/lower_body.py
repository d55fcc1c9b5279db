"""The bodies of POUs, from the first local variable to the return."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from plctool.compiler.codegen import (  # noqa: F401  their rules
    lower_exceptions,
    lower_expr,
    lower_loops,
    lower_places,
    lower_stmt,
)
from plctool.compiler.codegen.ir import Value
from plctool.compiler.codegen.lower_blocks import take_inputs
from plctool.compiler.codegen.lower_frame import NO_CAPACITY, Body, Ref, string_capacity
from plctool.compiler.codegen.lower_init import initialise
from plctool.compiler.codegen.lower_string import copy_string
from plctool.compiler.codegen.lower_unit import Form, value_type
from plctool.compiler.codegen.signatures import (
    CONTEXT,
    RESULT,
    RESULT_CAPACITY,
    SELF,
    parameter_capacity,
    parameter_length,
    parameter_value,
    result_in_memory,
    returned_variable,
)
from plctool.compiler.typed.nodes import Direction, Pou, PouKind, Variable, VarPlace
from plctool.debug.frames import INSTANCE, POINTER_TO
from plctool.iec.types import OpenArrayType, StringType, is_scalar


def write_body(frame: Body) -> None:
    """Writes everything from the first local variable to the return."""
    pou, fn = frame.pou, frame.fn
    assert pou is not None
    if pou.kind in (PouKind.FUNCTION, PouKind.METHOD):
        _take_parameters(frame, pou)
        _begin_outputs(frame, pou)
    for var in frame.unit.transient.get(pou, ()):
        frame.locals[var] = _stack_memory(frame, var)
    take_inputs(frame, pou)
    if pou.result is not None and result_in_memory(pou):
        capacity = RESULT_CAPACITY if pou.cuts_result else string_capacity(pou.result.type)
        frame.locals[pou.result] = Ref(RESULT, 0, pou.result.type, direct=True, capacity=capacity)
    for var in pou.locals:
        if var not in frame.locals:
            frame.locals[var] = _stack_memory(frame, var)
        if not (pou.no_init or (pou.cuts_result and var is pou.result)):  # whose size is the caller's
            frame.clear(frame.locals[var])
        initialise(frame, frame.locals[var], var.initial)
    if frame.unit.options.steps:
        _declare_variables(frame, pou)
    frame.statements(pou.body)
    fn.begin(frame.on_return)
    _give_outputs(frame, pou)
    returned = returned_variable(pou, frame.unit.closed.get(pou))
    if returned is None:
        fn.terminate("ret void")
    else:
        value = frame.load(frame.ref(VarPlace(returned, returned.type, pou.pos)))
        fn.terminate(f"ret {value_type(returned.type)} {value}")
    frame.write_raises()


def _declare_variables(frame: Body, pou: Pou) -> None:
    """Has the debugging information say where the variables on the stack are, or pointers to others."""
    for var, ref in frame.locals.items():
        if ref.direct and ref.pointer != RESULT:
            frame.declare_variable(var.name, ref.pointer)
        else:
            frame.declare_variable(POINTER_TO + var.name, _spilled(frame, ref.pointer))
    if pou.instance is not None:
        frame.declare_variable(POINTER_TO + INSTANCE, _spilled(frame, SELF))


def _spilled(frame: Body, pointer: Value) -> Value:
    """The place on the stack where a pointer is kept for debuggers."""
    slot = frame.fn.slot("ptr")
    frame.fn.do(f"store volatile ptr {pointer}, ptr {slot}")
    return slot


def write_calls(frame: Body, parts: list[str]) -> None:
    """Writes calls of the parts that the body was cut into, or of a program and what connects it. They are no calls of
    the source, so they have no line, and their function no name that a call stack would show."""
    assert frame.pou is not None
    frame.open_scope("", frame.pou.pos._replace(line=0))
    take_inputs(frame, frame.pou)
    instance = [f"ptr {SELF}"] if frame.pou.kind is PouKind.FUNCTION_BLOCK else []
    handed_on = [] if frame.raised is None else [f"ptr {frame.raised}"]
    for symbol in parts:
        frame.fn.call(symbol, [CONTEXT, *handed_on, *instance])
        if handed_on:
            frame.after_call(frame.pou.pos)
    frame.fn.terminate("ret void")
    frame.write_raises()


def _stack_memory(frame: Body, var: Variable) -> Ref:
    t = var.type
    if is_scalar(t):
        return frame.scalar(t)
    return Ref(frame.fn.alloca(t.size, t.align), 0, t, direct=True, capacity=string_capacity(t))


def _own_outputs(pou: Pou) -> Iterator[tuple[int, Variable]]:
    """The outputs of a function that are variables of its own until it returns, with their numbers: so they start at
    their initial values, whatever else the caller's variables are, and an exception leaves those alone. Others are of
    any length (ARRAY[*]), or of the library."""
    if pou.kind in (PouKind.FUNCTION, PouKind.METHOD) and not pou.no_init:
        for number, parameter in enumerate(pou.parameters):
            is_open = isinstance(parameter.variable.type, OpenArrayType)
            if parameter.direction is Direction.OUTPUT and not is_open:
                yield number, parameter.variable


def _begin_outputs(frame: Body, pou: Pou) -> None:
    for _, var in _own_outputs(pou):
        ref = frame.locals[var] = _stack_memory(frame, var)
        frame.clear(ref)
        initialise(frame, ref, var.initial)


def _give_outputs(frame: Body, pou: Pou) -> None:
    for number, var in _own_outputs(pou):
        given, own = Ref(parameter_value(number), 0, var.type), frame.locals[var]
        if is_scalar(var.type):
            frame.store(given, frame.load(own))
        elif isinstance(var.type, StringType):
            copy_string(frame, replace(given, capacity=parameter_capacity(number)), own)
        else:
            frame.copy(given, own, var.type.size)


def _take_parameters(frame: Body, pou: Pou) -> None:
    for number, parameter in enumerate(pou.parameters):
        var, given, room = parameter.variable, parameter_value(number), parameter_capacity(number)
        if parameter.by_reference:
            capacity = room if isinstance(var.type, StringType) else NO_CAPACITY
            length = parameter_length(number) if capacity and frame.form is Form.MEASURED else None
            frame.locals[var] = Ref(given, 0, var.type, capacity=capacity, length=length)
            continue
        ref = _stack_memory(frame, var)
        frame.locals[var] = ref
        if is_scalar(var.type):
            frame.store(ref, given)
        elif isinstance(var.type, StringType):
            copy_string(frame, ref, Ref(given, 0, var.type, capacity=room))
        else:
            frame.copy(ref, Ref(given, 0, var.type), var.type.size)
