"""ANY in the way of CODESYS: a parameter that tells address, size and kind of its argument, whatever that is.

Methods have it so, and functions whose statements name `x.pValue`, `x.diSize` or `x.TypeClass`; all others with
ANY are generic. Such an argument is passed as its address; size and kind follow after the parameters, as
inputs that have no name in the program. The body begins by putting them together.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from functools import cache

from plctool.compiler.semantics.generics import is_group
from plctool.compiler.semantics.symbols import DIRECTIONS
from plctool.compiler.semantics.values import load
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    AddressOf,
    Assign,
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
)  # fmt: skip
from plctool.iec.types import (
    BYTE,
    DINT,
    INT,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)

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
    return decl.keyword == "METHOD" or any(
        isinstance(m.base, ast.Name) and m.base.name.casefold() in names and m.name.casefold() in _MEMBERS
        for m in ast.every(ast.Member, decl.body)
    )


def is_any(spec: ast.TypeSpec) -> bool:
    """Whether a type is ANY, ANY_INT ..."""
    return isinstance(spec, ast.NamedType) and is_group(spec.name)


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


def handed(place: Place, t: Type, size: Expr) -> tuple[Expr, list[Expr]]:
    """What a call passes for `place`, and after the arguments. An AnyType is passed on."""
    pos: Pos = place.pos
    if isinstance(place.type, StructType) and place.type.name == NAME:
        address, kind, bytes_ = (
            load(part(place, name, seen)) for name, seen in (("pValue", None), ("TypeClass", INT), ("diSize", None))
        )
        return address, [kind, bytes_]
    return AddressOf(place, RawPointerType(BYTE), pos), [Const(class_of(t), INT, pos), size]
