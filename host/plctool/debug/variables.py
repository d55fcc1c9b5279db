"""Variables by name: the parts of a variable, what a path such as 'Main.fb.arr[3].x' or 'Main.next^.value' leads to.

A path is looked up without a device: the value of a pointer is looked at each time the variable is read.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import field, replace
from functools import cached_property
from typing import Any

from plctool.errors import DeviceError, UsageError, with_article
from plctool.iec.areas import Area
from plctool.iec.types import (
    ELEMENTARY,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    InterfaceType,
    Kind,
    OpenArrayType,
    PointerType,
    ReferenceType,
    StringType,
    StructType,
    Type,
    base_of,
)
from plctool.iec.value_texts import literal, parse_value
from plctool.iec.values import decode, encode
from plctool.records import dataclass

_TOKEN = re.compile(r"\.?([A-Za-z_]\w*)|\[([^\]]*)\]|\.(\d+)|(\^)")


class ClassType(EnumType):
    """The class of the instance that an interface variable refers to: its number in memory, its name for users."""


@dataclass(frozen=True)
class Change:
    """`data` goes to where a variable is, `offset` bytes on. Of a single byte only the bits in `mask`: the others are
    other variables, and not ours to write."""

    offset: int
    data: bytes
    mask: int = 0xFF


@dataclass(frozen=True)
class Symbol:
    """A variable or a part of one. `offset` in bytes in the area or, when `pointer` leads to it, from there on; `bit`
    when it is one bit of an integer; `fixed` is the content of a constant that is not in memory."""

    name: str
    area: int
    offset: int
    type: Type
    bit: int | None = None
    pointer: Symbol | None = None
    constant: bool = False
    fixed: bytes | None = None

    @property
    def size(self) -> int:
        return self.type.size

    @property
    def place(self) -> tuple[int, int, tuple[int, ...]]:
        """Area and offset of where the way begins, and the offset after each pointer on it."""
        if self.pointer is None:
            return self.area, self.offset, ()
        area, offset, hops = self.pointer.place
        return area, offset, (*hops, self.offset)

    def decode(self, data: bytes) -> Any:
        """The value in `size` bytes read from the device."""
        if self.bit is not None:
            return bool(int.from_bytes(data[: self.size], "little") >> self.bit & 1)
        return decode(self.type, data)

    def change(self, value: Any) -> Change:
        """What to write for a value. Raises UsageError."""
        if self.bit is None:
            return Change(0, encode(self.type, value))
        byte, bit = divmod(self.bit, 8)
        return Change(byte, bytes([encode(ELEMENTARY["BOOL"], value)[0] << bit]), 1 << bit)

    def parse(self, text: str) -> Any:
        """The value a person typed for it, for `encode`. Raises UsageError."""
        return parse_value(self._shown_type, text)

    def literal(self, value: Any) -> str:
        """A decoded value as ST writes it; None is that of a variable to which a pointer does not lead."""
        return "NULL" if value is None else literal(self._shown_type, value)

    @property
    def _shown_type(self) -> Type:
        return self.type if self.bit is None else ELEMENTARY["BOOL"]

    def check_writable(self, area: int) -> None:
        """Raises UsageError if it is constant (its area is CODE) or read-only."""
        if isinstance(self.type, ClassType):
            raise UsageError(f"{self.name} is an interface variable: only the program can assign it.", "interface")
        if self.constant or area == Area.CODE.value:
            raise UsageError(f"{self.name} is a constant or a READ_ONLY access and cannot be written.", "constant")

    # ---- parts ----

    def part(self, name: str, offset: int, t: Type) -> Symbol:
        """A part that begins `offset` bytes on."""
        fixed = None if self.fixed is None else self.fixed[offset : offset + t.size]
        return replace(self, name=name, offset=self.offset + offset, type=t, fixed=fixed)

    def member(self, f: Field) -> Symbol:
        """A member of a struct or an instance; a BIT is a bit of its byte."""
        part = self.part(f"{self.name}.{f.name}", f.offset, f.type)
        return part if f.bit is None else replace(part, type=ELEMENTARY["BYTE"], bit=f.bit)

    def target(self, name: str, t: Type) -> Symbol:
        """What this pointer leads to."""
        return Symbol(name, self.area, 0, t, None, self)

    def followed(self) -> Symbol:
        """The variable itself or, as in ST, what a REFERENCE TO refers to."""
        return self.target(self.name, self.type.target) if isinstance(self.type, ReferenceType) else self

    def parts(self) -> Iterator[Symbol]:
        """Members or elements, none of a scalar."""
        t = self.type
        if isinstance(t, StructType):
            for f in t.fields:
                yield self.member(f)
        elif isinstance(t, ArrayType):
            for i, index in enumerate(_indices(t)):
                yield self.part(f"{self.name}[{index}]", i * t.element.size, t.element)

    def leaves(self) -> Iterator[Symbol]:
        """The scalars and strings that it consists of; the variable itself when it is one. No pointer is followed."""
        if not isinstance(self.type, StructType | ArrayType):
            yield self
        for part in self.parts():
            yield from part.leaves()


@dataclass(frozen=True)
class Units:
    """What is known of the units of a program. `classes`: the number of each class that an interface variable may refer
    to. `temporaries`: of each unit, the variables that live only while it runs; `unkept`: of each function block, those
    that could be in its instance, but are in registers; names in lower case."""

    classes: dict[str, int] = field(default_factory=dict)
    temporaries: dict[str, set[str]] = field(default_factory=dict)
    unkept: dict[str, set[str]] = field(default_factory=dict)

    def no_variable(self, path: str, unit: str, known: Iterable[str]) -> UsageError:
        """The error about a path that leads to nothing in `unit`; `known` are those that would."""
        if not path:
            return UsageError("A name is empty; write for example Main.speed.", "unknown-variable")
        if "*" in path or "?" in path:
            return UsageError(f"{path} stands for several variables; name one, 'plctool symbols' lists them.", "usage")
        last = path.rpartition(".")[2].casefold()
        if last in self.temporaries.get(unit.casefold(), ()):
            return UsageError(f"{path} lives only while {unit} runs: there is nothing to read or write.", "temporary")
        if last in self.unkept.get(unit.casefold(), ()):
            return UsageError(
                f"{path} is in a register, only while {unit} runs, because the program was built with -O3 or -Os; "
                "build it with -O2 to watch all variables.",
                "temporary",
            )
        lower = {k.casefold(): k for k in known}
        close = difflib.get_close_matches(path.casefold(), lower, n=1, cutoff=0.6)
        hint = f" Did you mean {lower[close[0]]}?" if close else ""
        return UsageError(f"There is no variable {path}.{hint}", "unknown-variable")


def constant_symbol(name: str, t: Type, content: bytes) -> Symbol:
    """A constant that the compiler has put into the code wherever it is used."""
    return Symbol(name, Area.CODE.value, 0, t, constant=True, fixed=content)


def walk(symbol: Symbol, text: str, at: int, units: Units) -> Symbol:
    """What the path `text` leads to; `symbol` is what it names up to `at`. Raises UsageError."""
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise UsageError(f"'{text}' cannot be read from '{text[at:]}' on; write for example Main.a[3].x.", "syntax")
        if symbol.bit is not None:
            raise UsageError(f"{symbol.name} is a BOOL and has no parts.", "no-part")
        symbol = symbol.followed()
        dotted = _dotted_member(symbol.type, text, at)
        at = at + len(dotted) if dotted else match.end()
        symbol = _member(symbol, dotted[1:], text[:at], units) if dotted else _step(symbol, match, text[:at], units)
    symbol = shown(symbol, units)
    if isinstance(symbol.type, OpenArrayType):
        raise _open_array(symbol)
    return symbol


def shown(symbol: Symbol, units: Units) -> Symbol:
    """What has the value that is shown for a variable, however it was found: as in ST, what a REFERENCE TO or
    VAR_IN_OUT refers to; of an interface variable the class of its instance."""
    symbol = symbol.followed()
    if isinstance(symbol.type, InterfaceType) and units.classes:
        return symbol.target(symbol.name, ClassType(symbol.type.name, ELEMENTARY["UDINT"], units.classes))
    return symbol


def _step(symbol: Symbol, match: re.Match[str], name: str, units: Units) -> Symbol:
    """A part by `name`, as typed; the part has the name as declared."""
    member, indices, bit, dereference = match.groups()
    if member:
        return _member(symbol, member, name, units)
    if bit:
        return _bit(symbol, int(bit))
    if dereference:
        return _target(symbol)
    return _element(symbol, indices)


def _dotted_member(t: object, text: str, at: int) -> str:
    """`.Base.name` if a path goes on with a member that has a dot in its name, as what methods and bases keep for
    themselves has; else ""."""
    if not isinstance(t, StructType):
        return ""
    rest = f"{text[at:].casefold()}."
    ways = (f".{field.name}" for field in t.fields if "." in field.name)
    return max((way for way in ways if re.match(re.escape(way.casefold()) + r"[.\[^]", rest)), key=len, default="")


def _member(symbol: Symbol, member: str, name: str, units: Units) -> Symbol:
    t = symbol.type
    if isinstance(t, InterfaceType):
        raise UsageError(f"{symbol.name} is an interface variable; its value is the class of its instance.", "no-part")
    if isinstance(t, PointerType):
        raise UsageError(f"{symbol.name} is a pointer; write {symbol.name}^.{member} for what it leads to.", "pointer")
    if not isinstance(t, StructType):
        raise UsageError(f"{symbol.name} is {with_article(t)} and has no member {member}.", "no-part")
    found = t.member(member)
    if found is None and member.casefold() in map(str.casefold, t.properties):
        raise UsageError(f"{name} is a property: only the program can read it, by a call.", "property")
    if found is None:
        raise units.no_variable(name, t.name, [f"{symbol.name}.{f.name}" for f in t.fields])
    return symbol.member(found)


def _target(symbol: Symbol) -> Symbol:
    t = symbol.type
    if not isinstance(t, PointerType) or isinstance(t, InterfaceType):
        raise UsageError(f"{symbol.name} is {with_article(t)}, not a pointer; leave out the ^.", "no-part")
    return symbol.target(f"{symbol.name}^", t.target)


def _bit(symbol: Symbol, bit: int) -> Symbol:
    base = base_of(symbol.type)
    if not isinstance(base, Elementary) or base.kind not in (Kind.BIT, Kind.INT) or bit >= base.bits:
        raise UsageError(f"{symbol.name} is {with_article(symbol.type)} and has no bit {bit}.", "no-part")
    return replace(symbol, name=f"{symbol.name}.{bit}", bit=bit)


def _element(symbol: Symbol, text: str) -> Symbol:
    t = symbol.type
    try:
        indices = [int(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"'{text}' is not an index; write a number as in {symbol.name}[1].", "syntax") from None
    name = f"{symbol.name}[{','.join(map(str, indices))}]"
    if isinstance(t, StringType) and len(indices) == 1:
        if not 0 <= indices[0] <= t.length:
            raise UsageError(f"{symbol.name} has the characters 0 to {t.length - 1}, not {indices[0]}.", "no-part")
        return symbol.part(name, indices[0] * t.unit, ELEMENTARY["WORD" if t.wide else "BYTE"])
    if isinstance(t, PointerType) and not isinstance(t, InterfaceType):
        raise UsageError(f"{symbol.name} is a pointer; write {symbol.name}^[{text}] for what it leads to.", "pointer")
    if isinstance(t, OpenArrayType):
        raise _open_array(symbol)
    if not isinstance(t, ArrayType) or len(indices) != len(t.bounds):
        raise UsageError(f"{symbol.name} is {with_article(t)} and cannot be indexed with [{text}].", "no-part")
    flat = 0
    for index, (low, high) in zip(indices, t.bounds, strict=True):
        if not low <= index <= high:
            raise UsageError(f"{symbol.name} has the elements {low} to {high}, not {index}.", "no-part")
        flat = flat * (high - low + 1) + index - low
    return symbol.part(name, flat * t.element.size, t.element)


def _open_array(symbol: Symbol) -> UsageError:
    return UsageError(
        f"{symbol.name} is an {symbol.type}, whose bounds change with each call; name the array itself.", "open-array"
    )


def _indices(t: ArrayType) -> list[str]:
    texts = [""]
    for low, high in t.bounds:
        texts = [f"{text},{i}" if text else str(i) for text in texts for i in range(low, high + 1)]
    return texts


@dataclass(frozen=True)
class Reading:
    """Variables that were read together, and what they held, by the names they were asked for. `consistent`: no task
    ran meanwhile, so this is a state between two cycles. `forced`: the names of those of which a part is forced."""

    symbols: dict[str, Symbol]
    contents: dict[str, bytes | None]
    consistent: bool = True
    forced: list[str] = field(default_factory=list)

    @cached_property
    def values(self) -> dict[str, Any]:
        """None if a pointer on the way leads to no variable."""
        return {name: None if data is None else self.symbols[name].decode(data) for name, data in self.contents.items()}

    @cached_property
    def texts(self) -> dict[str, str]:
        """The values as ST writes them."""
        return {name: self.symbols[name].literal(value) for name, value in self.values.items()}

    @property
    def marked_texts(self) -> dict[str, str]:
        """The same, with a mark at what is forced."""
        return {name: f"{text} (forced)" if name in self.forced else text for name, text in self.texts.items()}

    def check(self, names: Iterable[str], read: Callable[[Symbol], bytes | None]) -> None:
        """Raises DeviceError when a pointer to one of these does not lead to a variable. An interface variable may be
        NULL."""
        for name in names:
            if self.contents[name] is None:
                error = unreachable(self.symbols[name], read)
                if error.code != "null" or not isinstance(self.symbols[name].type, ClassType):
                    raise error


def unreachable(symbol: Symbol, read: Callable[[Symbol], bytes | None]) -> DeviceError:
    """Says why `symbol` cannot be reached: which pointer on the way leads to no variable. `read` gives what a pointer
    holds."""
    pointer = symbol.pointer
    while pointer is not None:
        held = read(pointer)
        if held is not None:
            return _leads_nowhere(symbol, pointer, is_null=not any(held))
        pointer = pointer.pointer
    return DeviceError(f"{symbol.name} is not in the memory of the program.", "no-target")


def _leads_nowhere(symbol: Symbol, pointer: Symbol, is_null: bool) -> DeviceError:
    if is_null:
        return DeviceError(f"{symbol.name} cannot be reached: {pointer.name} is NULL.", "null")
    return DeviceError(
        f"{symbol.name} cannot be reached: {pointer.name} leads to no variable that lasts; it may refer to a temporary "
        "variable, or to none at all.",
        "no-target",
    )
