"""What is known of a typed expression by itself, and the place it was loaded from.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.symbols import UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.typed import (
    BitPlace,
    DerefPlace,
    Expr,
    Load,
    Place,
    Pos,
    SelfPlace,
    Storage,
    ValuePlace,
    Variable,
    VarPlace,
)  # fmt: skip
from plctool.iec.types import BOOL, BYTE, ReferenceType


def is_untyped(e: Expr) -> bool:
    """Whether the expression is a constant that takes the type its surroundings need."""
    return e.type is UNTYPED_INT or e.type is UNTYPED_REAL


def place_of(e: Expr) -> Place:
    """The place a value was loaded from, or a temporary one."""
    return e.place if isinstance(e, Load) else ValuePlace(e, e.type, e.pos)


def whole(variable: Variable, pos: Pos) -> Place:
    """The place of a variable: of a bit at an address, that bit of the byte there."""
    if variable.bit is None:
        return VarPlace(variable, variable.type, pos)
    return BitPlace(VarPlace(variable, BYTE, pos), variable.bit, BOOL, pos)


def is_temporary(place: Place) -> bool:
    """Whether a place is (part of) a value that no other code sees."""
    while not isinstance(place, VarPlace | DerefPlace | ValuePlace | SelfPlace):
        place = place.base
    return isinstance(place, ValuePlace)


def is_exact(place: Place) -> bool:
    """Whether an instance is of just the type it is declared with: it is not reached through a reference."""
    if isinstance(place, VarPlace):
        return place.var.storage is not Storage.REFERENCE
    if isinstance(place, SelfPlace):
        return place.exact
    return not isinstance(place, DerefPlace)


def load(place: Place) -> Load:
    """The value of a place; of a reference, the value it refers to."""
    if isinstance(place.type, ReferenceType):
        place = DerefPlace(Load(place, place.type, place.pos), place.type.target, place.pos)
    return Load(place, place.type, place.pos)
