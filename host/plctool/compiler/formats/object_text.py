"""The text of a CODESYS 3 object: declaration and body of one unit, maybe of its members, without END_PROGRAM and such.

In that system an END_... is no part of the text, because the object ends there. A file is taken for the text of an
object when it begins with one unit, or a member of one, and holds no END_... of any unit; a file of a person who forgot
one of several is left as it is, so that the compiler says where.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from plctool.compiler.base.source import Piece, Source
from plctool.compiler.formats.text import Text
from plctool.compiler.formats.units import UNITS, tokens_of
from plctool.compiler.syntax.lexer import Token
from plctool.compiler.syntax.plain_text import plain_text

_MEMBERS = frozenset(("METHOD", "PROPERTY", "ACTION"))
_ACCESSORS = frozenset(("GET", "SET"))
_END = re.compile(rf"\bEND_(?:{'|'.join(sorted(UNITS | _MEMBERS | _ACCESSORS))})\b", re.IGNORECASE)


def read_object(path: str, text: str) -> Source:
    """A file of Structured Text, with what ends its unit."""
    if _END.search(text) and _END.search(plain_text(text, strings=False)):
        return Source(path, text)
    tokens = list(tokens_of(text))
    inserts = _inserts(tokens, text)
    if not inserts:
        return Source(path, text)
    made = Text()
    made.spliced(text, inserts)
    return made.source(path, text)


def is_member(sources: Sequence[Source]) -> bool:
    """Whether a file is one METHOD, PROPERTY or ACTION, or several."""
    return len(sources) == 1 and next(tokens_of(sources[0].text)).type in _MEMBERS


def with_members(unit: Source, members: Sequence[Source]) -> list[Source]:
    """A POU with its members after it. Their own files stay as sources without text, so that lines can be shown."""
    text = Text()
    shown = []
    for source in (unit, *members):
        text.source_text(source)
        shown.append(replace(source, text="", original=source.original or source.text, pieces=(Piece(0, 1, 1, False),)))
    return [text.source(unit.path, unit.original or unit.text), *shown[1:]]


def _inserts(tokens: list[Token], text: str) -> list[tuple[int, int, str]]:
    """Where an END_... is missing; none when the text is no object."""
    if tokens[0].type not in UNITS | _MEMBERS:
        return []
    found: list[tuple[int, int, str]] = []
    still_open: list[str] = []
    for i in range(len(tokens)):
        kind = _opens(tokens, i, text)
        if not kind:
            continue
        if kind in UNITS and still_open:
            return []
        ended = _ended_by(kind, still_open)
        if ended:
            at = tokens[i - 1].end
            found.append((at, at, _ends(ended)))
        still_open.append(kind)
    end = tokens[-2].end
    return [*found, (end, end, _ends(still_open))]


def _opens(tokens: list[Token], i: int, text: str) -> str:
    """The keyword, when a unit, a member or an accessor begins with a token; "" when it does not."""
    token = tokens[i]
    if token.type not in UNITS | _MEMBERS | _ACCESSORS or not _begins_line(token, text):
        return ""
    following = tokens[i + 1]
    if token.type in _ACCESSORS:
        return token.type if not text[token.end :].partition("\n")[0].strip() else ""
    on_line = "\n" not in text[token.end : following.pos]
    return token.type if on_line and following.type in ("IDENT", "MODIFIER", *_ACCESSORS) else ""


def _begins_line(token: Token, text: str) -> bool:
    return not text[text.rfind("\n", 0, token.pos) + 1 : token.pos].strip()


def _ended_by(kind: str, still_open: list[str]) -> list[str]:
    """What is closed before a keyword of this kind; taken off `still_open`."""
    closes = _ACCESSORS if kind in _ACCESSORS else _ACCESSORS | _MEMBERS
    at = len(still_open)
    while at and still_open[at - 1] in closes:
        at -= 1
    ended, still_open[at:] = still_open[at:], []
    return ended


def _ends(opened: list[str]) -> str:
    return "".join(f"\nEND_{keyword}" for keyword in reversed(opened)) + "\n"
