"""Statements: assignments, calls of function blocks, control structures.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import replace
from typing import Any, ClassVar

from plctool.compiler.nesting import MAX_DEPTH, NestingError
from plctool.compiler.semantics import constants
from plctool.compiler.semantics.block_calls import BlockCalls
from plctool.compiler.semantics.checker import is_untyped
from plctool.compiler.semantics.conversions import NUMBERS, SIGNED, elementary
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Assign,
    Call,
    CallStatement,
    Case,
    Const,
    Continue,
    DerefPlace,
    Exit,
    Expr,
    For,
    If,
    Load,
    Pos,
    Repeat,
    Return,
    Statement,
    While,
)  # fmt: skip
from plctool.compiler.types import BOOL, EnumType, OpenArrayType, ReferenceType, StructType, Type


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


def ends(statements: list[Statement]) -> bool:
    """Whether what stands behind some statements is never reached."""
    if not statements:
        return False
    last = statements[-1]
    if isinstance(last, If | Case):
        return ends(last.otherwise) and all(ends(body) for _, body in last.branches)
    if isinstance(last, While):
        return _is_constant(last.condition, 1) and not _has_exit(last.body)
    if isinstance(last, Repeat):
        return _is_constant(last.until, 0) and not _has_exit(last.body)
    return isinstance(last, Return | Exit | Continue)


def _is_constant(e: Expr, value: int) -> bool:
    return isinstance(e, Const) and e.value == value


def _has_exit(statements: list[Statement]) -> bool:
    """Whether an EXIT leaves the loop whose body this is."""
    for statement in statements:
        bodies: list[list[Statement]] = []
        if isinstance(statement, If | Case):
            bodies = [*(body for _, body in statement.branches), statement.otherwise]
        if isinstance(statement, Exit) or any(map(_has_exit, bodies)):
            return True
    return False


def _names_something(node: object) -> bool:
    """Whether a constant expression names a constant."""
    if isinstance(node, ast.Binary):
        return _names_something(node.left) or _names_something(node.right)
    if isinstance(node, ast.Unary):
        return _names_something(node.operand)
    return not isinstance(node, ast.Literal)


class Statements(BlockCalls):
    """Checks a body."""

    _loops = 0
    _nesting = 0

    def body(self, nodes: list[ast.Stmt]) -> list[Statement]:
        """The typed statements; what cannot be reached is reported once."""
        self._nesting += 1
        if self._nesting > MAX_DEPTH and nodes:
            raise NestingError(self.pos(nodes[0].pos))
        result: list[Statement] = []
        ended = reported = False
        for node in nodes:
            if ended:
                self._unreachable(node.pos)
            found = self._statements[type(node)](self, node)
            reported = reported or ended
            ended = not reported and ends(found)
            result += found
        self._nesting -= 1
        return result

    def _unreachable(self, offset: int, why: str = "") -> None:
        self.scope.warning(offset, "unreachable", f"this statement is never reached{why}")

    # ---- assignments ----

    def _assign(self, node: ast.Assign) -> list[Statement]:
        if node.op == "REF=":
            return self._assign_reference(node)
        if node.op == "?=":
            return self.attempt(node)
        if node.op != ":=":
            return self._set_or_reset(node)
        if isinstance(node.value, ast.Call):
            declared = self.parameter_names(node.value.callee)
            if self._has_enable(node.value, declared):
                return self._enabled_assignment(node, node.value, declared)
        result: list[Statement] = []
        source: ast.Expr = node.value
        for target in reversed(node.targets):
            statement = self._assign_one(target, source, self.pos(node.pos))
            if statement is not None:
                result.append(statement)
            source = target
        return result

    def _assign_one(self, target: ast.Expr, source: ast.Expr, pos: Pos) -> Statement | None:
        bound = self.assigned_property(target)
        if bound is not None:
            return self.assign_property(bound, target, source, pos)
        place = self.target(target, "the left side of :=", "be assigned to")
        if place is None:
            self.expr(source)
            return None
        value = self.coerce(self.expr(source, place.type), place.type)
        if value.type is ERROR:
            return None
        if isinstance(place.type, OpenArrayType):
            self.error(target.pos, "type", "an ARRAY[*] cannot be assigned as a whole; assign its elements in a loop")
            return None
        block = self.world.blocks.get(place.type) if isinstance(place.type, StructType) else None
        if block is not None:
            self.error(target.pos, "type", f"an instance of the function block {place.type} cannot be assigned")
            return None
        return Assign(place, value, pos)

    def _assign_reference(self, node: ast.Assign) -> list[Statement]:
        """`r REF= x` lets r refer to x; `r REF= NULL` to nothing."""
        target, pos = node.targets[0], self.pos(node.pos)
        place = self.target(target, "the left side of REF=", "be assigned to")
        pointer = place.pointer if isinstance(place, DerefPlace) else None
        if not isinstance(pointer, Load) or not isinstance(pointer.type, ReferenceType):
            if place is not None:
                self.error(target.pos, "type", f"the left side of REF= is a REFERENCE TO, not {place.type}")
            return []
        if isinstance(node.value, ast.Literal) and node.value.kind is ast.LiteralKind.NULL:
            return [Assign(pointer.place, Const(0, pointer.type, pos), pos)]
        value = self.input(node.value, pointer.type, "reference")
        return [] if value.type is ERROR else [Assign(pointer.place, value, pos)]

    def _set_or_reset(self, node: ast.Assign) -> list[Statement]:
        """`x S= condition` sets x and never resets it."""
        place = self.target(node.targets[0], f"the left side of {node.op}", "be assigned to")
        condition = self.condition(node.value)
        if place is None or condition.type is ERROR:
            return []
        if place.type is not BOOL:
            self.error(node.targets[0].pos, "type", f"{node.op} needs a BOOL variable, not {place.type}")
            return []
        pos = self.pos(node.pos)
        change = Assign(place, Const(int(node.op == "S="), BOOL, pos), pos)
        return [If([(condition, [change])], [], pos)]

    # ---- calls ----

    @staticmethod
    def _has_enable(node: ast.Call, declared: Container[str]) -> bool:
        keys = ((a.name or "").casefold() for a in node.args)
        return any(key in ("en", "eno") and key not in declared for key in keys)

    def _call_statement(self, node: ast.ExprStmt) -> list[Statement]:
        call = node.value
        if not isinstance(call, ast.Call) and self.is_called_by_name(call):
            call = ast.Call(call.pos, call, [])
        if not isinstance(call, ast.Call):
            e = self.expr(call)
            if e.type is not ERROR:
                self.error(node.pos, "statement", "this is a value, not a statement; write an assignment or a call")
            return []
        program = self.called_program(call.callee)
        if program is not None:
            names = {symbol.name.casefold() for symbol, _ in program.parameters}
            return self._enabled(call, names, lambda plain: self.program_call(plain, program))
        instance = self.called_instance(call)
        if instance is not None:
            block = self.world.blocks.get(instance.type) if isinstance(instance.type, StructType) else None
            members = block.members if block is not None else ()
            return self._enabled(call, members, lambda plain: self.block_call(plain, instance))
        return self._enabled(call, self.parameter_names(call.callee), self._function_statement)

    def _function_statement(self, call: ast.Call) -> list[Statement]:
        e = self.call(call, None)
        if isinstance(e, Call):
            return [CallStatement(e, e.pos)]
        if e.type is not ERROR:
            self.scope.warning(call.pos, "unused", "the result of this call is not used")
        return []

    def _enabled(
        self, call: ast.Call, declared: Container[str], make: Callable[[ast.Call], list[Statement]]
    ) -> list[Statement]:
        """A call with EN and ENO: not executed unless EN is TRUE; ENO tells. Where the callee declares them itself they
        are variables like others."""
        if not self._has_enable(call, declared):
            return make(call)
        args, enable = self.split_enable(call, declared)
        statements = make(ast.Call(call.pos, call.callee, args))
        pos = self.pos(call.pos)
        done: list[Statement] = []
        skipped: list[Statement] = []
        if enable.eno is not None:
            target = self.target(enable.eno, "ENO", "take ENO")
            if target is None:
                return []
            if target.type is not BOOL:
                self.error(enable.eno.pos, "type", f"ENO needs a BOOL variable, not {target.type}")
                return []
            done = [Assign(target, Const(1, BOOL, pos), pos)]
            skipped = [Assign(target, Const(0, BOOL, pos), pos)]
        if enable.en is None:
            return statements + done
        condition = self.condition(enable.en)
        return [] if condition.type is ERROR else [If([(condition, statements + done)], skipped, pos)]

    def _enabled_assignment(self, node: ast.Assign, call: ast.Call, declared: Container[str]) -> list[Statement]:
        return self._enabled(call, declared, lambda plain: self._assign(replace(node, value=plain)))

    # ---- control structures ----

    def _if(self, node: ast.If) -> list[Statement]:
        branches = [(self.condition(condition), self.body(body)) for condition, body in node.branches]
        bodies = [*(body for _, body in node.branches), node.otherwise]
        for number, (condition, body) in enumerate(node.branches):
            always = self._always(condition, branches[number][0])
            if always is False and body:
                self._unreachable(body[0].pos, ": the condition is always FALSE")
            elif always:
                for skipped in filter(None, bodies[number + 1 :]):
                    self._unreachable(skipped[0].pos, ": a condition before is always TRUE")
                break
        return [If(branches, self.body(node.otherwise), self.pos(node.pos))]

    @staticmethod
    def _always(node: ast.Expr, condition: Expr) -> bool | None:
        """What a condition always is; None when that depends, if only on a constant with a name: a switch."""
        if not isinstance(condition, Const) or condition.type is ERROR or _names_something(node):
            return None
        return bool(condition.value)

    def _case(self, node: ast.Case) -> list[Statement]:
        selector = self.settled(node.selector)
        base = elementary(selector.type)
        if selector.type is not ERROR and (base is None or base.kind not in NUMBERS):
            selector = self.error(
                node.selector.pos, "type", f"CASE needs an integer or an enumeration, not {selector.type}"
            )
        seen = _Labels()
        branches = []
        for labels, body in node.branches:
            ranges = [r for label in labels if (r := self._label(label, selector.type, seen)) is not None]
            branches.append((ranges, self.body(body)))
        otherwise = self.body(node.otherwise)
        if selector.type is ERROR:
            return []
        if isinstance(selector.type, EnumType) and not node.has_else:
            self._report_missing(selector.type, seen, node)
        return [Case(selector, branches, otherwise, self.pos(node.pos))]

    def _report_missing(self, t: EnumType, seen: _Labels, node: ast.Case) -> None:
        missing = [name for name, value in t.values.items() if seen.overlap(value, value) is None]
        if missing:
            listed = ", ".join(missing[:-1]) + " and " * (len(missing) > 1) + missing[-1]
            self.scope.warning(node.pos, "case", f"this CASE misses {listed} of {t}; add what is missing, or an ELSE")

    def _label(self, label: ast.CaseLabel, t: Type, seen: _Labels) -> tuple[int, int] | None:
        low = self._label_value(label.low, t)
        high = low if label.high is None else self._label_value(label.high, t)
        if low is None or high is None:
            return None
        if low > high:
            self.error(label.pos, "range", f"the range {low}..{high} is empty")
            return None
        other = seen.overlap(low, high)
        if other is not None:
            value, line = other
            self.error(label.pos, "duplicate", f"{constants.describe(value, t)} is a label in line {line} already")
            return None
        seen.add(low, high, self.pos(label.pos).line)
        return low, high

    def _label_value(self, node: ast.Expr, t: Type) -> int | None:
        e = self.constant(node, t)
        if e is None:
            return None
        if not is_untyped(e) and isinstance(t, EnumType) and e.type is not t and isinstance(e.type, EnumType):
            self.error(node.pos, "type", f"this is a value of {e.type}, CASE is about {t}")
            return None
        if isinstance(t, EnumType) and is_untyped(e) and isinstance(e.value, int):
            return e.value
        target = elementary(t)
        value = self.coerce(e, target) if target is not None else e
        return (
            value.value
            if value.type is not ERROR and isinstance(value, Const) and isinstance(value.value, int)
            else None
        )

    def _for(self, node: ast.For) -> list[Statement]:
        place = self.target(node.var, "the FOR loop", "be the variable of a FOR loop")
        t = None if place is None else elementary(place.type)
        if place is not None and (t is None or t.kind not in NUMBERS):
            self.error(node.var.pos, "type", f"a FOR loop counts with an integer, not with {place.type}")
            place = None
        elif place is not None and isinstance(place.type, EnumType):
            self.scope.warning(node.var.pos, "enum", f"the loop takes {place.type} for a number, beyond its last value")
        target = t if place is not None and t is not None else ERROR
        pos = self.pos(node.pos)
        start, stop = self.value(node.start, target), self.value(node.stop, target)
        step: Expr = Const(1, target, pos) if node.step is None else self._step(node.step, target)
        if isinstance(step, Const) and step.value == 0 and step.type is not ERROR:
            self.error(
                node.pos if node.step is None else node.step.pos, "range", "a FOR loop with a step of zero never ends"
            )
            place = None
        body = self._loop_body(node.body)
        if place is None or ERROR in (start.type, stop.type, step.type):
            return []
        return [For(place, start, stop, step, body, pos)]

    def _step(self, node: ast.Expr, target: Type) -> Expr:
        """The step of a FOR loop. A constant one may lead downwards, whatever counts."""
        e, counter = self.expr(node, target), elementary(target)
        if isinstance(e, Const) and isinstance(e.value, int) and e.value < 0 and counter is not None:
            target = SIGNED[counter.bits]
        return self.coerce(e, target)

    def _loop_body(self, nodes: list[ast.Stmt]) -> list[Statement]:
        self._loops += 1
        body = self.body(nodes)
        self._loops -= 1
        return body

    def _while(self, node: ast.While) -> list[Statement]:
        condition = self.condition(node.condition)
        if self._always(node.condition, condition) is False and node.body:
            self._unreachable(node.body[0].pos, ": the condition is always FALSE")
        return [While(condition, self._loop_body(node.body), self.pos(node.pos))]

    def _repeat(self, node: ast.RepeatUntil) -> list[Statement]:
        body = self._loop_body(node.body)
        return [Repeat(body, self.condition(node.until), self.pos(node.pos))]

    def _exit(self, node: ast.Exit) -> list[Statement]:
        if not self._loops:
            self.error(node.pos, "statement", "EXIT stands outside of a loop")
        return [Exit(self.pos(node.pos))]

    def _continue(self, node: ast.Continue) -> list[Statement]:
        if not self._loops:
            self.error(node.pos, "statement", "CONTINUE stands outside of a loop")
        return [Continue(self.pos(node.pos))]

    def _return(self, node: ast.Return) -> list[Statement]:
        return [Return(self.pos(node.pos))]

    _statements: ClassVar[dict[type, Callable[[Any, Any], list[Statement]]]] = {
        ast.Assign: _assign,
        ast.ExprStmt: _call_statement,
        ast.If: _if,
        ast.Case: _case,
        ast.For: _for,
        ast.While: _while,
        ast.RepeatUntil: _repeat,
        ast.Exit: _exit,
        ast.Continue: _continue,
        ast.Return: _return,
    }
