"""Formats a text: lines with their comments, blank lines, the column of comments at the end of lines.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from plctool.compiler.formats.il_files import has_lists
from plctool.errors import InternalError, UsageError
from plctool.fmt.layout import INDENT, indentation, reindented, written
from plctool.fmt.lines import DECLARATION, Line, split
from plctool.fmt.scan import Item, Trivia, scan

DEFAULT_WIDTH = 120
_GAP = 2  # blanks at least before a comment at the end of a line
_WIDE = 80  # characters; a longer line does not move the comments of others
_SWITCH = re.compile(r"(?://|\(\*|/\*)\s*fmt:\s*(off|on)\b")

Range = tuple[int, int]
"""The first and the last line of a part of a file, from 1."""


@dataclass
class _Row:
    """What takes one or more lines of the result: a line of the program or comments of their own. `begin`, `end`: its
    first and last line in the file, from 0; `blank`: a blank line stands before it."""

    texts: list[str]
    level: int
    begin: int
    end: int
    blank: bool
    trailing: Sequence[Trivia] = ()
    opens: bool = False
    declares: bool = False


def formatted(path: str, text: str, width: int = DEFAULT_WIDTH, ranges: Sequence[Range] = ()) -> str:
    """Returns the formatted text; `ranges`: only what stands in these lines. `path` is for messages. A text
    with Instruction List stays as it is. Raises UsageError if the text has a syntax error, InternalError instead of
    returning a text that is another program."""
    plain = text.replace("\r\n", "\n")
    if has_lists(plain):
        return text
    items = scan(path, plain)
    result = _Writer(plain, items, width).result(ranges)
    if result != plain:
        _check_same(path, items, result)
    is_windows = text.count("\r\n") * 2 > plain.count("\n")
    return result.replace("\n", "\r\n") if is_windows else result


def _check_same(path: str, items: Sequence[Item], result: str) -> None:
    try:
        again = scan(path, result)
    except UsageError as error:
        raise InternalError(ValueError(f"the formatted text is not valid: {error.message}"), f" in {path}") from None
    if list(_content(again)) != list(_content(items)):
        raise InternalError(ValueError("formatting would change the program, so the file was left as it is"))


def _content(items: Sequence[Item]) -> Iterator[tuple[str, str]]:
    """All of a text but the white space."""
    for item in items:
        for trivia in item.before:
            yield "", "\n".join(line.strip() for line in trivia.text.split("\n"))
        yield item.type, item.text


class _Writer:
    def __init__(self, text: str, items: Sequence[Item], width: int) -> None:
        self._text = text
        self._items = items
        self._width = width
        self._starts = [0, *(match.end() for match in re.finditer("\n", text))]
        self._rows: list[_Row] = []
        self._after_unit = False

    def result(self, ranges: Sequence[Range]) -> str:
        """The text, formatted in the ranges."""
        for line in split(self._items):
            self._add_line(line)
        end = len(self._items) - 1
        if last := self._add_before(Line(end, end + 1, 0, 0), self._items[end]):
            self._add_own(last, 0)  # nothing follows it in its line
        self._finish_rows()
        kept = list(self._switched_off())
        if ranges or kept:
            return self._mixed(ranges, kept)
        return "".join(self._written(row, i > 0) for i, row in enumerate(self._rows))

    # ---- rows ----

    def _add_line(self, line: Line) -> None:
        first = next((i for i in range(line.first, line.end) if not self._items[i].virtual), None)
        if first is not None:
            item = self._items[first]
            rows_before = len(self._rows)
            lead = self._add_before(line, item)
            texts = written(self._items, replace(line, first=first), lead, self._width)
            begin = lead[0] if lead else item
            row = _Row(
                texts, line.level, self._line(begin.start), self._line(self._last(line).end - 1), begin.newlines > 1
            )
            self._set_blank(row, line, rows_before)
            row.opens, row.declares = line.opens, line.kind == DECLARATION
            self._rows.append(row)
            self._after_unit = False
        self._after_unit |= line.unit_ends

    def _last(self, line: Line) -> Item:
        """The last token of a line that is in the file."""
        return next(self._items[i] for i in reversed(range(line.first, line.end)) if not self._items[i].virtual)

    def _set_blank(self, row: _Row, line: Line, rows_before: int) -> None:
        """Blank lines do not begin or end a block, and one separates units."""
        own = self._rows[rows_before:]
        if line.closes or (self._rows and self._rows[-1].opens):
            row.blank = False
        if own and rows_before and self._rows[rows_before - 1].opens:
            own[0].blank = False
        if self._after_unit and line.unit_begins and not any(r.blank for r in (*own, row)):
            (own[0] if own else row).blank = True

    def _add_before(self, line: Line, item: Item) -> list[Trivia]:
        """Adds what stands between the last row and a token: comments after the one and before the other. Returns those
        in the line of the token."""
        before = list(item.before)
        trailing = _taken_by_previous(item) if self._rows else 0
        if trailing:
            self._rows[-1].trailing = before[:trailing]
            self._rows[-1].end = self._line(before[trailing - 1].end - 1)
        at = _begin_of_lead(item, trailing)
        group: list[Trivia] = []
        for trivia in before[trailing:at]:
            if group and trivia.newlines:
                self._add_own(group, line.inner)
                group = []
            group.append(trivia)
        if group:
            self._add_own(group, line.inner)
        return before[at:]

    def _add_own(self, group: Sequence[Trivia], level: int) -> None:
        """Adds comments or pragmas with a line of their own."""
        first, *others = group
        margin = indentation(level)
        text = margin + " ".join([reindented(first, len(margin)), *(reindented(t, t.column) for t in others)])
        begin, end = self._line(first.start), self._line(group[-1].end - 1)
        self._rows.append(_Row(text.split("\n"), level, begin, end, first.newlines > 1))

    def _line(self, offset: int) -> int:
        return bisect_right(self._starts, offset) - 1

    # ---- comments at ends of lines ----

    def _finish_rows(self) -> None:
        """Writes the comments at ends of lines: in one column in statements that follow each other, and in declarations
        without a blank line between them."""
        run: list[_Row] = []
        for row in self._rows:
            is_gap = not row.trailing and not row.declares
            if run and (is_gap or row.blank or row.level != run[-1].level or row.declares != run[-1].declares):
                _write_trailing(run)
                run = []
            if row.trailing:
                run.append(row)
        _write_trailing(run)

    # ---- the text ----

    def _written(self, row: _Row, may_have_blank: bool) -> str:
        lines = "".join(f"{text}\n" for text in row.texts)
        return f"\n{lines}" if row.blank and may_have_blank else lines

    def _switched_off(self) -> Iterator[Range]:
        """The lines between comments that switch the formatter off and on."""
        begin: int | None = None
        for item in self._items:
            for trivia in item.before:
                switch = _SWITCH.match(trivia.text)
                if switch is None:
                    continue
                if switch[1] == "off" and begin is None:
                    begin = self._line(trivia.start) + 1
                elif switch[1] == "on" and begin is not None:
                    yield begin, self._line(trivia.end - 1) + 1
                    begin = None
        if begin is not None:
            yield begin, len(self._starts)

    def _mixed(self, ranges: Sequence[Range], kept: Sequence[Range]) -> str:
        """The text with other lines as they are in the file."""
        source = self._text.split("\n")
        found: list[str] = []
        at, was_chosen = 0, True  # the next line of the file; whether what is before it was formatted
        for chunk in _chunks(self._rows):
            begin, end = chunk[0].begin, chunk[-1].end
            chosen = (not ranges or _touches(begin, end, ranges)) and not _touches(begin, end, kept)
            if not (chosen and was_chosen):
                found += [f"{line}\n" for line in source[at:begin]]
            if chosen:
                found += [self._written(row, was_chosen if i == 0 else True) for i, row in enumerate(chunk)]
                if found and at == 0 and was_chosen:
                    found[0] = found[0].removeprefix("\n")
            else:
                found += [f"{line}\n" for line in source[begin : end + 1]]
            at, was_chosen = end + 1, chosen
        if not was_chosen:
            return "".join(found).removesuffix("\n") + "".join(f"\n{line}" for line in source[at:])
        return "".join(found)


def _taken_by_previous(item: Item) -> int:
    """How many comments and pragmas before a token belong to the line before it."""
    count = 0
    for trivia in item.before:
        if trivia.newlines or (not item.has_line_break and trivia.text.startswith("{")):
            break
        count += 1
    return count


def _begin_of_lead(item: Item, trailing: int) -> int:
    """The index of the first comment or pragma in the line of a token."""
    at = len(item.before)
    if item.newlines:
        return at
    while at > trailing:
        at -= 1
        if item.before[at].newlines:
            break
    return at


def _write_trailing(run: Sequence[_Row]) -> None:
    lengths = [len(row.texts[-1]) for row in run]
    widest = max((length for length in lengths if length <= _WIDE), default=0)
    for row, length in zip(run, lengths, strict=True):
        column = -(-(max(widest, length) + _GAP) // INDENT) * INDENT
        first, *others = row.trailing
        comments = " ".join([reindented(first, column), *(reindented(t, t.column) for t in others)])
        row.texts[-1:] = (row.texts[-1].ljust(column) + comments).split("\n")


def _chunks(rows: Sequence[_Row]) -> Iterator[list[_Row]]:
    """Rows that have no line of the file in common."""
    chunk: list[_Row] = []
    for row in rows:
        if chunk and row.begin > chunk[-1].end:
            yield chunk
            chunk = []
        chunk.append(row)
    if chunk:
        yield chunk


def _touches(begin: int, end: int, ranges: Sequence[Range]) -> bool:
    return any(first <= end + 1 and begin + 1 <= last for first, last in ranges)
