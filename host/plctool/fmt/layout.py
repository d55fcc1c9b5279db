"""Writes one line of a program: blanks between its tokens, and breaks where it is too long.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from plctool.fmt.lines import Line
from plctool.fmt.scan import Item, Trivia
from plctool.fmt.spacing import break_weight, has_blank

INDENT = 4
_MAX_LEVEL = 40
"""Deeper blocks are not indented further, so that the size of a formatted file has a bound."""
_PER_BRACKET = 8  # more than the weights of one level of brackets
_OPENING, _CLOSING = ("_LPAR", "_LSQB"), ("_RPAR", "_RSQB")
_ATTACHED = ("_SEMI", "_COMMA", *_CLOSING)  # without a blank after a comment


@dataclass
class _Atom:
    """A text that is not broken. `weight`: of a break before it, None if there is none; `level`: of its indentation
    if it begins a line; `forced`: it does."""

    text: str
    blank: bool
    weight: int | None
    level: int
    forced: bool = False


def indentation(level: int) -> str:
    """The blanks before a line of a level."""
    return " " * (INDENT * min(level, _MAX_LEVEL))


def reindented(trivia: Trivia, column: int) -> str:
    """A comment of several lines, moved so that its first line begins at `column`; without blanks at ends of lines."""
    first, *others = trivia.text.split("\n")
    if trivia.verbatim or not others:
        return trivia.text if trivia.verbatim else first.rstrip()
    return "\n".join([first.rstrip(), *(_moved(line, column - trivia.column) for line in others)])


def _moved(line: str, by: int) -> str:
    text = line.strip()
    if not text or by == 0:
        return line.rstrip()
    width = len(line[: len(line) - len(line.lstrip())].expandtabs(INDENT))
    return " " * max(0, width + by) + text


def written(items: Sequence[Item], line: Line, lead: Sequence[Trivia], width: int) -> list[str]:
    """The lines of the file that a line of the program takes. `lead`: comments and pragmas before it in its line."""
    found: list[str] = []
    segment: list[_Atom] = []
    for atom in _Atoms(items, line).all(lead):
        if atom.forced and segment:
            found += _filled(segment, width)
            segment = []
        segment.append(atom)
    return [*found, *_filled(segment, width)]


class _Atoms:
    """Makes the atoms of a line. A list with a line break after its opening bracket keeps its rows: it is exploded."""

    def __init__(self, items: Sequence[Item], line: Line) -> None:
        self._items = items
        self._line = line
        self._found: list[_Atom] = []
        self._exploded: list[bool] = []  # of the brackets that are open
        self._count = 0  # of those that are exploded

    def all(self, lead: Sequence[Trivia]) -> list[_Atom]:
        """The atoms, in order."""
        level = self._line.level
        for trivia in lead:
            column = trivia.column if self._found else len(indentation(level))
            self._found.append(_Atom(reindented(trivia, column), True, None, level))
        after_comment = bool(lead)
        for at in range(self._line.first, self._line.end):
            if not self._items[at].virtual:
                self._add(at, self._found_before(at) if at > self._line.first else False, after_comment)
                after_comment = False
        return self._found

    @property
    def _level(self) -> int:
        """The level of a line that begins here."""
        return self._line.level + (self._count or 1 + self._line.opens)

    def _found_before(self, at: int) -> bool:
        """Adds comments and pragmas before a token; True if it begins a line after them."""
        item, previous = self._items[at], self._items[at - 1]
        breaks = bool(self._exploded) and self._exploded[-1] and previous.type in _OPENING
        for i, trivia in enumerate(item.before):
            forced = breaks or trivia.newlines > 0
            column = len(indentation(self._level)) if forced else trivia.column
            blank = i > 0 or previous.type not in _OPENING
            self._found.append(_Atom(reindented(trivia, column), blank, None, self._level, forced))
            breaks = trivia.ends_line or ((forced or trivia.verbatim) and item.newlines > 0)
        is_row = previous.type == "_COMMA" and bool(self._exploded) and self._exploded[-1]
        return breaks or (is_row and item.has_line_break)

    def _add(self, at: int, forced: bool, after_comment: bool) -> None:
        item, first = self._items[at], self._line.first
        level = self._level if at > first else self._line.level
        if item.type in _CLOSING and self._exploded.pop():
            self._count -= 1
            forced, level = True, self._line.level + self._count
        blank = at > first and has_blank(self._items, at, first, self._line.kind)
        if (item.before and at > first) or after_comment:
            blank = item.type not in _ATTACHED
        weight = break_weight(self._items, at) if at > first else None
        if weight is not None:
            weight += _PER_BRACKET * len(self._exploded)
        self._found.append(_Atom(item.text, blank, weight, level, forced))
        if item.type in _OPENING:
            following = self._items[at + 1]
            is_empty = following.type in _CLOSING and not following.before
            self._exploded.append(following.has_line_break and not is_empty)
            self._count += self._exploded[-1]


def _filled(atoms: Sequence[_Atom], width: int) -> Iterator[str]:
    """The lines of atoms without forced breaks between them."""
    start = 0
    while start < len(atoms):
        margin = indentation(atoms[start].level)
        end = _fitting(atoms, start, width - len(margin))
        yield margin + atoms[start].text + "".join(" " * a.blank + a.text for a in atoms[start + 1 : end])
        start = end


def _fitting(atoms: Sequence[_Atom], start: int, room: int) -> int:
    """The index of the atom before which a line that begins with `start` is broken."""
    used = len(atoms[start].text)
    at = start + 1
    while at < len(atoms):
        used += atoms[at].blank + len(atoms[at].text)
        if used > room:
            break
        at += 1
    if at == len(atoms):
        return at
    best: int | None = None
    for i in range(start + 1, at + 1):
        weight = atoms[i].weight
        if weight is not None and (best is None or weight <= (atoms[best].weight or 0)):
            best = i
    if best is not None:
        return best
    return next((i for i in range(at + 1, len(atoms)) if atoms[i].weight is not None), len(atoms))
