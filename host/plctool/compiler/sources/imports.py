"""Which parts of the libraries that are given a program needs, so that only these are parsed.

A library of hundreds of units costs a look for the words in it. A part is needed when a name that it declares is a word
of the program, or of another part that is needed; so it may be one too many, never one too few. What is parsed and not
used is not compiled.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from plctool.compiler.base.missing_names import declared_names
from plctool.compiler.base.source import Source
from plctool.compiler.sources.library_files import LibraryFiles
from plctool.compiler.syntax.conditions import has_conditions
from plctool.compiler.syntax.plain_text import NAME, plain_text, without_structures

_WORD = re.compile(NAME, re.ASCII)
_UNITS = ("FUNCTION_BLOCK", "FUNCTION", "PROGRAM", "INTERFACE", "CLASS", "TYPE")
_OTHERS = (
    "VAR_GLOBAL", "VAR_CONFIG", "VAR_ACCESS", "NAMESPACE", "CONFIGURATION", "USING", "TEST", "SETUP", "TEARDOWN",
    "METHOD", "ACTION", "PROPERTY",
)  # fmt: skip
_KEYWORD = re.compile(rf"(?<!\.)\b(END_)?({'|'.join((*_UNITS, *_OTHERS))})\b", re.IGNORECASE)
_IN_PARENTHESES = r"\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\)"
_ENUMERATION = re.compile(rf":\s*(?:{NAME}\s*)?({_IN_PARENTHESES})", re.ASCII)
_MODIFIER = "PUBLIC|PRIVATE|PROTECTED|INTERNAL|ABSTRACT|FINAL|OVERRIDE"
_UNIT_NAMES = re.compile(rf"\s*(?:(?:{_MODIFIER})\b\s*)*(?:{NAME})?", re.IGNORECASE | re.ASCII)
_TYPE_NAME = re.compile(rf"({NAME})\s*(?::|(?=[,)])|EXTENDS\b)", re.IGNORECASE | re.ASCII)


@dataclass(frozen=True, eq=False)
class Part:
    """Some units of a source, from offset `start` to `end`. `names`: what they may declare."""

    source: Source
    start: int
    end: int
    names: frozenset[str]

    @cached_property
    def words(self) -> frozenset[str]:
        """Every word in it, case-folded."""
        return words_of(self.source.text[self.start : self.end])


def words_of(text: str) -> frozenset[str]:
    """Every word of a text, case-folded, also those in comments."""
    return frozenset(map(str.casefold, _WORD.findall(text)))


class ImportedLibrary:
    """A library that a program may use. `using`: the namespaces of those that it needs itself."""

    def __init__(self, files: LibraryFiles, using: Sequence[str]) -> None:
        self.name = files.name
        self.namespace = files.namespace
        self.version = files.version
        self.path = str(files.path)
        self.using = list(using)
        self.sources = files.sources

    @cached_property
    def parts(self) -> list[Part]:
        """All of it, in order."""
        return [part for source in self.sources for part in parts_of(source)]

    @property
    def names(self) -> set[str]:
        """What it may declare."""
        return {name for part in self.parts for name in part.names}

    @cached_property
    def by_name(self) -> dict[str, list[Part]]:
        """The parts that may declare a name, case-folded."""
        found: dict[str, list[Part]] = {}
        for part in self.parts:
            for name in part.names:
                found.setdefault(name.casefold(), []).append(part)
        return found


def import_libraries(files: Sequence[LibraryFiles]) -> list[ImportedLibrary]:
    """Makes libraries ready for programs."""
    spaces = {library.name.casefold(): library.namespace for library in files}
    return [
        ImportedLibrary(library, [spaces[key] for d in library.dependencies if (key := d.name.casefold()) in spaces])
        for library in files
    ]


def needed_parts(texts: Iterable[str], libraries: Sequence[ImportedLibrary]) -> list[tuple[ImportedLibrary, Part]]:
    """What a program needs of libraries, in their order."""
    found: set[Part] = set()
    seen: set[str] = set()
    new = {word for text in texts for word in words_of(text)} if libraries else set()
    while new:
        seen |= new
        parts = {part for library in libraries for word in new for part in library.by_name.get(word, ())} - found
        found |= parts
        new = {word for part in parts for word in part.words} - seen
    return [(library, part) for library in libraries for part in library.parts if part in found]


# ---- the parts of a source ----


def parts_of(source: Source) -> list[Part]:
    """A part for each unit, with the comments and attributes before it. What is not plain units is one part."""
    text = source.text
    plain = plain_text(text, strings=False)
    units = None if source.findings or has_conditions(text) else _units(plain)
    if units is None:
        enumerations = words_of("\n".join(_ENUMERATION.findall(plain)))
        names = enumerations | declared_names(text) | declared_names(plain) | {source.stem.casefold()}
        return [Part(source, 0, len(text), names)]
    parts, start = [], 0
    for names, end in units:
        parts.append(Part(source, start, end, names))
        start = end
    return parts


def _units(text: str) -> list[tuple[frozenset[str], int]] | None:
    """Names and end of each unit in a plain text; None for one with other things in it, or that is not as it should
    be."""
    found: list[tuple[frozenset[str], int]] = []
    opened: tuple[str, int] | None = None
    for match in _KEYWORD.finditer(text):
        word, ends = match[2].upper(), match[1] is not None
        if opened is None:
            if ends or word not in _UNITS:
                return None
            opened = (word, match.end())
        elif word == opened[0] and ends:
            found.append((_names(word, text[opened[1] : match.start()]), match.end()))
            opened = None
        elif word == opened[0]:
            return None
    return None if opened is not None else found


def _names(keyword: str, text: str) -> frozenset[str]:
    """What the plain text after the first word of a unit declares. A name may be that of a modifier."""
    if keyword == "TYPE":
        return frozenset(_TYPE_NAME.findall(without_structures(text)))
    match = _UNIT_NAMES.match(text)
    return words_of(match.group()) if match else frozenset()
