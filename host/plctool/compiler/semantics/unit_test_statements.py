"""The statements of unit tests: asserts, the passing of time, mocks, forces.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable

from plctool.compiler.semantics import mocks
from plctool.compiler.semantics.assertions import FAILED, LTIME_NOW, TIME_NOW, Assertion, Bench, Operand
from plctool.compiler.semantics.checker import Checker, SpecialCalls
from plctool.compiler.semantics.conversions import (
    convert,
    elementary,
    is_untyped,
    load,
    place_of,
    settle,
    time_to_ltime,
)
from plctool.compiler.semantics.rules.control import report_unused, write_body
from plctool.compiler.semantics.rules.conversion_calls import convert_explicitly
from plctool.compiler.semantics.rules.literals import match_literals
from plctool.compiler.semantics.rules.members import bound_member, variable_value
from plctool.compiler.semantics.rules.operators import operate
from plctool.compiler.semantics.rules.parts import member_of
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol
from plctool.compiler.semantics.unit_test_devices import TestDevices
from plctool.compiler.semantics.unit_test_forces import Forces
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    Binary,
    BinaryOp,
    Const,
    Expr,
    If,
    Load,
    Return,
    Statement,
    Storage,
    Unary,
    UnaryOp,
    Variable,
    VarPlace,
)  # fmt: skip
from plctool.iec.common_types import NUMBERS
from plctool.iec.types import BOOL, DINT, LREAL, LTIME, TIME, UDINT, ArrayType, Kind, StringType, StructType, Type

_MESSAGE = StringType(255)
_OPERATORS = {
    "ASSERT_EQ": BinaryOp.EQ, "ASSERT_NEQ": BinaryOp.NE, "ASSERT_GT": BinaryOp.GT, "ASSERT_GE": BinaryOp.GE,
    "ASSERT_LT": BinaryOp.LT, "ASSERT_LE": BinaryOp.LE,
}  # fmt: skip


class TestBody:
    """The body of a TEST, SETUP or TEARDOWN. It may write every variable of what it tests. `forces`: what is forced
    there, to which those of its own are added. `cleaning`: in TEARDOWN only the first failure counts."""

    def __init__(
        self,
        world: World,
        scope: Scope,
        bench: Bench,
        devices: TestDevices,
        forces: Forces,
        *,
        cleaning: bool = False,
    ) -> None:
        scope.sees_inside = scope.writes_inside = True
        own = {name: call for name, call in self._own_names().items() if scope.lookup(name) is None}
        self._c = Checker(world, scope, {**self._special_calls(), **own})
        self._bench = bench
        self._devices = devices
        self._forces = forces
        self._cleaning = cleaning
        self._kept: dict[tuple[str, Type], Variable] = {}

    def _special_calls(self) -> SpecialCalls:
        return {
            **dict.fromkeys(_OPERATORS, self._compared),
            "ASSERT_TRUE": self._truth,
            "ASSERT_FALSE": self._truth,
            "ASSERT_NEAR": self._near,
            "ADVANCE_TIME": self._advance_time,
            "MOCK": self._mock,
            "MOCK_FUNCTION": self._mock_function,
            "MOCK_VERIFY_CALLED": self._verify_called,
            "MOCK_VERIFY_CALL_COUNT": self._verify_call_count,
        }

    def _own_names(self) -> SpecialCalls:
        """Those that are not of STruC++: a program may have a function or an instance of that name."""
        return {"FORCE": self._force, "UNFORCE": self._unforce}

    def write(self, decl: ast.TestDecl) -> None:
        """Checks the statements into the unit of the scope."""
        if decl.faults:
            self._c.scope.prologue += self._devices.begin_faults(self._c, decl.pos)
        found, before = self._c.world.diagnostics, self._c.world.diagnostics.errors
        write_body(self._c, decl.body)
        if self._c.scope.pou is not None:
            self._forces.hold(self._c.scope.pou.body)
        if decl.keyword is not ast.TestUnit.SETUP and found.errors == before:
            report_unused(self._c.scope)

    def _nodes(self, call: ast.Call, count: int, *, message: bool = True) -> list[ast.Expr] | None:
        """The arguments, perhaps with a message after them; None after an error."""
        assert isinstance(call.callee, ast.Name)
        name = call.callee.name.upper()
        nodes = [a.value for a in call.args if a.name is None and a.value is not None]
        if len(nodes) < len(call.args):
            self._c.error(call.pos, "arguments", f"the arguments of {name} have no names")
        elif len(nodes) == count or (message and len(nodes) == count + 1):
            return nodes
        else:
            more = " and perhaps a message" if message else ""
            plural = "" if count == 1 else "s"
            self._c.error(call.pos, "arguments", f"{name} takes {count} argument{plural}{more}, not {len(nodes)}")
        return None

    # ---- asserts ----

    def _keep(self, role: str, e: Expr, before: list[Statement]) -> Expr:
        """Evaluates an operand once: into a variable of the test, unless it is constant."""
        e = settle(e)
        if isinstance(e, Const) or isinstance(e.type, StructType | ArrayType):
            return e
        pou = self._c.scope.pou
        assert pou is not None
        variable = self._kept.get((role, e.type))
        if variable is None:
            variable = Variable(f"__{role}", e.type, Storage.LOCAL, e.pos)
            self._kept[role, e.type] = variable
            pou.locals.append(variable)
        place = VarPlace(variable, e.type, e.pos)
        before.append(Assign(place, e, e.pos))
        return load(place)

    def _compared(self, call: ast.Call) -> list[Statement]:
        """ASSERT_EQ and the other comparisons."""
        nodes = self._nodes(call, 2)
        if nodes is None:
            return []
        assert isinstance(call.callee, ast.Name)
        name, before = call.callee.name.upper(), list[Statement]()
        left = self._c.expr(nodes[0])
        right = self._c.expr(nodes[1], None if is_untyped(left) else left.type)
        if left.type is ERROR or right.type is ERROR:
            return []
        left, right = match_literals(self._c, left, right, None)
        left, right = self._keep("actual", left, before), self._keep("expected", right, before)
        holds = operate(self._c, _OPERATORS[name], left, right, call.pos)
        return self._assertion(call, holds, before, [("actual", left), ("expected", right)], nodes[2:])

    def _truth(self, call: ast.Call) -> list[Statement]:
        """ASSERT_TRUE, ASSERT_FALSE."""
        nodes = self._nodes(call, 1)
        condition = None if nodes is None else self._c.condition(nodes[0])
        if nodes is None or condition is None or condition.type is ERROR:
            return []
        assert isinstance(call.callee, ast.Name)
        wanted, pos = call.callee.name.upper() == "ASSERT_TRUE", self._c.pos(call.pos)
        holds = condition if wanted else Unary(UnaryOp.NOT, condition, BOOL, pos)
        operands: list[tuple[str, Expr]] = [
            ("actual", Const(int(not wanted), BOOL, pos)),
            ("expected", Const(int(wanted), BOOL, pos)),
        ]
        return self._assertion(call, holds, [], operands, nodes[1:])

    def _near(self, call: ast.Call) -> list[Statement]:
        """ASSERT_NEAR(actual, expected, tolerance): within the tolerance, both ends included."""
        nodes = self._nodes(call, 3)
        if nodes is None:
            return []
        before = list[Statement]()
        actual = self._c.expr(nodes[0])
        wanted = None if is_untyped(actual) else actual.type
        expected, tolerance = self._c.expr(nodes[1], wanted), self._c.expr(nodes[2], wanted)
        if ERROR in (actual.type, expected.type, tolerance.type):
            return []
        actual, expected = match_literals(self._c, actual, expected, None)
        tolerance = match_literals(self._c, actual, tolerance, None)[1]
        roles = ("actual", "expected", "tolerance")
        kept = [self._keep(r, e, before) for r, e in zip(roles, (actual, expected, tolerance), strict=True)]
        a, e, t = (_as_real(v) for v in kept)
        below = operate(self._c, BinaryOp.LE, operate(self._c, BinaryOp.SUB, a, e, call.pos), t, call.pos)
        above = operate(self._c, BinaryOp.LE, operate(self._c, BinaryOp.SUB, e, a, call.pos), t, call.pos)
        holds = operate(self._c, BinaryOp.AND, below, above, call.pos)
        return self._assertion(call, holds, before, list(zip(roles, kept, strict=True)), nodes[3:])

    def _assertion(
        self,
        call: ast.Call,
        holds: Expr,
        before: list[Statement],
        operands: list[tuple[str, Expr]],
        message: list[ast.Expr],
    ) -> list[Statement]:
        """`IF NOT holds THEN` what is needed to tell `RETURN; END_IF`"""
        if holds.type is ERROR:
            return []
        if message:
            text = self._c.expr(message[0])
            if isinstance(text, Const) and isinstance(text.value, str):  # "..." is a WSTRING elsewhere
                text = Const(text.value, StringType(len(text.value)), text.pos)
            if not isinstance(text.type, StringType) or text.type.wide:
                self._c.error(message[0].pos, "type", f"the message of an assert is a STRING, not {text.type}")
                return []
            operands = [*operands, ("message", text)]
        assert isinstance(call.callee, ast.Name)
        pos, store = self._c.pos(call.pos), list[Statement]()
        told = {role: self._store(role, e, store) for role, e in operands}
        number = len(self._bench.asserts) + 1
        self._bench.asserts.append(Assertion(pos, call.callee.name.upper(), **told))
        store.append(Assign(self._bench.place(FAILED, pos), Const(number, DINT, pos), pos))
        if self._cleaning:
            store = [If([(self._bench.passed(pos), store)], [], pos)]
        return [*before, If([(Unary(UnaryOp.NOT, holds, BOOL, pos), [*store, Return(pos)])], [], pos)]

    def _store(self, role: str, e: Expr, store: list[Statement]) -> Operand:
        if isinstance(e, Const):
            return Operand(e.type, e.value)
        t = _MESSAGE if role == "message" else e.type
        variable = self._bench.operand(role, t)
        store.append(Assign(VarPlace(variable, t, e.pos), e, e.pos))
        return Operand(t, variable=variable.name)

    # ---- time ----

    def _advance_time(self, call: ast.Call) -> list[Statement]:
        nodes = self._nodes(call, 1, message=False)
        e = None if nodes is None else self._c.settled(nodes[0])
        if e is None or e.type is ERROR:
            return []
        if e.type not in (TIME, LTIME):
            base = elementary(e.type)
            if base is None or base.kind is not Kind.INT:
                message = f"ADVANCE_TIME takes a duration such as T#10ms, or a number of nanoseconds, not {e.type}"
                self._c.error(call.pos, "type", message)
                return []
            e = convert(e, LTIME)
        if isinstance(e, Const) and isinstance(e.value, int) and e.value < 0:
            self._c.error(call.pos, "range", "time does not go back")
            return []
        pos = self._c.pos(call.pos)
        long, short = self._bench.place(LTIME_NOW, pos), self._bench.place(TIME_NOW, pos)
        step = time_to_ltime(e) if e.type is TIME else e
        total = Binary(BinaryOp.ADD, Load(long, LTIME, pos), step, LTIME, pos)
        milliseconds = convert_explicitly(self._c, Load(long, LTIME, pos), TIME)
        assert milliseconds is not None
        moved = [Assign(long, total, pos), Assign(short, milliseconds, pos)]
        return [*moved, *self._devices.let_pass(self._c, call.pos)]

    # ---- forces ----

    def _force(self, call: ast.Call) -> list[Statement]:
        nodes = self._nodes(call, 2, message=False)
        return [] if nodes is None else self._forces.force(self._c, nodes[0], nodes[1], call.pos)

    def _unforce(self, call: ast.Call) -> list[Statement]:
        """UNFORCE(variable), or UNFORCE() for all."""
        if not call.args:
            return self._forces.unforce_all(self._c, call.pos)
        nodes = self._nodes(call, 1, message=False)
        return [] if nodes is None else self._forces.unforce(self._c, nodes[0], call.pos)

    # ---- mocks ----

    def _mock(self, call: ast.Call) -> list[Statement]:
        """MOCK instance;"""
        place = self._mock_member(call, 1, mocks.MOCKED)
        return [] if place is None else [Assign(place_of(place), Const(1, BOOL, place.pos), place.pos)]

    def _mock_member(self, call: ast.Call, count: int, name: str) -> Expr | None:
        """A hidden member of the instance that is the first argument."""
        nodes = self._nodes(call, count, message=name == mocks.CALLS)
        if nodes is None:
            return None
        method = self._hidden_of(nodes[0], mocks.calls_of) if name == mocks.CALLS else None
        if method is not None:
            return method
        if isinstance(nodes[0], ast.Member) and bound_member(self._c, nodes[0]) is not None:
            message = "this is not an instance; for a method write MOCK_FUNCTION instance.m RETURNS ..."
            self._c.error(nodes[0].pos, "mock", message)
            return None
        instance = self._c.expr(nodes[0])
        if instance.type is ERROR:
            return None
        block = self._c.world.blocks.get(instance.type) if isinstance(instance.type, StructType) else None
        if block is None or name not in block.members:
            self._c.error(nodes[0].pos, "mock", "MOCK needs an instance of a function block")
            return None
        return member_of(self._c, instance, ast.Member(nodes[0].pos, nodes[0], name, nodes[0].pos))

    def _hidden_of(self, node: ast.Expr, name: Callable[[str], str]) -> Expr | None:
        """A hidden variable of the method or property `instance.m`; None when there is none."""
        bound = bound_member(self._c, node) if isinstance(node, ast.Member) else None
        if bound is None or bound.place is None or not isinstance(node, ast.Member):
            return None
        member = bound.cls.find(bound.key) or bound.cls.find(f"{bound.key}.get")
        block = member.owner.block if member is not None else None
        if member is None or block is None or name(member.name) not in block.members:
            return None
        return member_of(
            self._c, self._c.expr(node.base), ast.Member(node.pos, node.base, name(member.name), node.name_pos)
        )

    def _mock_function(self, call: ast.Call) -> list[Statement]:
        """`MOCK_FUNCTION name RETURNS value`, `MOCK_FUNCTION instance.method RETURNS value`"""
        target, value = call.args[0].value, call.args[1].value
        assert target is not None and value is not None
        if isinstance(target, ast.Name):
            switch, result = (self._global(name(target.name)) for name in (mocks.switch_of, mocks.value_of))
            what = f"there is no function {target.name} in this program that could be mocked"
        else:
            switch, result = (self._hidden_of(target, name) for name in (mocks.switch_of, mocks.value_of))
            what = "MOCK_FUNCTION needs a function, or a method of an instance, that returns something"
        if switch is None or result is None:
            self._c.error(target.pos, "mock", what)
            return []
        e, pos = self._c.value(value, result.type), self._c.pos(call.pos)
        if e.type is ERROR:
            return []
        return [Assign(place_of(switch), Const(1, BOOL, pos), pos), Assign(place_of(result), e, pos)]

    def _global(self, name: str) -> Expr | None:
        symbol = self._c.world.names.lookup(name, library=False)
        if not isinstance(symbol, GlobalSymbol):
            return None
        return variable_value(self._c.world.declared.variable(symbol), self._c.pos(0))

    def _verify_called(self, call: ast.Call) -> list[Statement]:
        calls = self._mock_member(call, 1, mocks.CALLS)
        if calls is None:
            return []
        return self._verify(call, BinaryOp.GT, calls, Const(0, UDINT, calls.pos), 1)

    def _verify_call_count(self, call: ast.Call) -> list[Statement]:
        calls = self._mock_member(call, 2, mocks.CALLS)
        count = call.args[1].value if len(call.args) > 1 else None
        if calls is None or count is None:
            return []
        return self._verify(call, BinaryOp.EQ, calls, self._c.value(count, UDINT), 2)

    def _verify(self, call: ast.Call, op: BinaryOp, calls: Expr, wanted: Expr, count: int) -> list[Statement]:
        before: list[Statement] = []
        actual, expected = self._keep("actual", calls, before), self._keep("expected", wanted, before)
        holds = operate(self._c, op, actual, expected, call.pos)
        message = [a.value for a in call.args[count:] if a.value is not None]
        return self._assertion(call, holds, before, [("actual", actual), ("expected", expected)], message)


def _as_real(e: Expr) -> Expr:
    """Integers as LREAL, so that a difference of unsigned ones may be negative."""
    base = elementary(e.type)
    return convert(e, LREAL) if base is not None and base.kind in NUMBERS else e
