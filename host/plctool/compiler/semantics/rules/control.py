"""Bodies and control structures: statements in sequence, which of them are never reached, choices and loops.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Collection

from plctool.compiler.base.nesting import NestingError
from plctool.compiler.semantics import constants
from plctool.compiler.semantics.checker import Checker, checks_statement
from plctool.compiler.semantics.conversions import elementary, is_untyped, whole_value
from plctool.compiler.semantics.instances import INITIALISERS
from plctool.compiler.semantics.labels import Labels
from plctool.compiler.semantics.loop_bounds import known_values, passed_bounds
from plctool.compiler.semantics.once import hidden_place
from plctool.compiler.semantics.pitfalls import has_exit
from plctool.compiler.semantics.rules.jumps import note_loops, report_leaving, report_repeated
from plctool.compiler.semantics.rules.places import changeable_place
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, UNTYPED_INT, Role, TypeSymbol, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Case,
    Const,
    Continue,
    Exit,
    Expr,
    For,
    If,
    Jump,
    Place,
    Repeat,
    Return,
    Statement,
    Try,
    VarPlace,
    While,
)
from plctool.compiler.typed.typed_nodes import root_of, walk, written_places
from plctool.iec.common_types import NUMBERS, SIGNED
from plctool.iec.types import BOOL, EnumType, Kind, StringType, SubrangeType, Type, is_scalar

# ---- statements in sequence ----


def check_body(c: Checker, nodes: list[ast.Stmt]) -> list[Statement]:
    """The typed statements; what cannot be reached is reported once, up to a label that a JMP names."""
    result: list[Statement] = []
    ended = reported = False
    c.around.append(nodes)
    for node in nodes:
        if c.labels.is_target(node):
            ended = reported = False
        if ended:
            report_unreachable(c, node.pos)
        found = c.statement(node)
        reported = reported or ended
        ended = not reported and _ends(found)
        result += found
    c.around.pop()
    note_loops(c, result)
    return result


def write_body(c: Checker, nodes: list[ast.Stmt]) -> None:
    """Checks the statements into the unit of the scope."""
    pou = c.scope.pou
    assert pou is not None
    c.labels, c.temps = Labels(nodes), {}
    report_repeated(c)
    try:
        pou.body = [*c.scope.prologue, *check_body(c, nodes)]
    except NestingError as error:
        c.world.diagnostics.nested_too_deeply(error)
    c.world.pous.append(pou)


def report_unreachable(c: Checker, offset: int, why: str = "") -> None:
    """Warns of a statement that is never executed."""
    c.warning(offset, "unreachable", f"this statement is never reached{why}")


def report_unused(scope: Scope, elsewhere: Collection[str] = ()) -> None:
    """Warns of variables that are not used, not even by these names `elsewhere`, and of results that are not
    assigned."""
    for symbol in scope.names.values():
        if not isinstance(symbol, VarSymbol) or symbol.used or symbol.name.startswith("%"):
            continue
        if scope.globals.diagnostics.has("uncalled", symbol.pos):
            continue
        if symbol.role in (Role.LOCAL, Role.TEMP) and symbol.name.casefold() not in elsewhere:
            scope.globals.diagnostics.warning(symbol.pos, "unused", f"{symbol.name} is never used")
        elif symbol.role is Role.RESULT and symbol.name.casefold() not in INITIALISERS:
            message = f"{symbol.name} never assigns its result; write {symbol.name} := ..."
            scope.globals.diagnostics.warning(symbol.pos, "result", message)


def _ends(statements: list[Statement]) -> bool:
    """Whether what follows some statements is never reached."""
    if not statements:
        return False
    last = statements[-1]
    if isinstance(last, If | Case):
        return _ends(last.otherwise) and all(_ends(body) for _, body in last.branches)
    if isinstance(last, Try):
        return _ends(last.body) and (last.exception is None or _ends(last.caught))
    if isinstance(last, While):
        return _is_constant(last.condition, 1) and not has_exit(last.body)
    if isinstance(last, Repeat):
        return _is_constant(last.until, 0) and not has_exit(last.body)
    return isinstance(last, Return | Exit | Continue | Jump)


def _is_constant(e: Expr, value: int) -> bool:
    return isinstance(e, Const) and e.value == value


# ---- choices and loops ----


class _Labels:
    """The labels of a CASE so far, with their lines."""

    def __init__(self) -> None:
        self._values: dict[int, int] = {}
        self._ranges: list[tuple[int, int, int]] = []

    def overlap(self, low: int, high: int) -> tuple[int, int] | None:
        """A value between `low` and `high` that is taken already, and the line where."""
        if low == high and low in self._values:
            return low, self._values[low]
        if low < high:
            for value, line in self._values.items():
                if low <= value <= high:
                    return value, line
        for other_low, other_high, line in self._ranges:
            if low <= other_high and other_low <= high:
                return max(low, other_low), line
        return None

    def add(self, low: int, high: int, line: int) -> None:
        """Notes a label."""
        if low == high:
            self._values[low] = line
        else:
            self._ranges.append((low, high, line))


def _names_something(node: object) -> bool:
    """Whether a constant expression names a constant."""
    if isinstance(node, ast.Binary):
        return _names_something(node.left) or _names_something(node.right)
    if isinstance(node, ast.Unary):
        return _names_something(node.operand)
    return not isinstance(node, ast.Literal)


@checks_statement(ast.If)
def if_statement(c: Checker, node: ast.If) -> list[Statement]:
    """IF; what a constant condition leaves out is reported."""
    branches = [(c.condition(condition), check_body(c, body)) for condition, body in node.branches]
    bodies = [*(body for _, body in node.branches), node.otherwise]
    for number, (condition, body) in enumerate(node.branches):
        always = _constant_condition(condition, branches[number][0])
        if always is False and body:
            report_unreachable(c, body[0].pos, ": the condition is always FALSE")
        elif always:
            for skipped in filter(None, bodies[number + 1 :]):
                report_unreachable(c, skipped[0].pos, ": a previous condition is always TRUE")
            break
    return [If(branches, check_body(c, node.otherwise), c.pos(node.pos))]


def _constant_condition(node: ast.Expr, condition: Expr) -> bool | None:
    """What a condition always is; None when that depends, if only on a constant with a name: a switch."""
    if not isinstance(condition, Const) or condition.type is ERROR or _names_something(node):
        return None
    return bool(condition.value)


@checks_statement(ast.Case)
def case_statement(c: Checker, node: ast.Case) -> list[Statement]:
    """CASE; labels are constants, and none is there twice."""
    selector = whole_value(c.settled(node.selector))
    base = elementary(selector.type)
    if selector.type is not ERROR and (base is None or base.kind not in NUMBERS):
        hint = "; write IF" if base is BOOL or isinstance(selector.type, StringType) else ""
        message = f"CASE needs an integer or an enumeration, not {selector.type}{hint}"
        selector = c.error(node.selector.pos, "type", message)
    seen = _Labels()
    branches, all_known = [], True
    for labels, body in node.branches:
        ranges = [r for label in labels if (r := _label_range(c, label, selector.type, seen)) is not None]
        all_known = all_known and len(ranges) == len(labels)
        branches.append((ranges, check_body(c, body)))
    otherwise = check_body(c, node.otherwise)
    if selector.type is ERROR:
        return []
    if isinstance(selector.type, EnumType) and not node.has_else and all_known:
        _report_missing(c, selector.type, seen, node)
    return [Case(selector, branches, otherwise, c.pos(node.pos))]


def _report_missing(c: Checker, t: EnumType, seen: _Labels, node: ast.Case) -> None:
    missing = [name for name, value in t.values.items() if seen.overlap(value, value) is None]
    if missing:
        listed = ", ".join(missing[:-1]) + " and " * (len(missing) > 1) + missing[-1]
        c.warning(node.pos, "case", f"this CASE misses {listed} of {t}; add what is missing, or an ELSE")


def _label_range(c: Checker, label: ast.CaseLabel, t: Type, seen: _Labels) -> tuple[int, int] | None:
    low = _label_value(c, label.low, t)
    high = low if label.high is None else _label_value(c, label.high, t)
    if low is None or high is None:
        return None
    if low > high:
        c.error(label.pos, "range", f"the range {low}..{high} is empty")
        return None
    other = seen.overlap(low, high)
    if other is not None:
        value, line = other
        c.error(label.pos, "duplicate", f"{constants.describe(value, t)} is a label in line {line} already")
        return None
    seen.add(low, high, c.pos(label.pos).line)
    return low, high


def _label_value(c: Checker, node: ast.Expr, t: Type) -> int | None:
    e = c.constant(node, t)
    if isinstance(node, ast.Binary) and node.op is ast.Operator.OR and isinstance(node.right, ast.Literal) and e:
        c.warning(node.pos, "case", f"this is the one value {e.value}; several values are separated by commas")
    if e is not None:
        _report_difference(c, node, e)
    if e is None:
        return None
    if not is_untyped(e) and isinstance(t, EnumType) and e.type is not t and isinstance(e.type, EnumType):
        c.warning(node.pos, "enum", f"this is a value of {e.type}, CASE is about {t}: the number counts")
        e = Const(e.value, UNTYPED_INT, e.pos)
    target = elementary(t)
    value = c.coerce(e, target) if target is not None else e
    return (
        value.value if value.type is not ERROR and isinstance(value, Const) and isinstance(value.value, int) else None
    )


def _report_difference(c: Checker, node: ast.Expr, e: Const) -> None:
    """Warns of `6-9` as a label."""
    if not isinstance(node, ast.Binary) or node.op is not ast.Operator.SUB or _names_something(node):
        return
    low, high = c.expr(node.left), c.expr(node.right)
    if isinstance(low, Const) and isinstance(high, Const) and isinstance(e.value, int) and e.value < 0:
        message = f"this is the one value {e.value}; a range is written {low.value}..{high.value}"
        c.warning(node.pos, "case", message)


@checks_statement(ast.For)
def for_statement(c: Checker, node: ast.For) -> list[Statement]:
    """FOR; the limits are brought to the type of the variable."""
    place = changeable_place(c, node.var, "the FOR loop", "be the variable of a FOR loop")
    t = None if place is None else elementary(place.type)
    if place is not None and (t is None or t.kind not in NUMBERS):
        c.error(node.var.pos, "type", f"a FOR loop counts with an integer, not with {place.type}")
        place = None
    elif place is not None and isinstance(place.type, EnumType):
        c.warning(node.var.pos, "enum", f"the loop counts {place.type} as a number, past its last value")
    target = t if place is not None and t is not None else ERROR
    pos = c.pos(node.pos)
    start = c.value(node.start, target if place is None else place.type)
    stop = c.value(node.stop, target)
    step: Expr = Const(1, target, pos) if node.step is None else _step_value(c, node.step, target)
    if isinstance(step, Const) and step.value == 0 and step.type is not ERROR:
        c.error(node.pos if node.step is None else node.step.pos, "range", "a FOR loop with a step of zero never ends")
        place = None
    _report_never_run(c, node, start, stop, step)
    if place is not None and isinstance(place.type, SubrangeType):
        _report_left_subrange(c, node, place.type, start, stop, step)
    body = _loop_body(c, node.body)
    if place is None or ERROR in (start.type, stop.type, step.type):
        return []
    if not _report_own_variable(c, node, place, [stop, step]) and not c.dialect.limits_each_turn:
        _report_changes(c, node, stop if node.step is None else [stop, step], body)
    loop = For(place, start, stop, step, body, pos, c.dialect.limits_each_turn)
    for at, message in passed_bounds(loop):
        c.world.diagnostics.warning(at, "index", message)
    return [_noted(c, loop)]


def _report_never_run(c: Checker, node: ast.For, start: Expr, stop: Expr, step: Expr) -> None:
    """Warns of FOR i := 10 TO 1. A constant with a name may be changed later."""
    ends = (start, stop, step)
    if _names_something(node.start) or _names_something(node.stop) or any(e.type is ERROR for e in ends):
        return
    first, last, by = (e.value if isinstance(e, Const) and isinstance(e.value, int) else 0 for e in ends)
    if by > 0 and first > last:
        c.warning(
            node.pos, "unreachable", f"this loop never runs: to count down from {first} to {last}, write BY -{by}"
        )
    elif by < 0 and first < last:
        c.warning(node.pos, "unreachable", f"this loop never runs: to count up from {first} to {last}, write BY {-by}")


def _report_left_subrange(c: Checker, node: ast.For, t: SubrangeType, start: Expr, stop: Expr, step: Expr) -> None:
    """An end that is outside, when the loop comes to it for certain."""
    reached = known_values(start, stop, step)
    if reached and not t.low <= reached[-1] <= t.high:
        c.error(node.stop.pos, "range", f"the loop counts to {reached[-1]}, outside of {t.name} ({t.low}..{t.high})")


def _report_changes(c: Checker, node: ast.For, limits: Expr | list[Expr], body: list[Statement]) -> None:
    """Warns of a body that changes what end or step were computed from: other systems look at it in each turn."""
    read = {place.var for place in walk(limits) if isinstance(place, VarPlace) and is_scalar(place.type)}
    written = {root_of(place) for part in walk(body) for place in written_places(part)} if read else set()
    changed = sorted(variable.name for variable in read & written if variable is not None)
    if changed:
        message = (
            f"{changed[0].rpartition('.')[2]} changes in this loop, but end and step are computed once, at its start"
        )
        c.warning(node.pos, "for-bound", f"{message}; write WHILE to use the new value")


def _report_own_variable(c: Checker, node: ast.For, var: Place, limits: list[Expr]) -> bool:
    """Warns of an end or step that reads the variable of the loop: systems disagree about the value it then has."""
    own = var.var if isinstance(var, VarPlace) else None
    if own is None or all(place.var is not own for place in walk(limits) if isinstance(place, VarPlace)):
        return False
    name = own.name.rpartition(".")[2]
    when = "in each turn" if c.dialect.limits_each_turn else f"once, before {name} is set"
    message = f"end or step of this loop read its own variable {name}; they are computed {when}; use another variable"
    c.warning(node.pos, "for-bound", message)
    return True


def _step_value(c: Checker, node: ast.Expr, target: Type) -> Expr:
    """The step of a FOR loop. One with a sign may lead downwards, whatever counts, unless it is wider than that."""
    e, counter = c.expr(node, target), elementary(target)
    own = elementary(e.type)
    if counter is None or own is None:
        return c.coerce(e, target)
    has_sign = own.kind is Kind.INT and own.signed and own.bits <= counter.bits
    if isinstance(e, Const):
        has_sign = isinstance(e.value, int) and e.value < 0
    return c.coerce(e, SIGNED[counter.bits] if has_sign else target)


def _noted(c: Checker, loop: While | Repeat | For) -> Statement:
    """The loop, which is looked at once more when all bodies are checked."""
    c.note_loop(loop)
    return loop


def _loop_body(c: Checker, nodes: list[ast.Stmt]) -> list[Statement]:
    c.loops += 1
    body = check_body(c, nodes)
    c.loops -= 1
    return body


@checks_statement(ast.While)
def while_statement(c: Checker, node: ast.While) -> list[Statement]:
    """WHILE"""
    condition = c.condition(node.condition)
    if _constant_condition(node.condition, condition) is False and node.body:
        report_unreachable(c, node.body[0].pos, ": the condition is always FALSE")
    return [_noted(c, While(condition, _loop_body(c, node.body), c.pos(node.pos)))]


@checks_statement(ast.RepeatUntil)
def repeat_statement(c: Checker, node: ast.RepeatUntil) -> list[Statement]:
    """REPEAT"""
    body = _loop_body(c, node.body)
    return [_noted(c, Repeat(body, c.condition(node.until), c.pos(node.pos)))]


@checks_statement(ast.Exit)
def exit_statement(c: Checker, node: ast.Exit) -> list[Statement]:
    """EXIT"""
    if not c.loops:
        return _outside_of_loop(c, node.pos, "EXIT")
    return [Exit(c.pos(node.pos))]


@checks_statement(ast.Continue)
def continue_statement(c: Checker, node: ast.Continue) -> list[Statement]:
    """CONTINUE"""
    if not c.loops:
        return _outside_of_loop(c, node.pos, "CONTINUE")
    return [Continue(c.pos(node.pos))]


def _outside_of_loop(c: Checker, offset: int, word: str) -> list[Statement]:
    if c.last:
        return report_leaving(c, offset, word)
    c.error(offset, "statement", f"{word} stands outside of a loop")
    return []


@checks_statement(ast.Return)
def return_statement(c: Checker, node: ast.Return) -> list[Statement]:
    """RETURN, RETURN(condition)"""
    pos = c.pos(node.pos)
    if c.last:
        return report_leaving(c, node.pos, "RETURN")
    if node.condition is None:
        return [Return(pos)]
    condition = c.settled(node.condition)
    if condition.type is not BOOL or isinstance(condition, Const):
        if condition.type is not ERROR:
            message = "RETURN takes no value; assign it to the name of the function, then RETURN"
            c.error(node.condition.pos, "syntax", message)
        return []
    return [If([(condition, [Return(pos)])], [], pos)]


# ---- exceptions ----


@checks_statement(ast.Try)
def try_statement(c: Checker, node: ast.Try) -> list[Statement]:
    """__TRY, __CATCH and __FINALLY"""
    pos = c.pos(node.pos)
    if node.catch is None and node.last is None:
        message = "this __TRY has no __CATCH; write __CATCH(exc), exc : __SYSTEM.ExceptionCode, and what to do then"
        c.error(node.pos, "statement", message)
    body = check_body(c, node.body)
    exception = None if node.catch is None else _exception(c, node.catch.var, node.pos)
    caught = [] if node.catch is None else check_body(c, node.catch.body)
    return [Try(body, exception, caught, _last(c, node.last or []), pos)]


def _exception(c: Checker, node: ast.Expr | None, offset: int) -> Place | None:
    """The variable that takes the number of an exception; without one in the source, one of its own."""
    wanted = c.world.names.unit("exceptioncode", library=True)
    assert isinstance(wanted, TypeSymbol)
    t = c.world.declared.type_of(wanted)
    if node is None:
        return hidden_place(c, t, c.pos(offset))
    place = changeable_place(c, node, "__CATCH", "take the number of an exception")
    if place is None or place.type is t:
        return place
    c.error(node.pos, "type", f"__CATCH needs a variable of __SYSTEM.ExceptionCode, not of {place.type}")
    return None


def _last(c: Checker, nodes: list[ast.Stmt]) -> list[Statement]:
    """The statements of __FINALLY, which nothing leads out of."""
    loops, last = c.loops, c.last
    c.loops, c.last = 0, len(c.around)
    body = check_body(c, nodes)
    c.loops, c.last = loops, last
    return body
