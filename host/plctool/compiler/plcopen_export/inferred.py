"""Sources whose variables have the types that the check found for them: those of diagrams are declared by a value.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from plctool.compiler.base.source import Source
from plctool.iec.types import Type

_DECLARED = re.compile(r"(?<=: )@type\(.*?\)(?=; END_VAR\n)", re.DOTALL)


def with_types(sources: Iterable[Source], found: Mapping[tuple[str, str, int], Type]) -> list[Source]:
    """The sources of a checked program. `found`: as in World.inferred."""
    return [_with_types(source, found) for source in sources]


def _with_types(source: Source, found: Mapping[tuple[str, str, int], Type]) -> Source:
    parts, moves, end, moved = list[str](), list[tuple[int, int]](), 0, 0
    for match in _DECLARED.finditer(source.text):
        t = found.get((source.path, source.name, match.start()))
        if t is None or source.is_copied(match.start()):
            continue
        parts += [source.text[end : match.start()], str(t)]
        end = match.end()
        moved += len(str(t)) - len(match[0])
        moves.append((end, moved))
    if not moves:
        return source

    def place(offset: int) -> int:
        return offset + next((by for start, by in reversed(moves) if offset >= start), 0)

    pieces = tuple(replace(piece, offset=place(piece.offset)) for piece in source.pieces)
    lists = tuple((place(offset), text) for offset, text in source.lists)
    return replace(source, text="".join(parts) + source.text[end:], pieces=pieces, lists=lists)
