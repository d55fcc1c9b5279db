"""The symbol file (app.sym): where the variables of an image are, what their types look like, which code is which line.

It is JSON, written by `build`, and found again for what runs on a device by the image's CRC.
"""

from __future__ import annotations

import base64
import json
import re
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.archives import MAX_BYTES, ArchiveError, inflate_all
from plctool.debug.bounds import BoundsCheck, Read, what_was_outside
from plctool.debug.passed_lines import TRAIL, PassedLine, passed_lines
from plctool.debug.trace import Trace
from plctool.debug.variables import Symbol, Units, constant_symbol, shown, walk
from plctool.errors import UsageError
from plctool.files import MAX_BINARY, cache_folder, read_regular, write_atomically
from plctool.iec.addresses import parse_address
from plctool.iec.type_descriptions import DescribedTypes, describe
from plctool.iec.types import ELEMENTARY, ArrayType, OpenArrayType, StructType, Type
from plctool.image.limits import Need
from plctool.project import SYMBOL_SUFFIX
from plctool.records import dataclass

if TYPE_CHECKING:
    from plctool.debug.call_frames import DebugInfo, Scope

FORMAT = 3


@dataclass(frozen=True)
class CodeUnit:
    """A POU: `offset` and `size` of its code (size 0 when it is only part of its callers), where its source begins, its
    variables that live only while it runs."""

    name: str
    offset: int
    size: int
    file: str
    line: int
    temporaries: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class SourceLine:
    """What a code address belongs to."""

    pou: str
    file: str
    line: int


@dataclass(frozen=True)
class KeptName:
    """A RETAIN or PERSISTENT variable, or a part of one; `[]` stands for the elements of an array. `type`: as far as a
    kept value depends on it; `size` of one element [bytes]."""

    name: str
    type: str
    persistent: bool
    size: int


@dataclass
class SymbolTable:
    """Everything in a symbol file. `lines`: (code offset, index into `files` or -1, line), sorted; an entry goes up to
    the next one. `aliases`: other names of variables. `classes`: the numbers by which instances show their class.
    `constants`: those that are not in memory. `debug`: see `DebugInfo`. `kept`: what a power cut does not
    lose. `io`: devices and channels of inputs and outputs (`compiler/image/io_configuration.py`), empty for none.
    `bounds`: what the code checks. `unkept`: variables of function blocks, by the name of the block, that live in
    registers. `stack`: what the deepest calls of a task need; None in a file of a version that did not say.
    `made_of`: the fingerprint of sources and options (`cli/fresh_image.py`), empty if `build` did not write the file.
    `internal`: the variables of blocks of the standard library that are neither inputs nor outputs, by the name of the
    block.
    `passed_lines`: those that the trail of an exception names by their numbers. `frames`: the types of what a debugger
    finds on the stack (`frames.py`), by POU and name. `online`: what another program has to have alike that shall take
    its place while it runs (`compiler/image/online_change.py`)."""

    image_crc: int
    target: str
    project: str
    tasks: list[str]
    variables: dict[str, Symbol]
    pous: list[CodeUnit] = field(default_factory=list)
    lines: list[tuple[int, int, int]] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    aliases: dict[str, str] = field(default_factory=dict)
    classes: dict[str, int] = field(default_factory=dict)
    constants: dict[str, Symbol] = field(default_factory=dict)
    debug: list[bytes] = field(default_factory=list)
    kept: list[KeptName] = field(default_factory=list)
    io: dict[str, Any] = field(default_factory=dict)
    bounds: list[BoundsCheck] = field(default_factory=list)
    unkept: dict[str, list[str]] = field(default_factory=dict)
    stack: Need | None = None
    made_of: str = ""
    internal: dict[str, list[str]] = field(default_factory=dict)
    passed_lines: list[PassedLine] = field(default_factory=list)
    frames: dict[str, dict[str, Type]] = field(default_factory=dict)
    online: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._all = self.variables | self.constants
        self._by_key = {name.casefold(): symbol for name, symbol in self._all.items()}
        known = {other: self._by_key.get(name.casefold()) for other, name in self.aliases.items()}
        self._by_key |= {other.casefold(): symbol for other, symbol in known.items() if symbol is not None}
        temporaries = {u.name.casefold(): {name.casefold() for name in u.temporaries} for u in self.pous}
        unkept = {block.casefold(): {name.casefold() for name in names} for block, names in self.unkept.items()}
        self._units = Units(self.classes, temporaries, unkept)

    # ---- variables ----

    def resolve(self, path: str) -> Symbol:
        """The variable, member, element or bit `path` names, e.g. 'Main.fb.arr[3].x' or 'Main.word.5', what is at an
        address such as %MW0, or at a channel such as gpio.DI0. Upper and lower case are the same. Raises UsageError
        with a suggestion."""
        text = path.strip()
        at = len(text)
        channel = self._channels.get(text.casefold()) if text.casefold() not in self._by_key else None
        if channel is not None:
            return self.resolve(channel)
        while at > 0:
            symbol = self._by_key.get(text[:at].casefold())
            if symbol is not None:
                return walk(symbol, text, at, self._units)
            at = max(text.rfind(".", 0, at), text.rfind("[", 0, at), text.rfind("^", 0, at))
        symbol = _at_address(text)
        if symbol is not None:
            return symbol
        raise self._unknown(text)

    @cached_property
    def _channels(self) -> dict[str, str]:
        """What channels of inputs and outputs lead to, by their names with that of the device, in small letters."""
        return {f"{c['device']}.{c['channel']}".casefold(): c["variable"] for c in self.io.get("channels", [])}

    def _unknown(self, text: str) -> UsageError:
        prefix = text.casefold() + "."
        inside = [name for name in self._all if name.casefold().startswith(prefix)]
        if inside:
            return UsageError(
                f"{text} has no value of its own; name one of its variables, such as {inside[0]}.", "no-value"
            )
        return self._units.no_variable(text, text.rpartition(".")[0], [*self._all, *self.aliases])

    def find(self, patterns: Sequence[str]) -> Iterator[Symbol]:
        """The variables and constants, and parts of them, whose name matches one of the patterns with * and ?; elements
        of arrays only where a pattern has an index. Without patterns all variables, as they were declared."""
        if not patterns:
            yield from (s for s in self._all.values() if "%" not in s.name)
            return
        wanted = re.compile("|".join(map(_pattern, patterns)), re.IGNORECASE)
        elements = any("[" in pattern for pattern in patterns)
        todo = list(self._all.values())[::-1]
        while todo:
            symbol = todo.pop()
            if "%" in symbol.name:  # our own
                continue
            if wanted.fullmatch(symbol.name):
                yield symbol
            if elements or not isinstance(symbol.type, ArrayType):
                todo += list(symbol.parts())[::-1]

    def _found(self, pattern: str) -> Iterator[Symbol]:
        """Finds what a pattern matches, without the internal variables of standard blocks, such as START of a TON,
        unless it spells the name of one."""
        spelled = not is_pattern(pattern.strip().rpartition(".")[2])
        return (symbol for symbol in self.find([pattern]) if spelled or not self._is_internal(symbol.name))

    def _is_internal(self, name: str) -> bool:
        """True for a variable of a standard block that is neither its input nor its output."""
        instance, _, member = name.rpartition(".")
        if not any(member in names for names in self.internal.values()):
            return False
        with suppress(UsageError):  # a program has no value of its own
            return member in self.internal.get(self.resolve(instance).type.name, ())
        return False

    def listed(self, patterns: Sequence[str]) -> list[Symbol]:
        """The same, with what names without * and ? stand for otherwise, such as channels. Raises UsageError for what
        matches nothing."""
        found = list(self.find(patterns))
        for pattern in patterns:
            if next(self.find([pattern]), None) is None:
                found += self._matching(pattern).values() if is_pattern(pattern) else [self.resolve(pattern)]
        return found

    def select(self, names: Sequence[str]) -> dict[str, Symbol]:
        """The variables of these names, as `resolve` finds them, and for a pattern with * or ? all values whose names
        match it: `Main.*` is all of Main, arrays as a whole. Raises UsageError for what is not in the program."""
        found: dict[str, Symbol] = {}
        for name in names:
            if is_pattern(name):
                found |= self._matching(name)
            else:
                found[name] = self.resolve(name)
        return found

    def scalars(self, names: Sequence[str]) -> dict[str, Symbol]:
        """The same by their own names, and of structures and arrays all values that they consist of."""
        wanted = self.select(names).values()
        leaves = (leaf for s in wanted for leaf in s.leaves() if "%" not in leaf.name.removeprefix(s.name))  # not ours
        found = {leaf.name: shown(leaf, self._units) for leaf in leaves}
        return {name: symbol for name, symbol in found.items() if not isinstance(symbol.type, OpenArrayType)}

    def _matching(self, pattern: str) -> dict[str, Symbol]:
        with_parts = (s for s in self._found(pattern) if not isinstance(s.type, StructType))
        every = (shown(symbol, self._units) for symbol in with_parts)
        found = {s.name: s for s in every if not isinstance(s.type, OpenArrayType)}
        if not found:
            raise UsageError(f"No variable matches {pattern}; 'plctool symbols' lists them.", "unknown-variable")
        return found

    # ---- code ----

    @property
    def debug_info(self) -> DebugInfo:
        """What the compiler says about the code."""
        return self._debug_info

    def address_to_line(self, code_offset: int) -> SourceLine | None:
        """The source line of a code offset; None when it is not the program's own code."""
        unit = self._unit_of(code_offset)
        i = self._row_of(code_offset, unit)
        if i < 0 or self.lines[i][1] < 0 or self.lines[i][2] == 0:
            return SourceLine(unit.name, unit.file, unit.line) if unit else None
        _, file_index, line = self.lines[i]
        return SourceLine(self._pou_at(self.files[file_index], line, unit), self.files[file_index], line)

    def _unit_of(self, code_offset: int) -> CodeUnit | None:
        return next((u for u in self.pous if u.offset <= code_offset < u.offset + u.size), None)

    def _row_of(self, code_offset: int, unit: CodeUnit | None) -> int:
        """The row of the line table. Code without a line of its own, such as what is loaded again at the beginning of
        a loop, belongs to what comes after it in the unit; at the end to what comes before."""
        i = bisect_right(self.lines, (code_offset, 1 << 30, 0)) - 1
        first, end = (unit.offset, unit.offset + unit.size) if unit else (code_offset, code_offset)
        if i < 0 or self.lines[i][1] < 0 or self.lines[i][2]:
            return i
        rows = range(i + 1, len(self.lines))
        after = next((n for n in rows if self.lines[n][2] or self.lines[n][1] < 0), i)
        if self.lines[after][2] and self.lines[after][0] < end:
            return after
        while i >= 0 and self.lines[i][2] == 0 and self.lines[i][0] > first:
            i -= 1
        return i

    def call_stack(self, code_offset: int | None, trace: Trace) -> list[SourceLine]:
        """Where the program was at a code offset (None: not in its own code), and the calls that led there, the
        innermost first."""
        places: list[SourceLine] = []
        offsets = [] if code_offset is None else [code_offset]
        for offset in offsets + self._debug_info.callers(code_offset, trace):
            scopes = self._debug_info.scopes(offset)
            place = self.address_to_line(offset)
            if place is not None and (not places or self._is_call(offset, scopes)):
                pou = scopes[0].pou if scopes else ""
                places.append(self._in_pou(pou, place.file, place.line) if pou else place)
            places += [self._in_pou(o.pou, i.call_file, i.call_line) for i, o in pairwise(scopes) if i.call_line]
        return places

    def whole_stack(self, code_offset: int | None, trace: Trace, read: Read) -> list[SourceLine]:
        """The same, beginning where an exception was raised that a `__TRY` let out. `read`: what is in memory."""
        places = self.call_stack(code_offset, trace)
        if TRAIL not in self.variables or not places:
            return places
        (content,) = read([self.variables[TRAIL]])
        if content is None:
            return places
        lines = passed_lines(self.passed_lines, self.variables[TRAIL].decode(content))
        passed = [self._in_pou(*line) for line in lines]
        if not passed or passed[-1] != places[0]:  # it was raised where the program stopped
            return places
        return [*passed[:-1], *places]

    def _is_call(self, code_offset: int, scopes: list[Scope]) -> bool:
        """Whether a call on the stack is one of the source, and not how the compiler calls the parts of a POU."""
        if scopes:
            return scopes[0].pou != ""
        return self.lines[self._row_of(code_offset, self._unit_of(code_offset))][2] > 0

    def what_was_outside(self, place: SourceLine, read: Read) -> str:
        """In words, the index or value that a program which stopped there with ARRAYBOUNDS has; "" if unknown."""
        checks = [check for check in self.bounds if (check.file, check.line) == (place.file, place.line)]
        return what_was_outside(checks, list(self.variables.values()), read)

    def _in_pou(self, pou: str, file: str, line: int) -> SourceLine:
        """A line of a POU. What initialises all variables has none of its own: then of the POU that declares them."""
        made = any(unit.name == pou and not unit.file for unit in self.pous)
        return SourceLine(self._pou_at(file, line, None) or pou if made else pou, file, line)

    @cached_property
    def _debug_info(self) -> DebugInfo:
        from plctool.debug.call_frames import DebugInfo

        return DebugInfo(self.debug)

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
        variables = {name: _variable(symbol, types) for name, symbol in self.variables.items()}
        for block, names in self.unkept.items():
            if block in types:
                types[block]["fields"] = [entry for entry in types[block]["fields"] if entry[0] not in names]
        frames = {pou: _frame(variables, types) for pou, variables in self.frames.items()}
        document = {
            "format": FORMAT,
            "image_crc": self.image_crc,
            "target": self.target,
            "project": self.project,
            "tasks": self.tasks,
            "variables": variables,
            "constants": {name: _constant(symbol, types) for name, symbol in self.constants.items()},
            "types": types,
            "aliases": self.aliases,
            "classes": self.classes,
            "pous": [vars(unit) for unit in self.pous],
            "lines": self.lines,
            "files": self.files,
            "kept": [[k.name, k.type, k.persistent, k.size] for k in self.kept],
            "io": self.io,
            "bounds": [check.to_list() for check in self.bounds],
            "stack": self.stack and {name: getattr(self.stack, name) for name in ("amount", "parts", "at_least")},
            "unkept": self.unkept,
            "made_of": self.made_of,
            "internal": self.internal,
            "passed_lines": self.passed_lines,
            "frames": frames,
            "online": self.online,
            "debug": [base64.b64encode(zlib.compress(data)).decode() for data in self.debug],
        }
        return json.dumps(document, separators=(",", ":"))

    @staticmethod
    def from_json(text: str, name: str = "The symbol file") -> SymbolTable:
        """Raises UsageError, which calls it `name`, when it is not a symbol file."""
        try:
            document = json.loads(text)
            if document["format"] != FORMAT:
                raise UsageError(
                    f"{name} has format {document['format']}, this plctool knows {FORMAT}; build again.",
                    "bad-symbols",
                )
            types = DescribedTypes(document["types"])
            return SymbolTable(
                document["image_crc"],
                document["target"],
                document["project"],
                document["tasks"],
                {n: _read_variable(n, v, types) for n, v in document["variables"].items()},
                [CodeUnit(**unit) for unit in document["pous"]],
                [(offset, file, line) for offset, file, line in document["lines"]],
                document["files"],
                document["aliases"],
                document["classes"],
                {n: _read_constant(n, c, types) for n, c in document["constants"].items()},
                inflate_all([base64.b64decode(text) for text in document["debug"]], MAX_BYTES),
                [KeptName(*entry) for entry in document.get("kept", [])],
                document.get("io", {}),
                [BoundsCheck.from_list(entry) for entry in document.get("bounds", [])],
                document.get("unkept", {}),
                _read_need(document.get("stack")),
                document.get("made_of", ""),
                document.get("internal", {}),
                [PassedLine(pou, file, line) for pou, file, line in document.get("passed_lines", [])],
                {p: {n: types.get(t) for n, t in v.items()} for p, v in document.get("frames", {}).items()},
                document.get("online", {}),
            )
        except (ArchiveError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            raise UsageError(f"{name} cannot be read; build again.", "bad-symbols") from None

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


def _frame(variables: dict[str, Type], types: dict[str, Any]) -> dict[str, str]:
    for t in variables.values():
        describe(t, types)
    return {name: t.name for name, t in variables.items()}


def _read_need(entry: dict[str, Any] | None) -> Need | None:
    if entry is None:
        return None
    parts = tuple((str(name), int(amount)) for name, amount in entry["parts"])
    return Need(int(entry["amount"]), parts, True, bool(entry["at_least"]))


def _at_address(text: str) -> Symbol | None:
    """What is at an address such as %MW0; None if the text is none."""
    address = parse_address(text)
    if address is None:
        return None
    bit, t = (None, address.type) if address.width else (address.bit, ELEMENTARY["BYTE"])
    return Symbol(text.upper(), address.area.value, address.offset, t, bit)


def _variable(symbol: Symbol, types: dict[str, Any]) -> dict[str, Any]:
    describe(symbol.type, types)
    entry: dict[str, Any] = {"area": symbol.area, "offset": symbol.offset, "type": symbol.type.name}
    if symbol.bit is not None:
        entry["bit"] = symbol.bit
    if symbol.constant:
        entry["constant"] = True
    return entry


def _read_variable(name: str, entry: dict[str, Any], types: DescribedTypes) -> Symbol:
    t, constant = types.get(entry["type"]), entry.get("constant", False)
    return Symbol(name, entry["area"], entry["offset"], t, entry.get("bit"), constant=constant)


def _constant(symbol: Symbol, types: dict[str, Any]) -> dict[str, Any]:
    assert symbol.fixed is not None
    describe(symbol.type, types)
    return {"type": symbol.type.name, "content": symbol.fixed.hex()}


def _read_constant(name: str, entry: dict[str, Any], types: DescribedTypes) -> Symbol:
    return constant_symbol(name, types.get(entry["type"]), bytes.fromhex(entry["content"]))


def is_pattern(name: str) -> bool:
    """Whether a name stands for all variables that match it."""
    return "*" in name or "?" in name


def _pattern(text: str) -> str:
    return re.escape(text.strip()).replace(r"\*", ".*").replace(r"\?", ".")


def load_symbols(path: Path) -> SymbolTable:
    """Raises UsageError when the file is missing or not a symbol file."""
    try:
        text = read_regular(path, MAX_BINARY).decode("utf-8")
    except OSError as error:
        raise UsageError(f"The symbol file {path} cannot be read: {error.strerror}.", "no-symbols") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path} is not a symbol file; name the .sym that build wrote.", "bad-symbols") from None
    return SymbolTable.from_json(text, f"The symbol file {path}")


def symbol_path(image: Path) -> Path:
    """Where `build` writes the symbols of an image: app.cdl -> app.sym."""
    return image.with_suffix(SYMBOL_SUFFIX)


def cache_path(image_crc: int) -> Path:
    """Where the symbols of an image are kept for later: $XDG_CACHE_HOME/plctool/<crc>.sym."""
    return cache_folder() / f"{image_crc:08x}{SYMBOL_SUFFIX}"


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
