"""What is needed twice, and whose calls must not run twice, is kept in a hidden variable.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import whole
from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    AssignedValue,
    Call,
    Const,
    DerefPlace,
    Expr,
    Load,
    Place,
    Pos,
    Storage,
    Variable,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import PointerType, Type


def calls(node: Expr | Place) -> bool:
    """Whether something calls or assigns when it is worked out."""
    return any(isinstance(part, Call | AssignedValue) for part in walk(node))


def kept_value(c: Checker, e: Expr, t: Type) -> tuple[Expr, Expr]:
    """A value that is needed twice, as one of `t`: the first time, and then."""
    if isinstance(e, Const) or c.scope.pou is None:
        return e, e
    place = hidden_place(c, t, e.pos)
    return AssignedValue(Assign(place, e, e.pos), t, e.pos), Load(place, t, e.pos)


def kept_place(c: Checker, place: Place) -> tuple[list[Assign], Place]:
    """A place that is needed again after what may change where it is: what is done first, and the place."""
    if c.scope.pou is None or not any(isinstance(part, Load | Call | DerefPlace) for part in walk(place)):
        return [], place
    pointer = PointerType(place.type)
    kept = hidden_place(c, pointer, place.pos)
    address = AddressOf(place, pointer, place.pos)
    return [Assign(kept, address, place.pos)], DerefPlace(Load(kept, pointer, place.pos), place.type, place.pos)


def hidden_place(c: Checker, t: Type, pos: Pos) -> Place:
    """A variable of the unit that the source does not name."""
    assert c.scope.pou is not None
    variable = Variable(f"%kept{len(c.scope.pou.locals)}", t, Storage.LOCAL, pos)
    c.scope.pou.locals.append(variable)
    return whole(variable, pos)
