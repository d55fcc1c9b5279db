"""Forced variables: the list of a controller, and the names of what is in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from plctool.core import lib
from plctool.debug.variables import Symbol
from plctool.errors import DeviceError, UsageError, with_article
from plctool.iec.areas import Area
from plctool.iec.types import (
    ELEMENTARY,
    ArrayType,
    Elementary,
    Kind,
    PointerType,
    StringType,
    StructType,
    Type,
    base_of,
)

_LETTERS = {Area.INPUT.value: "I", Area.OUTPUT.value: "Q", Area.MEMORY.value: "M"}
_WIDTHS = {1: "B", 2: "W", 4: "D", 8: "L"}
_ALL_BITS = 0xFF
_POINTER_SIZE = PointerType(ELEMENTARY["BYTE"]).size


@dataclass(frozen=True)
class ForcedPlace:
    """The first `size` bytes of `value` are forced to an area from `offset` on; with `hops` a pointer is there, and so
    on, as `Symbol.place` says it. `mask`: the bits of a single byte."""

    area: int
    offset: int
    hops: tuple[int, ...]
    size: int
    mask: int = _ALL_BITS
    value: bytes = b""

    @property
    def way(self) -> tuple[int, tuple[int, ...]]:
        """What leads to the offset in `begin`."""
        return self.area, (self.offset, *self.hops)[:-1]

    @property
    def begin(self) -> int:
        return (self.offset, *self.hops)[-1]

    @property
    def is_bits(self) -> bool:
        return self.mask != _ALL_BITS

    def overlaps(self, symbol: Symbol) -> bool:
        """Whether a part of the variable is forced."""
        other = place_of(symbol)
        apart = self.begin >= other.begin + other.size or other.begin >= self.begin + self.size
        return self.way == other.way and not apart and bool(self.mask & other.mask or self.size + other.size > 2)

    def needs(self, symbol: Symbol) -> bool:
        """True if it is a part of the variable, or if the way to it begins there."""
        if self.hops:
            return replace(self, hops=(), size=_POINTER_SIZE, mask=_ALL_BITS).overlaps(symbol) or self.overlaps(symbol)
        return self.overlaps(symbol)

    def same_place(self, other: ForcedPlace) -> bool:
        return replace(self, value=b"") == replace(other, value=b"")


@dataclass(frozen=True)
class ForceList:
    """What a controller has forced, in that order. `serial` differs after each change; at most `room` at a time."""

    serial: int
    room: int
    places: list[ForcedPlace] = field(default_factory=list)


def place_of(symbol: Symbol) -> ForcedPlace:
    """Where a variable is, as far as it is forced: a bit is one of its byte."""
    area, offset, hops = symbol.place
    whole = ForcedPlace(area, offset, hops, symbol.size)
    if symbol.bit is None:
        return whole
    byte, bit = divmod(symbol.bit, 8)
    way = (offset, *hops)
    first, *rest = (*way[:-1], way[-1] + byte)
    return ForcedPlace(area, first, tuple(rest), 1, 1 << bit)


def name_forced(places: Iterable[ForcedPlace], variables: Iterable[Symbol]) -> dict[str, tuple[Symbol, bytes]]:
    """Each forced variable by its name, with its content; by its address what no variable is declared at."""
    known = [symbol for symbol in variables if symbol.fixed is None]
    named = [(_variable_at(place, known) or _address(place), place) for place in places]
    return {symbol.name: (symbol, _content(symbol, place)) for symbol, place in named}


def _content(symbol: Symbol, place: ForcedPlace) -> bytes:
    """The bytes of the variable, of which a bit may be forced alone."""
    byte = (symbol.bit or 0) // 8
    return (bytes(byte) + place.value).ljust(symbol.size, b"\0")[: symbol.size]


def _variable_at(place: ForcedPlace, known: list[Symbol]) -> Symbol | None:
    area, before = place.way
    candidates = [symbol for symbol in known if symbol.area == area]
    for offset in before:
        found = [_part(symbol, offset, 8) for symbol in candidates]
        candidates = [_target(pointer, pointer.type) for pointer in found if pointer is not None]
    every = [part for symbol in candidates for part in _parts_at(symbol, place)]
    return next(iter(every), None)


def _target(pointer: Symbol, t: Type) -> Symbol:
    """What a pointer leads to; of what is none the thing itself."""
    followed = pointer.followed()
    if followed is pointer and isinstance(t, PointerType):
        return pointer.target(f"{pointer.name}^", t.target)
    return followed


def name_at(area: int, offset: int, size: int, variables: Iterable[Symbol]) -> str:
    """The name of the variable, or of the part of it, that has `size` bytes from an offset on; else of the variable
    around them, or the address."""
    known = [s for s in variables if s.area == area and s.pointer is None and s.offset <= offset < s.offset + s.size]
    parts = (_part(symbol, offset, size) for symbol in known)
    found = next((part for part in parts if part is not None), known[0] if known else None)
    return found.name if found is not None else f"{Area(area).name.lower()}+{offset}"


def _parts_at(symbol: Symbol, place: ForcedPlace) -> Iterator[Symbol]:
    """The variable, or the part of it, that is forced."""
    if not place.is_bits:
        found = _part(symbol, place.begin, place.size)
        if found is not None and found.bit is None:
            yield found
        return
    bit = place.mask.bit_length() - 1
    found = _part(symbol, place.begin, 1)
    if found is None:
        return
    index = 8 * (place.begin - found.offset) + bit
    base = base_of(found.type)
    if found.bit is not None:
        if found.bit == index:
            yield found
    elif isinstance(base, Elementary) and base.kind in (Kind.BIT, Kind.INT) and index < base.bits:
        yield replace(found, name=f"{found.name}.{index}", bit=index)


def _part(symbol: Symbol, at: int, size: int) -> Symbol | None:
    """The scalar of a variable that has the `size` bytes from offset `at` on, and no more unless they are a byte."""
    while symbol.offset <= at and at + size <= symbol.offset + symbol.size:
        t = symbol.type
        if not isinstance(t, ArrayType | StructType):
            return symbol if symbol.size == size or size == 1 else None
        inner = next((p for p in symbol.parts() if p.offset <= at < p.offset + p.size), None)
        if inner is None:
            return None
        symbol = inner
    return None


def _address(place: ForcedPlace) -> Symbol:
    """What has no name in the program."""
    bit = place.mask.bit_length() - 1 if place.is_bits else None
    letter = _LETTERS.get(place.area)
    t = ELEMENTARY[{1: "BYTE", 2: "WORD", 4: "DWORD", 8: "LWORD"}[place.size]]
    if letter and not place.hops and place.offset % place.size == 0:
        end = f"X{place.offset}.{bit}" if bit is not None else f"{_WIDTHS[place.size]}{place.offset // place.size}"
        return Symbol(f"%{letter}{end}", place.area, place.offset, t, bit)
    way = "^+".join(map(str, (place.offset, *place.hops)))
    name = f"{Area(place.area).name.lower()}+{way}" + ("" if bit is None else f".{bit}")
    return Symbol(name, place.area, place.begin, t, bit)


# ---- what cannot be forced ----


def forcible(symbol: Symbol) -> Symbol:
    """Raises UsageError for what is more than a number."""
    if isinstance(symbol.type, StringType):
        raise UsageError(f"{symbol.name} is a string, which cannot be forced; write it.", "not-forcible")
    if isinstance(symbol.type, StructType | ArrayType):
        part = next(symbol.leaves(), symbol).name
        raise UsageError(
            f"{symbol.name} is {with_article(symbol.type)}; force its parts by their names, such as {part}.",
            "not-forcible",
        )
    return symbol


def not_forced(error: DeviceError, symbols: Sequence[Symbol], read_forces: Callable[[], ForceList]) -> DeviceError:
    """Returns the refusal to force these variables with their names and what to do."""
    if error.result == lib.MONITORING_ERR_FORCE_FAILED:
        listed = read_forces()
        message = f"This controller forces {listed.room} variables at most, and {len(listed.places)} are forced"
        advice = "end some with 'plctool unforce'"
        return DeviceError(f"{message}; {len(symbols)} more have no room: {advice}.", "force-full", error.result)
    if error.result == lib.MONITORING_ERR_NESTING_DEPTH:
        deep = max(symbols, key=lambda s: len(s.place[2]))
        message = f"{deep.name} is at the end of more than {lib.PLACE_POINTERS} pointers"
        return DeviceError(f"{message}; force it by the name that it was declared with.", "pointers", error.result)
    return error
