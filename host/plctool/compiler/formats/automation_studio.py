"""Automation Studio: a .fun declares functions and function blocks, and the body of each is in a file of its own that
repeats nothing but its name.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from plctool.compiler.base.source import Source
from plctool.compiler.formats.text import Chunk, Text
from plctool.compiler.formats.units import tokens_of

SUFFIX = ".fun"
_UNITS = frozenset(("FUNCTION", "FUNCTION_BLOCK"))


class _Declaration(NamedTuple):
    """Of one unit: offsets of its keyword, of its END_..., and of what follows."""

    file: Path
    begin: int
    end: int
    after: int


def with_bodies(read: dict[Path, list[Source]]) -> None:
    """Moves declarations to the files that hold their bodies."""
    declared = {name: found for path in read if path.suffix.lower() == SUFFIX for name, found in _declared(path, read)}
    moved: dict[Path, list[_Declaration]] = {}
    for path in read if declared else ():
        name, at = _head(read[path]) if path.suffix.lower() == ".st" else ("", 0)
        found = declared.pop(name, None)
        if found is not None:
            read[path] = [_joined(read[found.file][0], found, read[path][0], at)]
            moved.setdefault(found.file, []).append(found)
    for path, units in moved.items():
        source = read[path][0]
        rest = Text()
        rest.spliced(source.text, [(unit.begin, unit.after, "") for unit in sorted(units, key=lambda u: u.begin)])
        read[path] = [rest.source(source.path, source.text, findings=source.findings)]


def _declared(path: Path, read: Mapping[Path, list[Source]]) -> Iterator[tuple[str, _Declaration]]:
    """The units of a file that have no body, by their names in small letters."""
    tokens = list(tokens_of(read[path][0].text))
    begin = -1
    for i, token in enumerate(tokens):
        if token.type in _UNITS and tokens[i + 1].type == "IDENT":
            begin = i
        elif begin >= 0 and token.text.upper() == f"END_{tokens[begin].type}":
            if tokens[i - 1].text.upper() == "END_VAR":
                name = tokens[begin + 1].text.casefold()
                yield name, _Declaration(path, tokens[begin].pos, token.pos, token.end)
            begin = -1


def _head(sources: list[Source]) -> tuple[str, int]:
    """The name, in small letters, of the one unit in a file that declares nothing, and where its body begins; "" for
    other files."""
    if len(sources) != 1 or sources[0].pieces:
        return "", 0
    tokens = list(tokens_of(sources[0].text))
    units = [i for i, token in enumerate(tokens) if token.type in _UNITS]
    if units != [0] or tokens[1].type != "IDENT" or any(token.text.upper() == "END_VAR" for token in tokens):
        return "", 0
    return tokens[1].text.casefold(), tokens[1].end


def _joined(declaring: Source, unit: _Declaration, body: Source, at: int) -> Source:
    """The declaration, and the body from an offset on."""
    declaration, rest, whole = Text(), Text(), Text()
    place = declaring.pos(unit.begin)
    declaration.copied([Chunk(declaring.text[unit.begin : unit.end], place.line, place.column)])
    rest.spliced(body.text, [(0, at, "")])
    whole.source_text(declaration.source(declaring.path, declaring.text))
    whole.source_text(rest.source(body.path, body.text))
    return whole.source(body.path, body.text)
