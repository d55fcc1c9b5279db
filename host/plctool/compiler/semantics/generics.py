"""Generic types: parameters of type ANY_... take every type of a group. Those of one name take the same type: ANY_INT_2
is one of ANY_INT as well, and may be another one.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable

from plctool.compiler.semantics.symbols import DIRECTIONS
from plctool.compiler.syntax import ast
from plctool.iec.types import BOOL, ELEMENTARY, Elementary, EnumType, Kind, StringType, SubrangeType, Type, base_of

LIBRARY_STRING = StringType(255)  # STRING without a length, as parameter or result of a library function
WIDE_LIBRARY_STRING = StringType(255, wide=True)


def _of_kind(*kinds: Kind) -> Callable[[Type], bool]:
    def accepts(t: Type) -> bool:
        base = base_of(t)
        return isinstance(base, Elementary) and base.kind in kinds

    return accepts


def _elementary(t: Type) -> bool:
    return isinstance(t, Elementary | StringType | EnumType | SubrangeType)


def _signed(t: Type) -> bool:
    base = base_of(t)
    return isinstance(base, Elementary) and base.kind is Kind.INT and base.signed


def _unsigned(t: Type) -> bool:
    base = base_of(t)
    return isinstance(base, Elementary) and base.kind is Kind.INT and not base.signed


def _string(t: Type) -> bool:
    return isinstance(t, StringType)


GROUPS: dict[str, Callable[[Type], bool]] = {
    "ANY": lambda t: True,
    "ANY_DERIVED": lambda t: not _elementary(t),
    "ANY_ELEMENTARY": _elementary,
    "ANY_MAGNITUDE": _of_kind(Kind.INT, Kind.REAL, Kind.TIME, Kind.BIT),
    "ANY_NUM": _of_kind(Kind.INT, Kind.REAL, Kind.BIT),
    "ANY_REAL": _of_kind(Kind.REAL),
    "ANY_INT": _of_kind(Kind.INT, Kind.BIT),
    "ANY_SIGNED": _signed,
    "ANY_UNSIGNED": _unsigned,
    "ANY_BIT": lambda t: base_of(t) is BOOL or _of_kind(Kind.BIT, Kind.INT)(t),
    "ANY_DURATION": _of_kind(Kind.TIME),
    "ANY_DATE": _of_kind(Kind.DATE),
    "ANY_STRING": _string,
    "ANY_CHARS": lambda t: _string(t) or _of_kind(Kind.CHAR)(t),
    "ANY_CHAR": _of_kind(Kind.CHAR),
}
"""Group name -> whether a type belongs to it. Bit strings count as unsigned integers, as existing dialects have it."""

_NUMBERED = re.compile(r"_\d+\Z")


def group_name(name: str) -> str:
    """ANY_INT of ANY_INT_2, in capitals."""
    return _NUMBERED.sub("", name.upper())


def is_group(name: str) -> bool:
    """Whether a type of this name is a generic one."""
    return group_name(name) in GROUPS


def accepts(name: str, t: Type) -> bool:
    """Whether a type belongs to a group."""
    return GROUPS[group_name(name)](t)


def is_generic(decl: ast.PouDecl) -> bool:
    """Whether parameters of a function are of a type ANY_..."""
    parameters = (line.type for b in decl.blocks if b.keyword in DIRECTIONS for line in b.decls)
    return any(isinstance(spec, ast.NamedType) and is_group(spec.name) for spec in parameters)


def first_of(name: str) -> Type:
    """Some type of a group, for what is not used."""
    return next(t for t in ELEMENTARY.values() if accepts(name, t))
