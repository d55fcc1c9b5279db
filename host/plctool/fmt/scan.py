"""Tokens with all that stands between them: comments, pragmas, and code that conditional pragmas leave out.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from plctool.compiler.base.nesting import NestingError, room_for_nesting
from plctool.compiler.base.source import Source
from plctool.compiler.formats import unreadable
from plctool.compiler.formats.beremiz import without_blocks_in_c
from plctool.compiler.formats.object_text import read_object
from plctool.compiler.syntax.conditions import is_directive
from plctool.compiler.syntax.lexer import KEYWORDS, Token
from plctool.compiler.syntax.parser import parse_all
from plctool.compiler.syntax.plain_text import FLAT_COMMENT, comment_ends
from plctool.errors import UsageError

END = "$END"
_TRIVIA = re.compile(
    rf"(?P<blank>\s+)|(?P<comment>{FLAT_COMMENT})|(?P<nested>\(\*|/\*)|(?P<pragma>\{{[^{{}}]*\}})|(?P<other>\S)",
    re.ASCII | re.DOTALL,
)


@dataclass
class Trivia:
    """A comment or pragma, or code that is left out, as written. `newlines`: line breaks between it and what is before
    it. `column`: of its first character, from 0."""

    text: str
    start: int
    newlines: int
    column: int
    verbatim: bool = False

    @property
    def end(self) -> int:
        """The offset past the last character."""
        return self.start + len(self.text)

    @property
    def ends_line(self) -> bool:
        """True for a comment that lasts until the end of the line."""
        return self.text.startswith("//")


@dataclass
class Item:
    """A token and what stands before it. `newlines`: line breaks between it and what is before it. A `virtual` token is
    an END_... that the file does not contain, as the text of an object of CODESYS."""

    type: str
    text: str
    start: int
    newlines: int = 0
    before: list[Trivia] = field(default_factory=list)
    virtual: bool = False

    @property
    def end(self) -> int:
        """The offset past the last character."""
        return self.start + len(self.text)

    @property
    def has_line_break(self) -> bool:
        """True if a line break stands somewhere between the previous token and this one."""
        return self.newlines > 0 or any(t.newlines for t in self.before)


def scan(path: str, text: str) -> list[Item]:
    """Returns the tokens of a text, the last one of type $END. Raises UsageError with the first syntax error."""
    refused = unreadable.refused_text(text)
    if refused is not None:
        raise _refusal(path, refused.line, refused.column, refused.message)
    source = without_blocks_in_c(read_object(path, text))
    offsets = _Offsets(source, text)
    items: list[Item] = []
    last = 0
    for token in _tokens(source):
        start = offsets.original(token)
        if start is None:
            items.append(Item(token.type, "", last, virtual=True))
            continue
        before, newlines = _between(text, last, start)
        items.append(Item(token.type, _written(token), start, newlines, before))
        last = start + len(token.text)
    return items


def _written(token: Token) -> str:
    """The text of a token, keywords in capitals."""
    upper = token.text.upper()
    return upper if KEYWORDS.get(upper) == token.type else token.text


def _tokens(source: Source) -> list[Token]:
    tokens: list[Token] = []
    errors: list[tuple[int, str]] = []
    try:
        with room_for_nesting():
            parse_all(source, lambda at, code, message: errors.append((at, message)), tokens=tokens)
    except NestingError as error:
        raise _refusal(error.pos.file, error.pos.line, error.pos.column, "nested too deeply") from None
    except RecursionError:
        raise _refusal(source.path, 1, 1, "something is nested too deeply") from None
    if errors:
        at, message = min(errors)
        pos = source.pos(at)
        raise _refusal(pos.file, pos.line, pos.column, message)
    return tokens


def _refusal(path: str, line: int, column: int, message: str) -> UsageError:
    return UsageError(f"{path}:{line}:{column}: {message}. The file was not formatted: correct this first.", "syntax")


class _Offsets:
    """Places of tokens in the file, of which the compiled text may be a copy with END_... added."""

    def __init__(self, source: Source, text: str) -> None:
        self._source = source
        self._text = text

    def original(self, token: Token) -> int | None:
        """The offset in the file; None for a token that was added."""
        source = self._source
        if not source.pieces:
            return token.pos
        if token.type == END:
            return len(self._text)
        pos = source.pos(token.pos)
        start = source.line_starts[pos.line - 1] + pos.column - 1
        return start if self._text.startswith(token.text, start) and source.is_copied(token.pos) else None


def _between(text: str, start: int, end: int) -> tuple[list[Trivia], int]:
    """What stands between two tokens, and the line breaks before the second one."""
    found: list[Trivia] = []
    newlines = 0
    for kind, at, to in _parts(text, start, end):
        if kind == "blank":
            newlines += text.count("\n", at, to)
            continue
        column = at - (text.rfind("\n", 0, at) + 1)
        found.append(Trivia(text[at:to], at, newlines, column, verbatim=kind == "other"))
        newlines = 0
    return _with_code_left_out(text, found), newlines


def _parts(text: str, at: int, end: int) -> Iterator[tuple[str, int, int]]:
    """Yields kind, begin and end of all between two tokens, comments as the lexer reads them."""
    while at < end and (match := _TRIVIA.match(text, at, end)):
        kind, to = match.lastgroup or "", match.end()
        if kind == "nested":
            whole, first = comment_ends(text, match[kind], to, end)
            to = whole if whole >= 0 else first if first >= 0 else end
        yield kind, at, to
        at = to


def _with_code_left_out(text: str, found: list[Trivia]) -> list[Trivia]:
    """Joins code that is left out, and the conditional pragmas around it, to one piece that stays as written."""
    if not any(t.verbatim for t in found):
        return found
    marks = [i for i, t in enumerate(found) if t.verbatim or is_directive(t.text)]
    first, last = found[marks[0]], found[marks[-1]]
    piece = Trivia(text[first.start : last.end], first.start, first.newlines, first.column, verbatim=True)
    return [*found[: marks[0]], piece, *found[marks[-1] + 1 :]]
