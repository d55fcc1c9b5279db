"""Calls of function blocks, and assignments to what is not a scalar."""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.codegen.ir import Value
from plctool.compiler.codegen.lower_arith import convert, is_real
from plctool.compiler.codegen.lower_frame import STATEMENTS, Frame, Ref, rule
from plctool.compiler.codegen.lower_string import copy_literal, copy_string
from plctool.compiler.codegen.lower_unit import Form
from plctool.compiler.codegen.signatures import CONTEXT, SELF, in_order, parameter_value, passed_type, returned_type
from plctool.compiler.typed.nodes import (
    Binary,
    BinaryOp,
    Const,
    Convert,
    Expr,
    FbCall,
    IntrinsicCall,
    Load,
    MemberPlace,
    Place,
    Pou,
    Storage,
    Unary,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import BOOL, PointerType, StringType, StructType, is_scalar

_POINTER = PointerType(BOOL)  # what an instance stores for a VAR_IN_OUT


@rule(STATEMENTS, FbCall)
def fb_call(frame: Frame, s: FbCall) -> None:
    """A call of an instance: inputs, the body, outputs."""
    named = frame.ref(s.instance)
    base = frame.address(named)
    instance = replace(named, pointer=base, offset=0)
    arguments = _inputs(frame, s, instance)
    for variable, place in s.in_outs:
        slot = Ref(base, variable.offset, _POINTER)
        frame.store(slot, frame.address(frame.ref(place)))
    if s.block.external:
        frame.call_import(s.block.external, "void", [f"ptr {base}"], frame.unit.external_call)
    else:
        form = frame.form_of(s.block, s.dispatch)
        handed_on = [f"ptr {frame.raised}"] if form is Form.RAISING else []
        symbol = frame.unit.target_of(s.block, s.dispatch, form)
        _call(frame, s.block, symbol, arguments, [*handed_on, f"ptr {base}"], (named, instance))
        if form is Form.RAISING:
            frame.after_call(s.pos)
    for variable, place in s.outputs:
        _copy_out(frame, _member(frame, s.block, instance, variable), frame.ref(place))


def _call(
    frame: Frame, block: Pou, symbol: str, inputs: list[str], others: list[str], instances: tuple[Ref, ...]
) -> None:
    """The call itself. `instances`: the instance, in the ways that it is reached here."""
    closed = frame.unit.closed.get(block)
    context = [CONTEXT] if closed is None or closed.has_context else []
    arguments = in_order(inputs, [*context, *others])
    if closed is None:
        frame.fn.call(symbol, arguments)
        return
    assert block.instance is not None
    tag = frame.unit.members_tag(block.instance)
    if closed.returned is None:
        frame.fn.call(symbol, arguments, tag)
        return
    value = frame.fn.call_value(returned_type(closed.returned), symbol, arguments, tag)
    for instance in instances:
        frame.note(_member(frame, block, instance, closed.returned), value)


def _inputs(frame: Frame, s: FbCall, instance: Ref) -> list[str]:
    """Stores the inputs in the instance. Returns the values of those that the block stores itself; they must be
    stored here as well before an expression that could see it."""
    handed, transient = frame.unit.handed.get(s.block, []), frame.unit.transient.get(s.block, [])
    values: dict[Variable, Value] = {}
    arguments = [argument for _, argument in s.inputs + s.in_outs]
    last = max((n for n, argument in enumerate(arguments) if not _is_plain(frame, argument, s.block)), default=0)
    stored = max((n for n, (variable, _) in enumerate(s.inputs) if variable not in handed), default=0)
    for number, (variable, value) in enumerate(s.inputs):
        if variable in transient or (variable in handed and number >= last):
            values[variable] = _passed(frame, value, lasting=number < max(last, stored))
        else:
            _assign_member(frame, _member(frame, s.block, instance, variable), value)
    for variable in handed:
        if variable not in values:
            values[variable] = frame.load(_member(frame, s.block, instance, variable))
    return [f"{passed_type(variable.type)} {values[variable]}" for variable in handed]


def _passed(frame: Frame, value: Expr, lasting: bool) -> Value:
    """What is passed: a scalar, or the address of a structure, of a copy if the block could not read it there.
    `lasting`: what else the call needs may change it."""
    if is_scalar(value.type):
        return frame.value(value)
    source = frame.aggregate(value)
    if lasting or source.unaligned:
        copy = frame.temporary(value.type)
        frame.copy(copy, source, value.type.size)
        source = copy
    return frame.address(source)


def _is_plain(frame: Frame, argument: Expr | Place, block: Pou) -> bool:
    """Whether an argument neither fails nor calls anything, nor reads an input of such a block."""
    return all(_is_plain_node(frame, node, block) for node in walk(argument))


def _is_plain_node(frame: Frame, node: object, block: Pou) -> bool:
    assert block.instance is not None
    root = block.instance.root
    if isinstance(node, Binary):
        return node.op not in (BinaryOp.DIV, BinaryOp.MOD) or is_real(node.type)
    if isinstance(node, Convert):
        return node.check is None
    if isinstance(node, VarPlace):
        own = frame.pou.instance.root if frame.pou is not None and frame.pou.instance is not None else None
        storage = node.var.storage
        return storage is not Storage.REFERENCE and (storage is not Storage.SELF or own is not root)
    if isinstance(node, MemberPlace) and isinstance(node.base.type, StructType) and node.base.type.root is root:
        return all(node.offset != variable.offset for variable in frame.unit.handed.get(block, []))
    return isinstance(node, Const | Load | Unary | IntrinsicCall | MemberPlace)


def take_inputs(frame: Frame, block: Pou) -> None:
    """Stores the inputs that the block was passed."""
    for number, variable in enumerate(frame.unit.handed.get(block, [])):
        target, t = frame.ref(VarPlace(variable, variable.type, block.pos)), variable.type
        if is_scalar(t):
            frame.store(target, parameter_value(number))
        else:
            frame.copy(target, Ref(parameter_value(number), 0, t), t.size)


def _member(frame: Frame, block: Pou, instance: Ref, variable: Variable) -> Ref:
    tag = ""
    if instance.direct and (instance.tag or instance.pointer == SELF):
        assert block.instance is not None
        tag = frame.unit.member_tag(block.instance, variable.offset)
    return instance.member(variable.offset, variable.type, tag)


def _assign_member(frame: Frame, target: Ref, value: Expr) -> None:
    if is_scalar(target.type):
        frame.store(target, frame.value(value))
    else:
        assign_aggregate(frame, target, value)


def assign_aggregate(frame: Frame, target: Ref, value: Expr) -> None:
    """target := string, array or struct."""
    if not isinstance(target.type, StringType):
        frame.copy(target, frame.aggregate(value), target.type.size)
    elif isinstance(value, Const):
        copy_literal(frame, target, str(value.value))
    else:
        copy_string(frame, target, frame.aggregate(value))


def _copy_out(frame: Frame, source: Ref, target: Ref) -> None:
    if target.bit >= 0 or is_scalar(target.type):
        wanted = BOOL if target.bit >= 0 else target.type
        frame.store(target, convert(frame, frame.load(source), source.type, wanted))
    elif isinstance(target.type, StringType):
        copy_string(frame, target, source)
    else:
        frame.copy(target, source, target.type.size)
