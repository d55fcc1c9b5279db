"""Parameters that take arguments of many types: ANY_... of every type of a group, ANY whatever there is, and ARRAY[*].

Methods have it so, and functions whose statements name `x.pValue`, `x.diSize` or `x.TypeClass`; all others with
ANY are generic. Such an argument is passed as its address; size and kind follow after the parameters, as
inputs that have no name in the program. The body begins by putting them together.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache

from plctool.compiler.semantics.conversions import load
from plctool.compiler.semantics.symbols import DIRECTIONS
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    Binary,
    BinaryOp,
    Const,
    Direction,
    Expr,
    Load,
    MemberPlace,
    Parameter,
    Place,
    Pos,
    Statement,
    Storage,
    Variable,
    VarPlace,
)
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    ELEMENTARY,
    INT,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    Kind,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
)

# ---- ANY_... and its kin ----

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


# ---- ANY ----

NAME = "AnyType"
_MEMBERS = frozenset(("typeclass", "pvalue", "disize"))
_CLASSES: tuple[tuple[type[Type], int], ...] = (
    (EnumType, 25), (SubrangeType, 24), (InterfaceType, 39), (ReferenceType, 23), (PointerType, 22), (ArrayType, 26),
    (StructType, 28),
)  # fmt: skip
"""The kinds of TYPE_CLASS in any.st; those of elementary types are in their definition."""


def class_of(t: Type) -> int:
    """The number of a type in TYPE_CLASS."""
    if isinstance(t, Elementary):
        return t.type_class
    if isinstance(t, StringType):
        return 17 if t.wide else 16
    return next(number for kind, number in _CLASSES if isinstance(t, kind))


@cache
def describes_any(decl: ast.PouDecl) -> bool:
    """Whether parameters of type ANY_... describe their arguments in this unit."""
    lines = [line for b in decl.blocks if b.keyword in DIRECTIONS for line in b.decls]
    names = {n.casefold() for line in lines if is_any(line.type) for _, n in line.names}
    if not names:
        return False
    return decl.keyword is ast.Unit.METHOD or any(
        isinstance(m.base, ast.Name) and m.base.name.casefold() in names and m.name.casefold() in _MEMBERS
        for m in ast.every(ast.Member, decl.body)
    )


def is_any(spec: ast.TypeSpec) -> bool:
    """Whether a type is ANY, ANY_INT ..."""
    return isinstance(spec, ast.NamedType) and is_group(spec.name)


def group_of(spec: ast.TypeSpec) -> str:
    """ANY_INT of a declaration, in capitals."""
    assert isinstance(spec, ast.NamedType)
    return spec.name.upper()


def parameter(name: str, value: Variable) -> tuple[Parameter, list[Parameter], list[Statement]]:
    """The parameter that is passed for `value`, an AnyType; those after all others; what the body begins with."""
    pos, t = value.pos, value.type
    assert isinstance(t, StructType)
    address, kind, size = (
        Variable(given, of, Storage.LOCAL, pos)
        for given, of in ((name, RawPointerType(BYTE)), (f"%{name}.class", INT), (f"%{name}.size", DINT))
    )
    begin: list[Statement] = [
        Assign(part(VarPlace(value, t, pos), member), Load(VarPlace(v, v.type, pos), v.type, pos), pos)
        for member, v in (("pValue", address), ("diSize", size))
    ]
    begin.append(Assign(part(VarPlace(value, t, pos), "TypeClass", INT), Load(VarPlace(kind, INT, pos), INT, pos), pos))
    return Parameter(address, Direction.INPUT), [Parameter(v, Direction.INPUT) for v in (kind, size)], begin


def part(place: Place, name: str, seen_as: Type | None = None) -> Place:
    """A member of an AnyType."""
    assert isinstance(place.type, StructType)
    field = place.type.member(name)
    assert field is not None
    return MemberPlace(place, field.offset, seen_as or field.type, place.pos)


def handed(place: Place, described: Type, size: Expr) -> tuple[Expr, list[Expr]]:
    """What a call passes for `place`, and after the arguments. One of the type `described`, the AnyType, is passed
    on."""
    pos: Pos = place.pos
    if place.type is described:
        address, kind, bytes_ = (
            load(part(place, name, seen)) for name, seen in (("pValue", None), ("TypeClass", INT), ("diSize", None))
        )
        return address, [kind, bytes_]
    return AddressOf(place, RawPointerType(BYTE), pos), [Const(class_of(place.type), INT, pos), size]


def kept(own: Place, place: Place, size: Expr) -> list[Statement]:
    """What makes `own`, the AnyType of an instance, describe `place`."""
    address, (kind, bytes_) = handed(place, own.type, size)
    parts = (("pValue", None, address), ("TypeClass", INT, kind), ("diSize", None, bytes_))
    return [Assign(part(own, name, seen), value, place.pos) for name, seen, value in parts]


# ---- ARRAY[*] ----

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
