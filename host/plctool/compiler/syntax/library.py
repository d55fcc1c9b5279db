"""The standard library: which name is defined where. A unit is parsed when a program first uses it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import field
from functools import cache
from pathlib import Path

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.parser import parse
from plctool.core import lib
from plctool.records import dataclass

_FOLDER = Path(__file__).resolve().parents[2] / "stdlib"
_OPENING = re.compile(
    r"^(?:(?P<pou>FUNCTION_BLOCK|FUNCTION)\s+(?P<name>\w+)|(?P<types>TYPE)\b|(?P<globals>VAR_GLOBAL)\b)", re.MULTILINE
)
STAND_INS = (
    "Standard", "Standard64", "Util", "SysMem", "IBaseLibrary", "__System", "MEM", "CmpLog", "CmpIecTask", "CmpApp",
    "SysTime", "SysTimeRtc", "SysFile", "SysDir", "StringUtils", "STU",
    "Tc2_Standard", "Tc2_System", "Tc2_Utilities",
)  # fmt: skip
"""Libraries of other systems that this one stands in for, as far as it has their names."""

PREFIXED = ("CAA", "CIA405", "FILE", "NBS", "COM")
"""Namespaces whose names are too common without them: `FILE.Open` is FILE_Open here."""

_PREFIXED = re.compile(rf"({'|'.join(PREFIXED)})\.(?=\w+$)", re.IGNORECASE)

_QUALIFIED = re.compile(rf"(?:{'|'.join(STAND_INS)})\.(?=\w+$)", re.IGNORECASE)
PARAMETERS = frozenset(("alarm_history_size",))
"""Constants of the library in whose place it uses those that a program declares."""

OTHER_BLOCKS = ("PID", "HYSTERESIS", "INTEGRAL", "DERIVATIVE")
"""What is another block with Util in front than without it."""

_OTHERS = {f"util.{name.casefold()}": f"util_{name.casefold()}__" for name in OTHER_BLOCKS}

_STRUCT = re.compile(r"\bSTRUCT\b.*?\bEND_STRUCT\b", re.DOTALL)
_DECLARED_NAME = re.compile(r"(\w+)\s*:(?!=)")


def without_library(key: str) -> str:
    """A name without the library of other systems before it: there is one library here."""
    if "." not in key:
        return key
    return _OTHERS.get(key.casefold()) or _PREFIXED.sub(r"\1_", _QUALIFIED.sub("", key, count=1), count=1)


def shown_name(name: str) -> str:
    """The name as users write it: `FILE.Open` of FILE_Open."""
    return re.sub(rf"^({'|'.join(PREFIXED)})_", r"\1.", name)


_COMMENT = re.compile(r"\(\*(?P<words>(?:(?!\*\)).)*)\*\)\s*(?:\{[^{}]*\}\s*)*$", re.DOTALL)


@dataclass(frozen=True)
class Entry:
    """Where a name is defined: the part of a source from `start` to `end`."""

    name: str
    source: Source
    start: int
    end: int
    keyword: str  # FUNCTION, FUNCTION_BLOCK, TYPE or VAR_GLOBAL

    @property
    def is_function(self) -> bool:
        """True for a function, which is called by this name."""
        return self.keyword == "FUNCTION"

    def comment(self) -> str:
        """What stands before it in the source, without a blank line between; "" without a comment."""
        before = self.source.text[self.start : self.source.text.index(self.keyword, self._opening())]
        match = _COMMENT.search(before)
        return match["words"].strip() if match and "\n\n" not in before[match.end("words") :] else ""

    def _opening(self) -> int:
        match = _OPENING.search(self.source.text, self.start)
        return match.start() if match else self.start


class Library:
    """An index over library sources. Openings and endings of units stand at the beginning of a line there."""

    def __init__(self, sources: Sequence[Source]) -> None:
        self.sources = list(sources)
        self._entries: dict[str, Entry] = {}
        self._overloads: dict[str, list[str]] = {}
        for source in sources:
            self._index(source)

    def _index(self, source: Source) -> None:
        text, at = source.text, 0
        while match := _OPENING.search(text, at):
            keyword = match["pou"] or match["types"] or match["globals"]
            closing = re.compile(rf"^END_{keyword.replace('VAR_GLOBAL', 'VAR')}\b", re.MULTILINE).search(
                text, match.end()
            )
            end = closing.end() if closing else len(text)
            names = (
                [match["name"]] if match["name"] else _DECLARED_NAME.findall(_STRUCT.sub("", text[match.end() : end]))
            )
            for name in names:
                self._entries[name.casefold()] = Entry(name, source, at, end, keyword)
                base, separator, suffix = name.rpartition("__")
                if separator and base and suffix:
                    self._overloads.setdefault(base.casefold(), []).append(name)
            at = end

    def overloads(self, key: str) -> list[str]:
        """`SIN` is defined as SIN__REAL and SIN__LREAL: their names."""
        return self._overloads.get(key, [])

    def entry(self, key: str) -> Entry | None:
        """Where a case-folded name is defined; of overloads the first one."""
        return self._entries.get(self._overloads[key][0].casefold() if key in self._overloads else key)

    def names(self, *keywords: str) -> list[str]:
        """Everything there is, or what is declared by one of these keywords."""
        found = [e for e in self._entries.values() if not keywords or e.keyword in keywords]
        functions = not keywords or "FUNCTION" in keywords
        return [e.name for e in found if "__" not in e.name] + [k.upper() for k in self._overloads if functions]

    def defined_in(self, path: str) -> list[Entry]:
        """What a source defines, but for what is internal."""
        return [e for e in self._entries.values() if e.source.path == path and not e.name.endswith("__")]

    def parse(self, key: str, diagnostics: Diagnostics) -> list[ast.Declaration]:
        """The declarations of the unit that defines the name; none when there is no such unit."""
        entry = self._entries.get(key)
        return parse(entry.source, diagnostics.at(entry.source).error, entry.start, entry.end) if entry else []


@dataclass(frozen=True)
class Variant:
    """The same units for another type: their names become `name`, with the unit's own in place of {}, and each word of
    `words` what it stands for."""

    name: str
    words: dict[str, str] = field(default_factory=dict)

    def __call__(self, source: Source) -> Source:
        words = dict(self.words)
        for match in _OPENING.finditer(source.text):
            if match["name"]:
                words[match["name"]] = self._renamed(match["name"])
        text = re.sub(rf"\b(?:{'|'.join(words)})\b", lambda m: words[m.group()], source.text)
        return Source(source.path, text)

    def _renamed(self, name: str) -> str:
        """What is internal, such as SPAN__, cannot be an overload."""
        return f"W{name}" if name.endswith("__") else self.name.format(name.removesuffix("__STRING"))


def _counter(name: str, bits: int, *, signed: bool) -> Variant:
    low, high = (1 << bits - 1, (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    return Variant(f"{{}}_{name}", {"INT": name, "32768": str(low), "32767": str(high)})


_WIDE = {"STRING": "WSTRING", "BYTE": "WORD"}
_LONG = {"TIME": "LTIME", "T": "LTIME"}
_VARIANTS: dict[str, list[Variant]] = {
    "stdlib/strings.st": [Variant("{}__WSTRING", _WIDE), Variant("W{}", _WIDE)],
    "stdlib/syslib_sockets.st": [Variant("Fw{}")],
    "stdlib/timers.st": [Variant("{}_TIME"), Variant("{}_LTIME", _LONG), Variant("L{}", _LONG)],
    "stdlib/counters.st": [
        Variant("{}_INT"), _counter("DINT", 32, signed=True), _counter("LINT", 64, signed=True),
        _counter("UDINT", 32, signed=False), _counter("ULINT", 64, signed=False),
    ],
}  # fmt: skip
"""What a source is written for once, and is there for other types as well."""


def _exception_codes() -> str:
    """The type of what __CATCH gives, with the numbers of the runtime (SysExcept.h)."""
    codes = {name: int(getattr(lib, name)) for name in dir(lib) if name.startswith("RTSEXCPT_")}
    del codes["RTSEXCPT_MASK"]
    codes["RTSEXCPT_UNKNOWN"] = 0xFFFF_FFFF
    values = ", ".join(f"{name} := {code}" for name, code in sorted(codes.items(), key=lambda item: item[1]))
    return f"TYPE\n    ExceptionCode : ({values}) UDINT;\nEND_TYPE\n"


def is_standard(path: str) -> bool:
    """True for a source of the standard library."""
    return any(source.path == path for source in standard_library().sources)


@cache
def standard_library() -> Library:
    """The library that comes with the tool."""
    sources = [Source(f"stdlib/{p.name}", p.read_text("latin-1")) for p in sorted(_FOLDER.glob("*.st"))]
    sources.append(Source("stdlib/exceptions.st", _exception_codes()))
    return Library([*sources, *(variant(s) for s in sources for variant in _VARIANTS.get(s.path, ()))])
