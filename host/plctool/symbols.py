"""The symbol file (app.sym): where the variables of an image are, what their types look like, which code is which line.

It is JSON, written by `build`, and found again for what runs on a device by the image's CRC.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import zlib
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from plctool.compiler.types import (
    ELEMENTARY,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    InterfaceType,
    Kind,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
)
from plctool.errors import UsageError
from plctool.files import write_atomically
from plctool.values import decode, encode, parse_value

FORMAT = 1
_TOKEN = re.compile(r"\.?([A-Za-z_]\w*)|\[([^\]]*)\]|\.(\d+)|(\^)")


@dataclass(frozen=True)
class Symbol:
    """A variable or a part of one. `offset` in bytes in the area; `bit` when it is one bit of an integer."""

    name: str
    area: int
    offset: int
    type: Type
    bit: int | None = None

    @property
    def size(self) -> int:
        return self.type.size

    def decode(self, data: bytes) -> Any:
        """The value in `size` bytes read from the device."""
        if self.bit is not None:
            return bool(int.from_bytes(data[: self.size], "little") >> self.bit & 1)
        return decode(self.type, data)

    def encode(self, value: Any, before: bytes | None = None) -> bytes:
        """The bytes to write. `before`: the present ones, needed to change a single bit. Raises UsageError."""
        if self.bit is None:
            return encode(self.type, value)
        if before is None:
            raise UsageError(f"{self.name} is a bit; write the whole {self.type}.", "bit")
        word = int.from_bytes(before[: self.size], "little") & ~(1 << self.bit)
        bit = encode(ELEMENTARY["BOOL"], value)[0]
        return (word | bit << self.bit).to_bytes(self.size, "little")

    def parse(self, text: str) -> Any:
        """The value a person typed for it, for `encode`. Raises UsageError."""
        return parse_value(ELEMENTARY["BOOL"] if self.bit is not None else self.type, text)


@dataclass(frozen=True)
class CodeUnit:
    """A POU: `offset` and `size` of its code (size 0 when it is only part of its callers), where its source begins."""

    name: str
    offset: int
    size: int
    file: str
    line: int


@dataclass(frozen=True)
class SourceLine:
    """What a code address belongs to."""

    pou: str
    file: str
    line: int


@dataclass
class SymbolTable:
    """Everything in a symbol file. `lines`: (code offset, index into `files` or -1, line), sorted; an entry holds up to
    the next one."""

    image_crc: int
    target: str
    project: str
    tasks: list[str]
    variables: dict[str, Symbol]
    pous: list[CodeUnit] = field(default_factory=list)
    lines: list[tuple[int, int, int]] = field(default_factory=list)
    files: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._by_key = {name.casefold(): symbol for name, symbol in self.variables.items()}

    # ---- variables ----

    def resolve(self, path: str) -> Symbol:
        """The variable, member, element or bit `path` names, e.g. 'Main.fb.arr[3].x' or 'Main.word.5'. Upper and lower
        case are the same. Raises UsageError with a suggestion."""
        text = path.strip()
        at = len(text)
        while at > 0:
            symbol = self._by_key.get(text[:at].casefold())
            if symbol is not None:
                return self._walk(symbol, text, at)
            at = max(text.rfind(".", 0, at), text.rfind("[", 0, at), text.rfind("^", 0, at))
        raise self._unknown(text)

    def _unknown(self, text: str) -> UsageError:
        prefix = text.casefold() + "."
        inside = [name for name in self.variables if name.casefold().startswith(prefix)]
        if inside:
            return UsageError(
                f"{text} has no value of its own; name one of its variables, such as {inside[0]}.", "no-value"
            )
        return _no_such("variable", text, list(self.variables))

    def _walk(self, symbol: Symbol, text: str, at: int) -> Symbol:
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                raise UsageError(
                    f"'{text}' cannot be read from '{text[at:]}' on; write for example Main.a[3].x.", "syntax"
                )
            member, indices, bit, deref = match.groups()
            at = match.end()
            name = text[:at]
            if symbol.bit is not None:
                raise UsageError(f"{symbol.name} is a BOOL and has no parts.", "no-part")
            if deref:
                raise UsageError(f"{symbol.name} is a reference; what it points to is not known here.", "reference")
            if member:
                symbol = _member(symbol, member, name)
            elif bit:
                symbol = _bit(symbol, int(bit), name)
            else:
                symbol = _element(symbol, indices, name)
        return symbol

    def leaves(self, symbol: Symbol) -> list[Symbol]:
        """The scalars and strings that a structured variable consists of; the variable itself when it is one."""
        t = symbol.type
        if isinstance(t, StructType):
            parts = [Symbol(f"{symbol.name}.{f.name}", symbol.area, symbol.offset + f.offset, f.type) for f in t.fields]
        elif isinstance(t, ArrayType):
            parts = [
                Symbol(f"{symbol.name}[{index}]", symbol.area, symbol.offset + i * t.element.size, t.element)
                for i, index in enumerate(_indices(t))
            ]
        else:
            return [symbol]
        return [leaf for part in parts for leaf in self.leaves(part)]

    # ---- code ----

    def address_to_line(self, code_offset: int) -> SourceLine | None:
        """The source line of a code offset; None when it is not the program's own code."""
        unit = next((u for u in self.pous if u.offset <= code_offset < u.offset + u.size), None)
        i = bisect_right(self.lines, (code_offset, 1 << 30, 0)) - 1
        first = unit.offset if unit else code_offset
        while i >= 0 and self.lines[i][2] == 0 and self.lines[i][0] > first:
            i -= 1  # code without a line of its own belongs to what comes before it
        if i < 0 or self.lines[i][1] < 0:
            return SourceLine(unit.name, unit.file, unit.line) if unit else None
        _, file_index, line = self.lines[i]
        return SourceLine(self._pou_at(self.files[file_index], line, unit), self.files[file_index], line)

    def _pou_at(self, file: str, line: int, unit: CodeUnit | None) -> str:
        """The POU whose source holds the line, which is not the one with the code when it was inlined."""
        candidates = [u for u in self.pous if u.file == file and u.line <= line]
        start = max((u.line for u in candidates), default=0)
        names = [u.name for u in candidates if u.line == start]
        if unit is not None and unit.name in names:
            return unit.name
        return names[0] if names else unit.name if unit else ""

    # ---- file ----

    def to_json(self) -> str:
        types: dict[str, Any] = {}
        variables = {}
        for name, symbol in self.variables.items():
            _describe(symbol.type, types)
            variables[name] = {"area": symbol.area, "offset": symbol.offset, "type": symbol.type.name}
            if symbol.bit is not None:
                variables[name]["bit"] = symbol.bit
        document = {
            "format": FORMAT,
            "image_crc": self.image_crc,
            "target": self.target,
            "project": self.project,
            "tasks": self.tasks,
            "variables": variables,
            "types": types,
            "pous": [vars(unit) for unit in self.pous],
            "lines": self.lines,
            "files": self.files,
        }
        return json.dumps(document, separators=(",", ":"))

    @staticmethod
    def from_json(text: str) -> SymbolTable:
        """Raises UsageError when it is not a symbol file."""
        try:
            document = json.loads(text)
            if document["format"] != FORMAT:
                raise UsageError(
                    f"The symbol file has format {document['format']}, this plctool knows {FORMAT}; build again.",
                    "bad-symbols",
                )
            types = _Types(document["types"])
            return SymbolTable(
                document["image_crc"],
                document["target"],
                document["project"],
                document["tasks"],
                {
                    n: Symbol(n, v["area"], v["offset"], types.get(v["type"]), v.get("bit"))
                    for n, v in document["variables"].items()
                },
                [CodeUnit(**unit) for unit in document["pous"]],
                [(offset, file, line) for offset, file, line in document["lines"]],
                document["files"],
            )
        except (ValueError, KeyError, TypeError, AttributeError):
            raise UsageError("The symbol file cannot be read; build again.", "bad-symbols") from None

    def save(self, path: Path) -> None:
        """Writes the file, and a copy into the cache from where `find_symbols` gets it."""
        text = self.to_json()
        write_atomically(path, text.encode())
        copy = cache_path(self.image_crc)
        try:
            copy.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(copy, text.encode())
        except (OSError, UsageError):
            return  # the cache only saves naming the file


def load_symbols(path: Path) -> SymbolTable:
    """Raises UsageError when the file is missing or not a symbol file."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"The symbol file {path} cannot be read: {error}.", "no-symbols") from None
    return SymbolTable.from_json(text)


def symbol_path(image: Path) -> Path:
    """Where `build` writes the symbols of an image: app.cdl -> app.sym."""
    return image.with_suffix(".sym")


def cache_path(image_crc: int) -> Path:
    """Where the symbols of an image are kept for later: $XDG_CACHE_HOME/plctool/<crc>.sym."""
    root = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(root) / "plctool" / f"{image_crc:08x}.sym"


def find_symbols(image_crc: int, beside: Path | None = None) -> SymbolTable:
    """The symbols of the image with this CRC: beside `beside` (an image or symbol file), else from the cache.

    Raises UsageError when there are none, or only those of another image.
    """
    other = False
    for path in ([symbol_path(beside)] if beside else []) + [cache_path(image_crc)]:
        if path.exists():
            table = load_symbols(path)
            if table.image_crc == image_crc:
                return table
            other = True
    if other:
        raise UsageError(
            f"The symbol file beside {beside} belongs to another image than the one that runs (CRC {image_crc:08X}); "
            "flash the image again or name its own symbol file.",
            "wrong-symbols",
        )
    raise UsageError(
        f"There are no symbols for the image that runs (CRC {image_crc:08X}); name its .sym file.",
        "no-symbols",
    )


# ---- parts of variables --------------------------------------------------------------------------------------------


def _no_such(what: str, name: str, known: list[str]) -> UsageError:
    lower = {k.casefold(): k for k in known}
    close = difflib.get_close_matches(name.casefold(), lower, n=1, cutoff=0.6)
    hint = f" Did you mean {lower[close[0]]}?" if close else ""
    return UsageError(f"There is no {what} {name}.{hint}", "unknown-variable")


def _member(symbol: Symbol, member: str, name: str) -> Symbol:
    t = symbol.type
    if not isinstance(t, StructType):
        raise UsageError(f"{symbol.name} is a {t} and has no member {member}.", "no-part")
    found = t.member(member)
    if found is None and member.casefold() in map(str.casefold, t.properties):
        raise UsageError(f"{name} is a property: only the program can read it, by a call.", "property")
    if found is None:
        raise _no_such("variable", name, [f"{symbol.name}.{f.name}" for f in t.fields])
    return Symbol(name, symbol.area, symbol.offset + found.offset, found.type)


def _bit(symbol: Symbol, bit: int, name: str) -> Symbol:
    base = base_of(symbol.type)
    if not isinstance(base, Elementary) or base.kind not in (Kind.BIT, Kind.INT) or bit >= base.bits:
        raise UsageError(f"{symbol.name} is a {symbol.type} and has no bit {bit}.", "no-part")
    return Symbol(name, symbol.area, symbol.offset, symbol.type, bit)


def _element(symbol: Symbol, text: str, name: str) -> Symbol:
    t = symbol.type
    try:
        indices = [int(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"'{text}' is not an index; write a number as in {symbol.name}[1].", "syntax") from None
    if isinstance(t, StringType) and len(indices) == 1:
        if not 0 <= indices[0] <= t.length:
            raise UsageError(f"{symbol.name} has the characters 0 to {t.length - 1}, not {indices[0]}.", "no-part")
        return Symbol(name, symbol.area, symbol.offset + indices[0] * t.unit, ELEMENTARY["WORD" if t.wide else "BYTE"])
    if not isinstance(t, ArrayType) or len(indices) != len(t.bounds):
        raise UsageError(f"{symbol.name} is a {t} and cannot be indexed with [{text}].", "no-part")
    flat = 0
    for index, (low, high) in zip(indices, t.bounds, strict=True):
        if not low <= index <= high:
            raise UsageError(f"{symbol.name} has the elements {low} to {high}, not {index}.", "no-part")
        flat = flat * (high - low + 1) + index - low
    return Symbol(name, symbol.area, symbol.offset + flat * t.element.size, t.element)


def _indices(t: ArrayType) -> list[str]:
    texts = [""]
    for low, high in t.bounds:
        texts = [f"{text},{i}" if text else str(i) for text in texts for i in range(low, high + 1)]
    return texts


# ---- types in JSON -------------------------------------------------------------------------------------------------


def _describe(t: Type, types: dict[str, Any]) -> None:
    """Adds a type and those it consists of to `types`, by name."""
    if isinstance(t, Elementary) or t.name in types:
        return
    entry: dict[str, Any] = {}
    types[t.name] = entry
    if isinstance(t, StringType):
        entry.update(kind="string", length=t.length, wide=t.wide)
    elif isinstance(t, EnumType):
        entry.update(kind="enum", base=t.base.name, values=t.values)
    elif isinstance(t, SubrangeType):
        entry.update(kind="subrange", base=t.base.name, low=t.low, high=t.high)
    elif isinstance(t, ArrayType):
        entry.update(kind="array", element=t.element.name, bounds=[list(b) for b in t.bounds])
        _describe(t.element, types)
    elif isinstance(t, InterfaceType):
        entry.update(kind="pointer", target="BYTE")  # what it leads to is known to the program only
    elif isinstance(t, PointerType):
        entry.update(kind="pointer", target=t.target.name)
        _describe(t.target, types)
    else:
        assert isinstance(t, StructType)
        entry.update(kind="struct", fields=[[f.name, f.type.name] for f in t.fields], union=t.union)
        if t.properties:
            entry["properties"] = t.properties
        for f in t.fields:
            _describe(f.type, types)


def layout_signature(symbols: Iterable[Symbol]) -> int:
    """A number that changes when a name, a place or a type among `symbols` does."""
    types: dict[str, Any] = {}
    places = []
    for symbol in symbols:
        _describe(symbol.type, types)
        places.append([symbol.name.casefold(), symbol.offset, symbol.type.name])
    for entry in types.values():
        entry.pop("properties", None)  # they are not in memory
    return zlib.crc32(json.dumps([sorted(places), types], sort_keys=True).encode())


class _Types:
    """Types by name, made from their description when they are first asked for."""

    def __init__(self, described: dict[str, Any]) -> None:
        self._described = described
        self._made: dict[str, Type] = dict(ELEMENTARY)

    def get(self, name: str) -> Type:
        made = self._made.get(name)
        if made is None:
            made = self._make(name, self._described[name])
            self._made[name] = made
        return made

    def _make(self, name: str, entry: dict[str, Any]) -> Type:
        kind = entry["kind"]
        if kind == "string":
            return StringType(entry["length"], entry["wide"])
        if kind == "enum":
            return EnumType(name, ELEMENTARY[entry["base"]], entry["values"])
        if kind == "subrange":
            return SubrangeType(name, ELEMENTARY[entry["base"]], entry["low"], entry["high"])
        if kind == "array":
            return ArrayType(self.get(entry["element"]), tuple((low, high) for low, high in entry["bounds"]))
        if kind == "pointer":
            return self._pointer(entry)
        struct = StructType(name, union=entry["union"], properties=entry.get("properties", []))
        self._made[name] = struct  # references may lead back to it
        struct.fields = [Field(n, self.get(t)) for n, t in entry["fields"]]
        struct.lay_out()
        return struct

    def _pointer(self, entry: dict[str, Any]) -> Type:
        return PointerType(self.get(entry["target"]))
