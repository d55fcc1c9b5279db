"""The asserts of unit tests, and the hidden variables that say which one has failed, and of what values.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.semantics.conversions import load
from plctool.compiler.semantics.world import World
from plctool.compiler.typed.nodes import Binary, BinaryOp, Const, Expr, Pos, Storage, Variable, VarPlace
from plctool.iec.types import BOOL, DINT, LTIME, TIME, Type

NUMBER, FAILED = "__test", "__failed"
"""Hidden variables: the test to run (from 0); afterwards the assert that failed (from 1)."""

TIME_NOW, LTIME_NOW = "__time", "__ltime"
"""Hidden variables: the time that the tests see."""
LIVE = "__live"
"""Hidden variable: the devices work while time passes."""
_NOWHERE = Pos("", 0, 0)


@dataclass(frozen=True)
class Operand:
    """A value an assert is about: a constant, or what the hidden variable holds after the failure."""

    type: Type
    value: int | float | str = 0
    variable: str = ""


@dataclass(frozen=True)
class Assertion:
    """An assert: where it stands, what it is called, what it compares."""

    pos: Pos
    name: str
    actual: Operand
    expected: Operand
    tolerance: Operand | None = None
    message: Operand | None = None


class Bench:
    """What all tests of a program share: its asserts, numbered from 1, and the hidden variables."""

    def __init__(self, world: World, asserts: list[Assertion]) -> None:
        self.asserts = asserts
        self._world = world
        self._operands: dict[tuple[str, Type], Variable] = {}
        self._count = 0
        hidden = ((NUMBER, DINT), (FAILED, DINT), (TIME_NOW, TIME), (LTIME_NOW, LTIME), (LIVE, BOOL))
        self._hidden = {name: self._variable(name, t) for name, t in hidden}
        world.clock.update({"TIME": self._hidden[TIME_NOW], "LTIME": self._hidden[LTIME_NOW]})

    def _variable(self, name: str, t: Type) -> Variable:
        made = Variable(name, t, Storage.AREA, _NOWHERE)
        self._world.allocation.add(made)
        return made

    def operand(self, role: str, t: Type) -> Variable:
        """The hidden variable for one side of an assert."""
        found = self._operands.get((role, t))
        if found is None:
            found = self._operands[role, t] = self.hidden(role, t)
        return found

    def hidden(self, role: str, t: Type) -> Variable:
        """A new hidden variable."""
        self._count += 1
        return self._variable(f"__{role}{self._count}", t)

    def place(self, name: str, pos: Pos) -> VarPlace:
        """One of the hidden variables that every program of tests has."""
        variable = self._hidden[name]
        return VarPlace(variable, variable.type, pos)

    def passed(self, pos: Pos) -> Expr:
        """Whether no assert has failed so far."""
        return Binary(BinaryOp.EQ, load(self.place(FAILED, pos)), Const(0, DINT, pos), BOOL, pos)
