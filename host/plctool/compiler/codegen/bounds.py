"""What a check of bounds compares, for the symbol file (`debug/bounds.py`)."""

from __future__ import annotations

from collections.abc import Container, Iterator
from contextlib import suppress

from plctool.compiler.typed.nodes import (
    Binary,
    BinaryOp,
    Const,
    Convert,
    Expr,
    IndexPlace,
    Load,
    MemberPlace,
    Place,
    Pos,
    Pou,
    SelfPlace,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.debug.bounds import BoundsCheck, Term
from plctool.iec.types import ArrayType, Elementary, Kind, StructType, Type, base_of

_INTEGERS = (Kind.INT, Kind.BIT)


class _Unknown(Exception):
    """A value that cannot be read when the program has stopped."""


def bounds_check(
    pou: Pou | None, array: Place | None, value: Expr, low: int, high: int, pos: Pos, lost: Container[Variable]
) -> BoundsCheck:
    """The check of an index of `array`, or of what is assigned (None). `lost`: variables that are not in memory."""
    what = _name(array) if array is not None else ""
    t, constant, terms = base_of(value.type), 0, None
    with suppress(_Unknown):
        if any(isinstance(node, VarPlace) and node.var in lost for node in walk(value)):
            raise _Unknown
        parts = list(_terms(value, 1))
        terms = tuple(part for part in parts if isinstance(part, Term))
        constant = sum(part for part in parts if isinstance(part, int))
    block = pou.instance.name if pou is not None and pou.instance is not None else ""
    return BoundsCheck(pos.file, pos.line, block, what, low, high, t.name, constant, terms)


def _terms(e: Expr, factor: int) -> Iterator[Term | int]:
    """The parts of a sum. A conversion is of a variable only: that of a sum may wrap."""
    if isinstance(e, Const) and isinstance(e.value, int):
        yield factor * e.value
    elif isinstance(e, Convert) and isinstance(e.operand, Load) and e.check is None:
        yield from _terms(e.operand, factor)
    elif isinstance(e, Load):
        area, offset = _where(e.place)
        t = base_of(e.type)
        if not isinstance(t, Elementary) or t.kind not in _INTEGERS:
            raise _Unknown
        yield Term(factor, area, offset, t.name)
    elif isinstance(e, Binary) and e.op in (BinaryOp.ADD, BinaryOp.SUB):
        yield from _terms(e.left, factor)
        yield from _terms(e.right, factor if e.op is BinaryOp.ADD else -factor)
    elif isinstance(e, Binary) and e.op is BinaryOp.MUL:
        times, of = (e.left, e.right) if isinstance(e.left, Const) else (e.right, e.left)
        if not isinstance(times, Const) or not isinstance(times.value, int):
            raise _Unknown
        yield from _terms(of, factor * times.value)
    else:
        raise _Unknown


def _where(place: Place) -> tuple[int | None, int]:
    """Area (None: that of the instance) and offset of a variable that outlives the call."""
    if isinstance(place, VarPlace) and place.var.bit is None:
        if place.var.storage is Storage.AREA:
            return place.var.area.value, place.var.offset
        if place.var.storage is Storage.SELF:
            return None, place.var.offset
    elif isinstance(place, SelfPlace):
        return None, 0
    elif isinstance(place, MemberPlace):
        area, offset = _where(place.base)
        return area, offset + place.offset
    elif isinstance(place, IndexPlace) and isinstance(place.base.type, ArrayType):
        area, offset = _where(place.base)
        return area, offset + _element_number(place, place.base.type) * place.type.size
    raise _Unknown


def _element_number(place: IndexPlace, t: ArrayType) -> int:
    number = 0
    for index, (low, high) in zip(place.indices, t.bounds, strict=True):
        if not isinstance(index, Const):
            raise _Unknown
        number = number * (high - low + 1) + int(index.value) - low
    return number


def _name(place: Place) -> str:
    """How a user calls it; the instance that a block runs on is left out."""
    if isinstance(place, VarPlace):
        return place.var.name
    if isinstance(place, MemberPlace):
        member = _member(place.base.type, place.offset)
        return member if isinstance(place.base, SelfPlace) else f"{_name(place.base)}.{member}"
    if isinstance(place, IndexPlace):
        indices = ", ".join(str(i.value) if isinstance(i, Const) else "..." for i in place.indices)
        return f"{_name(place.base)}[{indices}]"
    return "an array"


def _member(t: Type, offset: int) -> str:
    return next((f.name for f in t.fields if f.offset == offset), "?") if isinstance(t, StructType) else "?"
