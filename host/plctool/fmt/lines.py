"""Splits a program into lines: declarations, statements, and what opens and closes blocks.

The program has been parsed without an error, so a keyword is one and each block has its end.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from plctool.fmt.scan import END, Item

DECLARATION, STATEMENT, LABEL = "declaration", "statement", "label"

_OPENING = frozenset(("_LPAR", "_LSQB"))
_CLOSING = frozenset(("_RPAR", "_RSQB"))
_BLOCKS_OF_VARIABLES = frozenset(("VAR", "GLOBAL", "CONFIG", "ACCESS"))
_NAMED_UNITS = frozenset(("FUNCTION_BLOCK", "PROGRAM", "CLASS", "INTERFACE", "NAMESPACE"))
_TYPED_UNITS = frozenset(("FUNCTION", "METHOD", "PROPERTY", "PROPERTY_GET", "PROPERTY_SET"))
_STEPS = frozenset(("STEP", "INITIAL_STEP"))
_TESTS = frozenset(("TEST", "SETUP", "TEARDOWN"))
_UNITS = frozenset(("TYPE", "CONFIGURATION", "GLOBAL", "FUNCTION")) | _NAMED_UNITS | _TESTS
_MARGIN = (_NAMED_UNITS | _TYPED_UNITS | _TESTS) - {"PROPERTY"}
"""Keywords of units whose content begins at their own column."""
_OPENERS = {"IF": "_THEN", "CASE": "_OF", "FOR": "_DO", "WHILE": "_DO", "REPEAT": "", "TRY": ""}
"""Statements with blocks, and the keyword after which the block begins; "": at once."""
_BRANCHES = {"_ELSIF": "_THEN", "_ELSE": "", "_CATCH": "", "_FINALLY": ""}
_STRUCTURES = frozenset(("STRUCT", "UNION"))
_VARIABLES = frozenset((*_BLOCKS_OF_VARIABLES, *_STRUCTURES))
_CONFIGURATIONS = frozenset(("CONFIGURATION", "RESOURCE"))


@dataclass
class Line:
    """The tokens from `first` to before `end`. `level`: of its indentation; `inner`: that of comments before it.
    `opens`, `closes`: a block that is indented."""

    first: int
    end: int
    level: int
    inner: int
    kind: str = STATEMENT
    opens: bool = False
    closes: bool = False
    unit_begins: bool = False
    unit_ends: bool = False


@dataclass
class _Block:
    """An open block: its keyword, the level of its content."""

    keyword: str
    level: int
    labelled: bool = False  # of a CASE: a label was seen, and no ELSE


class _Splitter:
    def __init__(self, items: Sequence[Item]) -> None:
        self._items = items
        self._at = 0
        self._blocks = [_Block("", 0)]
        self._special: dict[str, Callable[[], int]] = {
            **dict.fromkeys(_NAMED_UNITS, self._names),
            **dict.fromkeys(_TYPED_UNITS, self._typed),
            **dict.fromkeys(_BLOCKS_OF_VARIABLES, self._qualifiers),
            **dict.fromkeys(_STEPS, self._with_colon),
            "ACTION": self._with_colon,
            "CONFIGURATION": lambda: self._at + 2,
            "RESOURCE": lambda: self._at + 4,
            "TEST": lambda: self._at + 2,
            "GET": self._qualifiers,
            "SET": self._qualifiers,
            "TRANSITION": lambda: self._until("_SEMI", "_END_TRANSITION"),
        }

    def lines(self) -> Iterator[Line]:
        """All lines, each token in one of them."""
        while self._type(self._at) != END:
            line = self._line()
            if not line.opens or line.kind == DECLARATION:
                line.end = self._with_semicolons(line.end)
            self._at = line.end
            yield line

    def _type(self, at: int) -> str:
        return self._items[at].type

    @property
    def _block(self) -> _Block:
        return self._blocks[-1]

    @property
    def _level(self) -> int:
        """The level of statements and declarations here."""
        return self._block.level + self._block.labelled

    def _line(self) -> Line:
        kind = self._type(self._at)
        if kind.startswith("_END_"):
            return self._closing(kind)
        if kind in _BRANCHES or kind == "_UNTIL":
            return self._branch(kind)
        inside = self._block.keyword
        if inside in _CONFIGURATIONS and kind in ("PROGRAM", "TASK"):
            return self._plain(self._until("_SEMI"), DECLARATION)
        if kind in _OPENERS:
            return self._opening(kind)
        if kind in self._special or kind in ("TYPE", "SETUP", "TEARDOWN"):
            return self._unit(kind)
        if inside in _VARIABLES or inside == "TYPE":
            return self._declaration()
        if inside == "CASE" and self._is_label(self._at):
            return self._label()
        if kind == "IDENT" and self._type(self._at + 1) == "_COLON":
            return self._plain(self._at + 2, LABEL)
        return self._plain(self._until("_SEMI"), STATEMENT)

    def _plain(self, end: int, kind: str) -> Line:
        return Line(self._at, end, self._level, self._level, kind)

    # ---- blocks ----

    def _push(self, keyword: str, level: int) -> None:
        self._blocks.append(_Block(keyword, level))

    def _closing(self, kind: str) -> Line:
        inner = self._level
        keyword = self._blocks.pop().keyword
        end, opens = self._at + 1, False
        if kind in ("_END_STRUCT", "_END_UNION"):
            end, opens = self._end_of_declaration(end)
        line = Line(self._at, end, self._level, inner, DECLARATION, opens, closes=inner > self._level)
        line.unit_ends = keyword in _UNITS and not self._is_inside_unit()
        return line

    def _branch(self, kind: str) -> Line:
        block, inner = self._block, self._level
        if kind == "_ELSE" and block.keyword == "CASE":
            block.labelled = False
        level = block.level - 1
        if kind == "_UNTIL":
            return Line(self._at, self._until("_SEMI", "_END_REPEAT"), level, inner, closes=True)
        end = self._after(_BRANCHES[kind])
        if kind == "_CATCH" and self._type(end) == "_LPAR":
            end = self._past_bracket(end)
        return Line(self._at, end, level, level, opens=True)

    def _opening(self, kind: str) -> Line:
        line = self._plain(self._after(_OPENERS[kind]), STATEMENT)
        line.opens = True
        self._push(kind, line.level + 1)
        return line

    def _unit(self, kind: str) -> Line:
        level = self._level
        end = self._special[kind]() if kind in self._special else self._at + 1
        declares = kind not in _STEPS and kind != "ACTION"
        line = Line(self._at, end, level, level, DECLARATION if declares else LABEL)
        line.unit_begins = kind in _UNITS and not self._is_inside_unit()
        line.opens = kind not in _MARGIN
        self._push(kind, level + line.opens)
        return line

    def _is_inside_unit(self) -> bool:
        """True below a unit that is no namespace."""
        return any(block.keyword not in ("", "NAMESPACE") for block in self._blocks)

    # ---- declarations ----

    def _declaration(self) -> Line:
        line = self._plain(self._at, DECLARATION)
        line.end, line.opens = self._end_of_declaration(self._at)
        return line

    def _end_of_declaration(self, at: int) -> tuple[int, bool]:
        """The end of a line of a declaration that goes on at `at`; True if a structure begins there."""
        depth, colon = 0, False
        while True:
            kind = self._type(at)
            depth += (kind in _OPENING) - (kind in _CLOSING)
            if kind == "_SEMI" and depth == 0:
                return at + 1, False
            if kind in _STRUCTURES:
                self._push(kind, self._level + 1)
                return at + 1 + (self._type(at + 1) == "OVERLAP"), True
            if at > self._at and depth == 0 and self._is_next_type(at, colon):
                return at, False
            colon = colon or (kind == "_COLON" and depth == 0)
            at += 1

    def _is_next_type(self, at: int, colon: bool) -> bool:
        """True where another type begins after one without a semicolon."""
        if self._block.keyword != "TYPE":
            return False
        kind = self._type(at)
        if kind == "_END_TYPE":
            return True
        is_closing = self._type(self._at) in ("_END_STRUCT", "_END_UNION")
        if kind == "MODIFIER":
            return colon or is_closing
        return kind == "IDENT" and (colon or is_closing) and self._type(at + 1) in ("_COLON", "_EXTENDS")

    def _names(self) -> int:
        """The end of `PROGRAM Main`, `FUNCTION_BLOCK F EXTENDS a.b IMPLEMENTS c, d`."""
        at = self._past(self._at + 1, "MODIFIER")
        at = self._past_name(at)
        while self._type(at) in ("_EXTENDS", "_IMPLEMENTS", "_COMMA"):
            at = self._past_name(at + 1)
        return at

    def _typed(self) -> int:
        """The end of `FUNCTION f : ARRAY[1..3] OF INT`."""
        at = self._past(self._at + 1, "MODIFIER") + 1
        return self._past_type(at + 1) if self._type(at) == "_COLON" else at

    def _past_type(self, at: int) -> int:
        while True:
            kind = self._type(at)
            if kind == "ARRAY":
                at = self._past_bracket(at + 1) + 1
            elif kind in ("POINTER", "REFERENCE"):
                at += 2
            elif kind == "REF_TO":
                at += 1
            else:
                break
        if kind == "_LPAR":
            at = self._past_bracket(at)
            return at + (self._type(at) == "IDENT")
        at = self._past_name(at)
        return self._past_bracket(at) if self._type(at) in _OPENING else at

    def _qualifiers(self) -> int:
        return self._past(self._at + 1, "QUALIFIER", "MODIFIER")

    def _with_colon(self) -> int:
        return self._at + 2 + (self._type(self._at + 2) == "_COLON")

    # ---- labels ----

    def _label(self) -> Line:
        line = Line(self._at, self._until("_COLON"), self._block.level, self._block.level, LABEL)
        self._block.labelled = True
        statement = self._short_statement(line.end)
        line.end, line.opens = statement or line.end, not statement
        return line

    def _is_label(self, at: int) -> bool:
        depth = 0
        while True:
            kind = self._type(at)
            depth += (kind in _OPENING) - (kind in _CLOSING)
            if depth == 0 and kind in ("_SEMI", "_ASSIGN", "_COLON"):
                return kind == "_COLON"
            if kind in _OPENERS or kind in _BRANCHES or kind.startswith("_END_") or kind == END:
                return False
            at += 1

    def _short_statement(self, at: int) -> int:
        """The end of the statement after a label, if it is on the same line, has no block and is the only one of its
        branch; else 0."""
        item = self._items[at]
        if item.has_line_break or item.before or item.type in _OPENERS or item.type in _BRANCHES:
            return 0
        if item.type.startswith("_END_") or self._is_label(at):
            return 0
        after = self._with_semicolons(self._until("_SEMI", start=at))
        return after if self._type(after) in ("_ELSE", "_END_CASE") or self._is_label(after) else 0

    # ---- steps over tokens ----

    def _past(self, at: int, *kinds: str) -> int:
        while self._type(at) in kinds:
            at += 1
        return at

    def _past_name(self, at: int) -> int:
        at += 1
        while self._type(at) == "_DOT":
            at += 2
        return at

    def _past_bracket(self, at: int) -> int:
        """The index past what the bracket at `at` encloses."""
        depth = 0
        while True:
            depth += (self._type(at) in _OPENING) - (self._type(at) in _CLOSING)
            at += 1
            if depth == 0:
                return at

    def _after(self, keyword: str) -> int:
        """The end of the head of a statement that `keyword` ends."""
        return self._until(keyword) if keyword else self._at + 1

    def _until(self, last: str, before: str = "", start: int | None = None) -> int:
        """The index past the next `last`, or of the next `before`, outside of brackets."""
        depth, at = 0, self._at if start is None else start
        while True:
            kind = self._type(at)
            depth += (kind in _OPENING) - (kind in _CLOSING)
            if depth == 0 and kind == last:
                return at + 1
            if kind in (before, END):
                return at
            at += 1

    def _with_semicolons(self, at: int) -> int:
        """The index past semicolons that follow without a comment."""
        while self._type(at) == "_SEMI" and not self._items[at].before:
            at += 1
        return at


def split(items: Sequence[Item]) -> list[Line]:
    """The lines of a program, in order."""
    return list(_Splitter(items).lines())
