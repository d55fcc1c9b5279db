"""__VARINFO(x): what is known of a variable, as a structure.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import convert, error_value
from plctool.compiler.semantics.generics import class_of
from plctool.compiler.semantics.rules.places import named_place
from plctool.compiler.semantics.symbols import PouSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    AddressOf,
    BitPlace,
    Call,
    Expr,
    Initial,
    Load,
    MemberPlace,
    Place,
    ScalarInit,
    Storage,
    StructInit,
    Variable,
    VarPlace,
)
from plctool.iec.areas import Area
from plctool.iec.types import BYTE, LWORD, ArrayType, OpenArrayType, RawPointerType, StructType, Type

VARINFO = "__VARINFO"
_NAME, _TYPE_NAME = 39, 79  # characters of Symbol and TypeName
_NO_TYPE = 29  # TYPE_NONE in any.st
_AREAS = {Area.MEMORY: 0, Area.INPUT: 1, Area.OUTPUT: 2, Area.RETAIN: 3}  # MEMORY_AREA in any.st
_GLOBAL, _LOCAL = 4, 5
_ADDRESSED = (Area.MEMORY, Area.INPUT, Area.OUTPUT)


def varinfo(c: Checker, node: ast.Call) -> Expr:
    """The structure, made of a constant and the address."""
    args = [a.value for a in node.args if a.name is None and a.value is not None]
    if len(node.args) != 1 or len(args) != 1:
        return c.error(node.pos, "arguments", f"{VARINFO} takes 1 argument: a variable")
    place, pos = named_place(c, args[0], VARINFO), c.pos(node.pos)
    if place is None:
        return error_value(pos)
    if isinstance(place.type, OpenArrayType):
        return c.error(node.pos, "type", f"the size of an ARRAY[*] is known in each call only; {VARINFO} is not for it")
    symbol = c.world.names.unit("varinfo__", library=True)
    assert isinstance(symbol, PouSymbol)
    info = c.world.declared.function(symbol, {})
    assert info is not None and isinstance(info.result, StructType)
    name = f"info of {args[0].pos} {c.scope.source.path}"
    fixed = Variable(name, info.result, Storage.AREA, pos, constant=True)
    written = _written(args[0])

    def fill() -> None:
        fixed.initial = _facts(place, written)

    c.world.allocation.add(fixed)
    c.world.allocation.once_placed.append(fill)
    whole = place.base if isinstance(place, BitPlace) else place
    address = convert(AddressOf(whole, RawPointerType(BYTE), pos), LWORD)
    c.world.calls.add(c.scope.pou, info.pou, pos)
    return Call(info.pou, [Load(VarPlace(fixed, info.result, pos), info.result, pos), address], info.result, pos)


def _facts(place: Place, written: str) -> StructInit:
    """All but the address."""
    t, bit = place.type, place.bit if isinstance(place, BitPlace) else -1
    root, offset = _root(place.base if isinstance(place, BitPlace) else place)
    area = root.area if root is not None and root.storage is Storage.AREA else None
    if root is not None and root.bit is not None:
        bit = root.bit
    located = area in _ADDRESSED and offset >= 0
    element = _element(t)
    facts: dict[str, int | str] = {
        "ByteOffset": max(offset, 0),
        "Area": -1 if area is None else area.value,
        "BitNr": bit,
        "BitSize": 1 if bit >= 0 else t.size * 8,
        "BitAddress": offset * 8 + max(bit, 0) if located else 0,
        "TypeClass": class_of(t),
        "TypeName": str(t)[:_TYPE_NAME],
        "NumElements": 0 if element is t else t.size // element.size,
        "BaseTypeClass": _NO_TYPE if element is t else class_of(element),
        "ElemBitSize": 0 if element is t else element.size * 8,
        "MemoryArea": _LOCAL if area is None else _AREAS.get(area, _GLOBAL),
        "Symbol": written[:_NAME],
    }
    members: dict[str, Initial] = {name: ScalarInit(value) for name, value in facts.items()}
    return StructInit(members)


def _root(place: Place) -> tuple[Variable | None, int]:
    """The variable that a place is a part of, and the offset in its area or instance; -1 if that is not known."""
    if isinstance(place, VarPlace):
        return place.var, place.var.offset
    if isinstance(place, MemberPlace):
        root, offset = _root(place.base)
        return root, offset + place.offset if offset >= 0 else -1
    return None, -1


def _element(t: Type) -> Type:
    while isinstance(t, ArrayType):
        t = t.element
    return t


def _written(node: ast.Expr) -> str:
    """The variable as the source has it."""
    if isinstance(node, ast.Name):
        return node.name
    if isinstance(node, ast.DirectAddress):
        return node.text
    if isinstance(node, ast.Member):
        return f"{_written(node.base)}.{node.name}"
    if isinstance(node, ast.Deref):
        return f"{_written(node.base)}^"
    if isinstance(node, ast.BitAccess):
        return f"{_written(node.base)}.{node.index}"
    if isinstance(node, ast.Index):
        return f"{_written(node.base)}[{','.join(_written(i) for i in node.indices)}]"
    if isinstance(node, ast.Literal):
        return str(node.value)
    return "..."
