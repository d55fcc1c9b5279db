"""ARRAY[*]: a parameter that takes arrays of any size. The array is passed by its address, the bounds of its
dimensions beside it, as inputs that have no name in the program: lower and upper one, DINT.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence

from plctool.compiler.typed import (
    Binary,
    BinaryOp,
    Const,
    Direction,
    Expr,
    Load,
    Parameter,
    Place,
    Pos,
    Storage,
    Variable,
    VarPlace,
)
from plctool.iec.types import DINT, ArrayType, OpenArrayType

Bounds = list[tuple[Expr, Expr]]


def give_bounds(variable: Variable, storage: Storage) -> list[Variable]:
    """Makes the variables that hold the bounds of an ARRAY[*]; none for any other type."""
    if not isinstance(variable.type, OpenArrayType):
        return []
    for number, _ in enumerate(variable.type.bounds, 1):
        low, high = (
            Variable(f"%{variable.name}.{end}{number}", DINT, storage, variable.pos) for end in ("lower", "upper")
        )
        variable.bounds.append((low, high))
    return [bound for pair in variable.bounds for bound in pair]


def bound_parameters(parameters: Sequence[Parameter]) -> list[Parameter]:
    """The inputs after the parameters of a function that hold the bounds of those that are an ARRAY[*]."""
    variables = [v for p in parameters for v in give_bounds(p.variable, Storage.LOCAL)]
    return [Parameter(v, Direction.INPUT) for v in variables]


def bounds_of(place: Expr | Place) -> Bounds:
    """Lower and upper bound of each dimension of an array: constants, or variables for an ARRAY[*]."""
    t, pos = place.type, place.pos
    assert isinstance(t, ArrayType)
    if isinstance(t, OpenArrayType) and isinstance(place, VarPlace):
        return [(_load(low, pos), _load(high, pos)) for low, high in place.var.bounds]
    return _constants(t, pos)


def total_size(place: Place) -> Expr:
    """The bytes of a place, which of an ARRAY[*] are known when it runs (DINT)."""
    t, pos = place.type, place.pos
    if not isinstance(t, OpenArrayType):
        return Const(t.size, DINT, pos)
    size: Expr = Const(t.element.size, DINT, pos)
    for low, high in bounds_of(place):
        count = Binary(BinaryOp.ADD, Binary(BinaryOp.SUB, high, low, DINT, pos), Const(1, DINT, pos), DINT, pos)
        size = Binary(BinaryOp.MUL, size, count, DINT, pos)
    return size


def handed_bounds(parameter: Variable, argument: Expr | Place | None, pos: Pos) -> list[tuple[Variable, Expr]]:
    """What the variables of an ARRAY[*] get when `argument` is passed: an array, or nothing for an output
    that is not wanted."""
    t = parameter.type
    if not isinstance(t, OpenArrayType):
        return []
    given = _constants(t, pos) if argument is None else bounds_of(argument)
    pairs = zip(parameter.bounds, given, strict=True)
    return [(variable, value) for variables, values in pairs for variable, value in zip(variables, values, strict=True)]


def _constants(t: ArrayType, pos: Pos) -> Bounds:
    return [(Const(low, DINT, pos), Const(high, DINT, pos)) for low, high in t.bounds]


def _load(variable: Variable, pos: Pos) -> Load:
    return Load(VarPlace(variable, DINT, pos), DINT, pos)
