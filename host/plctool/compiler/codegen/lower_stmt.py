"""Statements: assignments, calls, branches."""

from __future__ import annotations

from plctool.compiler.codegen.ir import FALSE
from plctool.compiler.codegen.lengths import KnownLengths, known_by_all
from plctool.compiler.codegen.lower_blocks import assign_aggregate
from plctool.compiler.codegen.lower_calls import call_function
from plctool.compiler.codegen.lower_expr import truth
from plctool.compiler.codegen.lower_frame import STATEMENTS, Body, Ref, rule
from plctool.compiler.codegen.lower_init import initialise
from plctool.compiler.codegen.lower_splice import may_splice, splice
from plctool.compiler.codegen.lower_unit import Form, value_type
from plctool.compiler.codegen.signatures import SELF, result_in_memory
from plctool.compiler.typed.analysis import may_overlap
from plctool.compiler.typed.nodes import (
    Assign,
    Call,
    CallStatement,
    Case,
    Continue,
    DerefPlace,
    Exit,
    Expr,
    If,
    Initialise,
    Jump,
    Label,
    Load,
    Node,
    Place,
    Pou,
    Raise,
    Return,
    SelfPlace,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import root_of, walk
from plctool.iec.types import BYTE, StringType, is_scalar

_WIDEST_SWITCH = 64  # labels of one range that become cases of a switch


@rule(STATEMENTS, Assign)
def assign(frame: Body, s: Assign) -> None:
    """A scalar is stored; a larger value is built in the target where that is safe, else copied."""
    target = s.target
    if is_scalar(target.type):
        value = frame.value(s.value)
        ref = frame.ref(target)
        frame.store(ref, value)
        if value.constant is not None and isinstance(target, VarPlace) and ref.pointer == SELF:
            _fill_word(frame, ref)
    elif isinstance(s.value, Call) and _may_splice(frame, target, s.value):
        splice(frame, frame.ref(target), s.value)
    elif isinstance(s.value, Call) and _may_write_directly(frame, target, s.value):
        call_function(frame, s.value, frame.ref(target))
    else:
        assign_aggregate(frame, frame.ref(target), s.value)


def _fill_word(frame: Body, ref: Ref) -> None:
    """Zeroes the padding after a variable of the instance that holds a constant now, if all before it in the word are
    constants as well: LLVM makes one store of them, and of the constants in the words beside."""
    if ref.type.size == 1 and frame.ends_constants(ref):
        assert frame.pou is not None and frame.pou.instance is not None
        for n in range(frame.pou.instance.padding_after(ref.offset, 1)):
            frame.fn.store(f"store i8 0, ptr {frame.address(ref.member(1 + n, BYTE))}{ref.tag}")


def _may_write_directly(frame: Body, target: Place, call: Call) -> bool:
    """Whether the callee may build its result in the target: it fits, and no other code sees it half done."""
    pou = call.function
    if pou.external or not _fits(call, target) or not frame.effects.is_local(pou):
        return False
    if frame.form_of(pou, call.dispatch) is Form.RAISING:
        return False  # an exception leaves the target as it was
    root = root_of(target)
    arguments = (
        call.args[1:] if pou.in_place and _is_whole(call.args[0], root) and _is_whole(target, root) else call.args
    )
    return root is not None and all(_is_apart(frame.pou, node, root) for node in walk(arguments))


def _may_splice(frame: Body, target: Place, call: Call) -> bool:
    """Whether a call changes a string that is its first argument, and is not read by the others."""
    root = root_of(target)
    if not frame.unit.options.passes.runs("splice"):
        return False
    if root is None or not (call.args and _is_whole(target, root) and _is_whole(call.args[0], root)):
        return False
    apart = all(_is_apart(frame.pou, node, root) for node in walk(call.args[1:]))
    return apart and may_splice(frame, frame.ref(target), call)


def _is_apart(pou: Pou | None, node: Node, target: Variable) -> bool:
    """Whether a node of an argument does not name memory of the target."""
    if isinstance(node, VarPlace):
        same = node.var is target or node.var.storage is Storage.REFERENCE
        return not same and not may_overlap(node.var, target, pou)
    return not isinstance(node, DerefPlace | SelfPlace)


@rule(STATEMENTS, Initialise)
def initialised(frame: Body, s: Initialise) -> None:
    """As at the start of the program."""
    ref = frame.ref(s.place)
    frame.clear(ref)
    initialise(frame, ref, None)


@rule(STATEMENTS, Raise)
def raised(frame: Body, s: Raise) -> None:
    """An exception in any case."""
    frame.require(FALSE, s.code, s.pos)


@rule(STATEMENTS, CallStatement)
def call_statement(frame: Body, s: CallStatement) -> None:
    """A call whose result, if any, is not used."""
    call = s.call
    call_function(frame, call, frame.temporary(call.type) if result_in_memory(call.function) else None)


@rule(STATEMENTS, If)
def if_statement(frame: Body, s: If) -> None:
    """A chain of branches."""
    fn = frame.fn
    end, ways = fn.label("endif"), list[KnownLengths]()
    for condition, body in s.branches:
        frame.at(condition.pos)
        then, otherwise = fn.label("then"), fn.label("else")
        test = truth(frame, condition)
        lengths = frame.lengths()
        fn.branch_if(test, then, otherwise)
        fn.begin(then)
        frame.keep_lengths(lengths)
        frame.statements(body)
        ways += [frame.lengths()] * fn.open
        fn.branch(end)
        fn.begin(otherwise)
        frame.keep_lengths(lengths)
    frame.statements(s.otherwise)
    ways += [frame.lengths()] * fn.open
    fn.begin(end)
    frame.keep_lengths(known_by_all(ways))


@rule(STATEMENTS, Exit)
def exit_statement(frame: Body, s: Exit) -> None:
    """To what follows the loop."""
    _, following, depth = frame.loops[-1]
    frame.leave(following, depth)


@rule(STATEMENTS, Continue)
def continue_statement(frame: Body, s: Continue) -> None:
    """To the end of the iteration."""
    again, _, depth = frame.loops[-1]
    frame.leave(again, depth)


@rule(STATEMENTS, Return)
def return_statement(frame: Body, s: Return) -> None:
    """To the end of the body."""
    frame.leave(frame.on_return)


@rule(STATEMENTS, Label)
def label(frame: Body, s: Label) -> None:
    """Begins a block."""
    frame.fn.begin(frame.label(s.name))


@rule(STATEMENTS, Jump)
def jump(frame: Body, s: Jump) -> None:
    """To its label."""
    frame.jump(s.name)


@rule(STATEMENTS, Case)
def case_statement(frame: Body, s: Case) -> None:
    """A switch; wide ranges are compared before it."""
    fn, t = frame.fn, s.selector.type
    text = value_type(t)
    selector = frame.value(s.selector)
    end, default = fn.label("endcase"), fn.label("default")
    labels = [fn.label("case") for _ in s.branches]
    cases, wide = [], []
    for label, (ranges, _) in zip(labels, s.branches, strict=True):
        for low, high in ranges:
            if high - low < _WIDEST_SWITCH:
                cases += [f"{text} {value}, label %{label}" for value in range(low, high + 1)]
            else:
                wide.append((low, high, label))
    for low, high, label in wide:
        offset = fn.value(f"sub {text} {selector}, {low}")
        following = fn.label("range")
        fn.branch_if(fn.value(f"icmp ule {text} {offset}, {high - low}"), label, following)
        fn.begin(following)
    fn.terminate(f"switch {text} {selector}, label %{default} [ {' '.join(cases)} ]")
    for label, (_, body) in zip(labels, s.branches, strict=True):
        fn.begin_detached(label)
        frame.statements(body)
        fn.branch(end)
    fn.begin_detached(default)
    frame.statements(s.otherwise)
    fn.begin(end)


def _fits(call: Call, target: Place) -> bool:
    """Whether the callee stays within the memory of the target."""
    result, t = call.type, target.type
    if isinstance(result, StringType) and isinstance(t, StringType):
        return call.function.cuts_result or result.length <= t.length
    return result == t


def _is_whole(argument: Expr | Place | None, variable: Variable | None) -> bool:
    """Whether an argument is just that variable."""
    place = argument.place if isinstance(argument, Load) else argument
    return isinstance(place, VarPlace) and place.var is variable
