"""Values of expressions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeVar

from plctool.compiler.codegen.ir import FALSE, TRUE, Value
from plctool.compiler.codegen.lower_arith import (
    COMPARISONS,
    LOGIC,
    absolute,
    binary,
    bitcast,
    compare,
    constant,
    convert,
    divide,
    extreme,
    is_bool,
    is_not_zero,
    known_integer,
    rotate,
    select,
    shift,
    square_root,
    unary,
)
from plctool.compiler.codegen.lower_blocks import assign_aggregate
from plctool.compiler.codegen.lower_calls import call_function, lasting
from plctool.compiler.codegen.lower_frame import (
    AGGREGATES,
    ARRAY_BOUNDS,
    TASK_OFFSET,
    TIME_MS_OFFSET,
    TIME_NS_OFFSET,
    VALUES,
    Frame,
    Ref,
    rule,
)
from plctool.compiler.codegen.lower_string import compare_strings, equals_literal, literal_text
from plctool.compiler.codegen.lower_unit import REALS, Check, value_type
from plctool.compiler.typed.nodes import (
    AddressOf,
    AssignedValue,
    Binary,
    BinaryOp,
    Call,
    Const,
    Convert,
    DerefPlace,
    Expr,
    IndexPlace,
    Intrinsic,
    IntrinsicCall,
    Load,
    Node,
    Storage,
    Unary,
    VarPlace,
)
from plctool.compiler.typed.ranges import type_range, value_range
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import UDINT, StringType, Type
from plctool.image.targets import FASTEST

T = TypeVar("T")
_SHORT_CIRCUIT = (BinaryOp.AND_THEN, BinaryOp.OR_ELSE)


@rule(VALUES, Const)
def constant_value(frame: Frame, e: Const) -> Value:
    """A number."""
    return constant(e.value, e.type)


@rule(VALUES, Unary)
def unary_value(frame: Frame, e: Unary) -> Value:
    """NOT and the sign."""
    return unary(frame, e.op, frame.value(e.operand), e.type)


@rule(VALUES, Call)
def call_value(frame: Frame, e: Call) -> Value:
    """A scalar that a function returns."""
    value = call_function(frame, e, None)
    assert value is not None, "a function without a scalar result is called by a statement"
    return value


@rule(VALUES, AssignedValue)
def assigned_value(frame: Frame, e: AssignedValue) -> Value:
    """What an assignment stored."""
    value = frame.value(e.assignment.value)
    frame.store(frame.ref(e.assignment.target), value)
    return value


@rule(VALUES, AddressOf)
def address_value(frame: Frame, e: AddressOf) -> Value:
    """The address of a variable."""
    return frame.address(frame.ref(e.place))


@rule(VALUES, Load)
def loaded(frame: Frame, e: Load) -> Value:
    """The scalar in a variable; of a FOR variable what its register holds."""
    if isinstance(e.place, VarPlace):
        shadow = frame.shadows.get(e.place.var)
        if shadow is not None:
            return frame.fn.load(f"load {value_type(e.type)}, ptr {shadow}")
    return frame.load(frame.ref(e.place))


def truth(frame: Frame, e: Expr) -> Value:
    """The i1 that holds the value of a BOOL expression."""
    if isinstance(e, Binary):
        if e.op in _SHORT_CIRCUIT:
            return _short_circuit(frame, e)
        if e.op not in COMPARISONS:
            if _is_one_test(frame, e):
                return is_not_zero(frame, frame.value(e), e.type)
            left, right = truth(frame, e.left), truth(frame, e.right)
            return frame.fn.value(f"{LOGIC[e.op]} i1 {left}, {right}")
        if isinstance(e.left.type, StringType):
            return _compared_strings(frame, e)
        return compare(frame, e.op, frame.value(e.left), frame.value(e.right), e.left.type)
    if isinstance(e, Unary):
        return frame.fn.value(f"xor i1 {truth(frame, e.operand)}, true")
    if isinstance(e, Convert) and not is_bool(e.operand.type):
        return is_not_zero(frame, frame.value(e.operand), e.operand.type)
    return is_not_zero(frame, frame.value(e), e.type)


def _is_one_test(frame: Frame, e: Binary) -> bool:
    """Whether a condition of several operands is worked out and tested once. Small processors branch for each of them
    in less, and where -O3 has inlined much, comparisons are better left to branches."""
    options = frame.unit.options
    return not options.target.small_flash and (options.opt_level < FASTEST or _is_stored(e))


def _is_stored(e: Expr, depth: int = 10) -> bool:
    """Whether a BOOL is made of variables only, which are bytes. In how many levels is limited as in `_negates()`."""
    if depth > 0 and isinstance(e, Binary):
        return e.op in LOGIC and _is_stored(e.left, depth - 1) and _is_stored(e.right, depth - 1)
    return isinstance(e, Load) or (depth > 0 and isinstance(e, Unary) and _is_stored(e.operand, depth - 1))


@rule(VALUES, Binary)
def binary_value(frame: Frame, e: Binary) -> Value:
    """A comparison is an i1 first; anything else is calculated."""
    if e.op in COMPARISONS or e.op in _SHORT_CIRCUIT:
        return frame.fn.value(f"zext i1 {truth(frame, e)} to i8")
    if e.op is BinaryOp.AND and is_bool(e.type):
        return _both(frame, e)
    left, right = frame.value(e.left), frame.value(e.right)
    if e.op in (BinaryOp.DIV, BinaryOp.MOD) and value_type(e.type) not in REALS:
        return divide(frame, e.op, left, right, e.type, e.pos, known_integer(e.right))
    return binary(frame, e.op, left, right, e.type)


def _both(frame: Frame, e: Binary) -> Value:
    """AND of BOOLs. Of one operand only the lowest bit has to be right, as the other one has no more. NOT may then be
    that of all bits, which many processors do together with the AND."""
    if _negates(e.left) and not _negates(e.right):
        left = _lowest_bit(frame, e.left)
        right = frame.value(e.right)
    else:
        left = frame.value(e.left)
        right = _lowest_bit(frame, e.right)
    return frame.fn.value(f"and i8 {left}, {right}")


def _lowest_bit(frame: Frame, e: Expr) -> Value:
    """An i8 of which only the lowest bit is the value of a BOOL."""
    if isinstance(e, Binary) and e.op in LOGIC:
        left, right = _lowest_bit(frame, e.left), _lowest_bit(frame, e.right)
        return frame.fn.value(f"{LOGIC[e.op]} i8 {left}, {right}")
    if isinstance(e, Unary) and not (isinstance(e.operand, Binary) and e.operand.op not in LOGIC):
        return frame.fn.value(f"xor i8 {_lowest_bit(frame, e.operand)}, -1")
    return frame.value(e)


def _negates(e: Expr, depth: int = 3) -> bool:
    """Whether there is a NOT in an expression of BOOLs. It is looked for in a few levels only, or a long chain, in
    which each AND asks, would take more than proportional time."""
    if depth > 0 and isinstance(e, Binary) and e.op in LOGIC:
        return _negates(e.left, depth - 1) or _negates(e.right, depth - 1)
    return isinstance(e, Unary)


def _short_circuit(frame: Frame, e: Binary) -> Value:
    fn = frame.fn
    left = truth(frame, e.left)
    more, end, first = fn.label("more"), fn.label("end"), fn.block
    if e.op is BinaryOp.AND_THEN:
        fn.branch_if(left, more, end)
    else:
        fn.branch_if(left, end, more)
    fn.begin(more)
    right = truth(frame, e.right)
    last = fn.block
    fn.begin(end)
    skipped = FALSE if e.op is BinaryOp.AND_THEN else TRUE
    return fn.value(f"phi i1 [ {skipped}, %{first} ], [ {right}, %{last} ]")


def _compared_strings(frame: Frame, e: Binary) -> Value:
    if e.op in (BinaryOp.EQ, BinaryOp.NE):
        for literal, other in ((e.right, e.left), (e.left, e.right)):
            if isinstance(literal, Const) and not isinstance(other, Const):
                ref = frame.aggregate(other)
                equal = equals_literal(frame, ref, str(literal.value))
                if equal is None:
                    return compare_strings(frame, e.op, ref, frame.aggregate(literal))
                return equal if e.op is BinaryOp.EQ else frame.fn.value(f"xor i1 {equal}, true")
    left = frame.aggregate(e.left)
    if isinstance(e.left, Load | IntrinsicCall):
        left = lasting(frame, left, e.right)
    return compare_strings(frame, e.op, left, frame.aggregate(e.right))


@rule(VALUES, Convert)
def converted(frame: Frame, e: Convert) -> Value:
    """A conversion, with the check of a subrange."""
    source = e.operand.type
    value = frame.value(e.operand)
    if e.check is None or Check.SUBRANGE not in frame.checks:
        return convert(frame, value, source, e.type, rounding=e.rounding)
    if type_range(source) is None:  # a real: the limits are tested on the integer
        value = convert(frame, value, source, e.type, rounding=e.rounding)
        _check_limits(frame, e, value, e.type, type_range(e.type), e.check)
        return value
    _check_limits(frame, e, value, source, value_range(e.operand, frame.ranges), e.check)
    return convert(frame, value, source, e.type)


def _check_limits(
    frame: Frame, e: Convert, value: Value, t: Type, known: tuple[int, int] | None, limits: tuple[int, int]
) -> None:
    assert known is not None
    low, high = max(limits[0], known[0]), min(limits[1], known[1])
    if (low, high) == known:
        return
    frame.note_bounds(None, e.operand, *limits, e.pos)
    text = value_type(t)
    if low > high:
        frame.require(FALSE, ARRAY_BOUNDS, e.pos)
        return
    relative = frame.fn.value(f"sub {text} {value}, {low}") if low else value
    frame.require(frame.fn.value(f"icmp ule {text} {relative}, {high - low}"), ARRAY_BOUNDS, e.pos)


@rule(VALUES, IntrinsicCall)
def intrinsic(frame: Frame, e: IntrinsicCall) -> Value:
    """The scalar that an intrinsic function gives."""
    op, t = e.intrinsic, e.type
    if op is Intrinsic.TIME:
        return frame.context_load(TIME_MS_OFFSET, "i32")
    if op is Intrinsic.LTIME:
        return frame.context_load(TIME_NS_OFFSET, "i64")
    if op is Intrinsic.TASK:
        return frame.context_load(TASK_OFFSET, "i32")
    if op is Intrinsic.STRING_SIZE:
        return convert(frame, frame.aggregate(e.args[0]).capacity, UDINT, t)
    first = e.args[0].type
    if op in (Intrinsic.SELECT, Intrinsic.MUX) and not all(_may_be_idle(arg) for arg in e.args[1:]):
        return _phi(frame, value_type(t), _each_way(frame, e, frame.value))
    if _is_lazy(e):
        return _phi(frame, value_type(t), _each_way(frame, e, frame.value))
    if op is Intrinsic.SELECT:
        choice, no, yes = truth(frame, e.args[0]), frame.value(e.args[1]), frame.value(e.args[2])
        return select(frame, choice, yes, no, t)
    values = [frame.value(arg) for arg in e.args]
    if op is Intrinsic.EXCHANGE:
        return _exchange(frame, *values)
    if op in (Intrinsic.SHL, Intrinsic.SHR):
        return shift(frame, op, values[0], t, values[1], e.args[1].type, known_integer(e.args[1]))
    if op in (Intrinsic.ROL, Intrinsic.ROR):
        return rotate(frame, op, values[0], t, values[1], e.args[1].type)
    if op is Intrinsic.MUX:
        return _choose(frame, values[0], first, values[1:], value_type(t))
    if op in (Intrinsic.MIN, Intrinsic.MAX):
        return extreme(frame, op, values[0], values[1], t)
    if op is Intrinsic.ABS:
        return absolute(frame, values[0], t)
    if op is Intrinsic.SQRT:
        return square_root(frame, values[0], t)
    assert op is Intrinsic.BITCAST, op
    return bitcast(frame, values[0], first, t)


def _exchange(frame: Frame, address: Value, old: Value, new: Value) -> Value:
    """Whether a DINT was `old`; then it is `new`."""
    fn = frame.fn
    frame.unit.exchanges = True
    if frame.unit.target.exchanges:
        pair = fn.value(f"cmpxchg ptr {address}, i32 {old}, i32 {new} seq_cst seq_cst")
        return fn.value(f"zext i1 {fn.value(f'extractvalue {{ i32, i1 }} {pair}, 1')} to i8")
    found = fn.value(f"load i32, ptr {address}")
    same = fn.value(f"icmp eq i32 {found}, {old}")
    fn.do(f"store i32 {fn.value(f'select i1 {same}, i32 {new}, i32 {found}')}, ptr {address}")
    return fn.value(f"zext i1 {same} to i8")


def _choose(frame: Frame, selector: Value, selector_type: Type, values: list[Value], text: str) -> Value:
    """MUX: the last value for every selector that is not the index of another one."""
    result = values[-1]
    for index, hit in reversed(list(enumerate(_hits(frame, selector, selector_type, len(values))))):
        result = frame.fn.value(f"select i1 {hit}, {text} {values[index]}, {text} {result}")
    return result


def _hits(frame: Frame, selector: Value, selector_type: Type, count: int) -> list[Value]:
    """Whether the selector of a MUX is each index but the last one of its `count` inputs, as far as it can be."""
    limits = type_range(selector_type)
    assert limits is not None
    text = value_type(selector_type)
    return [frame.fn.value(f"icmp eq {text} {selector}, {index}") for index in range(min(count - 1, limits[1] + 1))]


@rule(AGGREGATES, Const)
def constant_text(frame: Frame, e: Const) -> Ref:
    """A constant string."""
    return literal_text(frame, str(e.value), wide=isinstance(e.type, StringType) and e.type.wide)


@rule(AGGREGATES, Load)
def loaded_aggregate(frame: Frame, e: Load) -> Ref:
    """What a variable holds is not copied."""
    return frame.ref(e.place)


@rule(AGGREGATES, AssignedValue)
def assigned_aggregate(frame: Frame, e: AssignedValue) -> Ref:
    """The variable that a string, array or structure was assigned to."""
    ref = frame.ref(e.assignment.target)
    assign_aggregate(frame, ref, e.assignment.value)
    return ref


@rule(AGGREGATES, Convert)
def converted_aggregate(frame: Frame, e: Convert) -> Ref:
    """Conversions between strings or arrays change nothing in memory."""
    return frame.aggregate(e.operand)


@rule(AGGREGATES, Call)
def called_aggregate(frame: Frame, e: Call) -> Ref:
    """The memory that a function writes its result to."""
    ref = frame.temporary(e.type)
    call_function(frame, e, ref)
    return ref


@rule(AGGREGATES, IntrinsicCall)
def selected(frame: Frame, e: IntrinsicCall) -> Ref:
    """SEL and MUX choose an address."""
    if _is_lazy(e):
        ways = _each_way(frame, e, partial(_located, frame))
        refs, blocks = [ref for ref, _ in ways], [block for _, block in ways]
    else:
        choice = truth(frame, e.args[0]) if e.intrinsic is Intrinsic.SELECT else frame.value(e.args[0])
        refs, blocks = [_located(frame, arg) for arg in e.args[1:]], []

    def chosen(values: list[Value], text: str) -> Value:
        if blocks:
            return _phi(frame, text, list(zip(values, blocks, strict=True)))
        return _pick(frame, e, choice, values, text)

    pointer = chosen([ref.pointer for ref in refs], "ptr")
    capacities = [ref.capacity for ref in refs]
    same = all(capacity == capacities[0] for capacity in capacities)
    capacity = capacities[0] if same else chosen(capacities, "i32")
    return Ref(pointer, 0, e.type, capacity=capacity, sure=min(ref.align for ref in refs))


def _located(frame: Frame, e: Expr) -> Ref:
    """Where a string, array or structure is, with its address as the pointer."""
    ref = frame.aggregate(e)
    return replace(ref, pointer=frame.address(ref), offset=0)


def _pick(frame: Frame, e: IntrinsicCall, choice: Value, values: list[Value], text: str) -> Value:
    if e.intrinsic is Intrinsic.SELECT:
        return frame.fn.value(f"select i1 {choice}, {text} {values[1]}, {text} {values[0]}")
    return _choose(frame, choice, e.args[0].type, values, text)


# ---- inputs of SEL and MUX that are worked out only when they are chosen ----


def _is_lazy(e: IntrinsicCall) -> bool:
    return e.intrinsic in (Intrinsic.SELECT, Intrinsic.MUX) and not all(_may_be_idle(arg) for arg in e.args[1:])


def _may_be_idle(e: Expr) -> bool:
    """Whether it is all the same if it is worked out and not used: it cannot fail, and does nothing else."""
    return not any(_does_more(node) for node in walk(e))


def _does_more(node: Node) -> bool:
    """Whether what this node does, without its parts, may fail or change something."""
    if isinstance(node, Binary):
        divides = node.op in (BinaryOp.DIV, BinaryOp.MOD) and value_type(node.type) not in REALS
        return divides and not known_integer(node.right)
    if isinstance(node, IndexPlace):
        return not all(isinstance(index, Const) for index in node.indices)
    if isinstance(node, VarPlace):
        return node.var.storage is Storage.REFERENCE
    if isinstance(node, Convert):
        return node.check is not None
    if isinstance(node, IntrinsicCall):
        return node.intrinsic is Intrinsic.EXCHANGE
    return isinstance(node, Call | AssignedValue | DerefPlace)


def _each_way(frame: Frame, e: IntrinsicCall, work: Callable[[Expr], T]) -> list[tuple[T, str]]:
    """What `work` makes of each input, and the block it does so in, which is run only when the input is chosen."""
    fn = frame.fn
    if e.intrinsic is Intrinsic.SELECT:
        tests, inputs = [truth(frame, e.args[0])], [e.args[2], e.args[1]]
    else:
        inputs = e.args[1:]
        tests = _hits(frame, frame.value(e.args[0]), e.args[0].type, len(inputs))
    end, ways = fn.label("chosen"), list[tuple[T, str]]()
    for test, arg in zip(tests, inputs, strict=False):
        this, others = fn.label("choice"), fn.label("others")
        fn.branch_if(test, this, others)
        fn.begin_detached(this)
        ways.append((work(arg), fn.block))
        fn.branch(end)
        fn.begin_detached(others)
    ways.append((work(inputs[-1]), fn.block))
    fn.begin(end)
    return ways


def _phi(frame: Frame, text: str, ways: list[tuple[Value, str]]) -> Value:
    return frame.fn.value(f"phi {text} " + ", ".join(f"[ {value}, %{block} ]" for value, block in ways))
