"""The outline of a Structured Text: its units, what they are made of, and the text of each part.

Every character between two parts, such as a comment or an attribute, belongs to the part that follows it. The parser
says which word is a keyword where it stands.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.attributes import Attributes
from plctool.compiler.syntax.lexer import Token
from plctool.compiler.syntax.parser import parse_all

UNITS = frozenset(("FUNCTION", "FUNCTION_BLOCK", "PROGRAM", "INTERFACE"))
_MEMBERS = frozenset(("METHOD", "PROPERTY", "PROPERTY_GET", "PROPERTY_SET", "ACTION"))
_VARIABLES = frozenset(("VAR", "GLOBAL", "CONFIG", "ACCESS"))
_OTHERS = frozenset(("TYPE", "CONFIGURATION", "CLASS", "NAMESPACE", "TEST", "SETUP", "TEARDOWN"))
_CHART = frozenset(("INITIAL_STEP", "STEP", "TRANSITION"))
_ACCESSORS = frozenset(("GET", "SET"))
_OPENINGS = UNITS | _MEMBERS | _VARIABLES | _OTHERS | _CHART | _ACCESSORS | {"STRUCT", "UNION"}
_ENDS = {
    **dict.fromkeys(_VARIABLES, "_END_VAR"),
    **dict.fromkeys(("PROPERTY_GET", "PROPERTY_SET"), "_END_PROPERTY"),
    "INITIAL_STEP": "_END_STEP",
}


@dataclass
class Part:
    """A unit, a member of one, a section of variables, a step ...: `tokens` from its keyword to its end, `gap` what
    stands before it, `text` both. The rest is for what holds parts: its declaration (`head`, with the gap), sections of
    variables, members, the steps and transitions of a chart, and its statements (`body`), or the `instructions` that
    they were made of."""

    kind: str
    tokens: list[Token]
    gap: str
    text: str
    head: str = ""
    body: str = ""
    instructions: str = ""
    variables: list[Part] = field(default_factory=list)
    members: list[Part] = field(default_factory=list)
    chart: list[Part] = field(default_factory=list)

    @property
    def pos(self) -> int:
        """Offset of the keyword."""
        return self.tokens[0].pos

    @property
    def name(self) -> str:
        """Of a unit or member: the first name after its keyword."""
        return next((token.text for token in self.tokens[1:] if token.type == "IDENT"), "")

    @property
    def declaration(self) -> str:
        """All that stands before the statements."""
        return self.head + "".join(part.text for part in self.variables)


@dataclass(frozen=True)
class Outline:
    """`attributes`: by the offset of what they stand before; `rest`: what follows the last part."""

    parts: list[Part]
    attributes: Attributes
    rest: str


def outline(source: Source, declared: frozenset[str]) -> Outline:
    """The parts of a text without errors. `declared`: as in `parse_all`."""
    tokens: list[Token] = []
    parsed = parse_all(source, lambda *_: None, declared=declared, tokens=tokens)
    reader = _Reader(source, tokens)
    parts = reader.parts(len(tokens))
    return Outline(parts, parsed.attributes, source.text[reader.end :])


class _Reader:
    def __init__(self, source: Source, tokens: list[Token]) -> None:
        self._text = source.text
        self._lists = source.lists
        self._tokens = tokens
        self._at = 0
        self.end = 0  # of what was taken

    def parts(self, stop: int) -> list[Part]:
        """What stands before the token `stop`."""
        found: list[Part] = []
        while self._at < stop:
            token = self._tokens[self._at]
            if token.type in ("_SEMI", "$END"):
                self._at += 1
            else:
                found.append(self._part())
        return found

    def _part(self) -> Part:
        first = self._tokens[self._at]
        last = self._closing()
        tokens = self._tokens[self._at : last + 1]
        part = Part(first.type, tokens, self._text[self.end : first.pos], self._text[self.end : tokens[-1].end])
        if first.type in UNITS | _MEMBERS | _ACCESSORS:
            self._inside(part, last)
        self._at = last + 1
        self.end = tokens[-1].end
        return part

    def _closing(self) -> int:
        """The last token of what begins here."""
        first = self._tokens[self._at]
        if first.type == "USING":
            return next(i for i in range(self._at, len(self._tokens)) if self._tokens[i].type == "_SEMI")
        end, depth = _ENDS.get(first.type, f"_END_{first.type}"), 0
        for index in range(self._at, len(self._tokens)):
            kind = self._tokens[index].type
            if kind == end:
                depth -= 1
                if depth == 0:
                    return index
            elif kind in _OPENINGS and _ENDS.get(kind, f"_END_{kind}") == end and self._opens(index):
                depth += 1
        raise AssertionError(f"{first.text} is not closed")

    def _opens(self, index: int) -> bool:
        """Whether a token opens what ends by END_PROGRAM or the like: a PROGRAM in a CONFIGURATION does not."""
        return index == self._at or self._tokens[self._at].type == "NAMESPACE"

    def _inside(self, part: Part, last: int) -> None:
        """What a unit, or a member of one, is made of."""
        self._at += self._head(self._at)
        self.end = self._tokens[self._at - 1].end
        part.head = part.gap + self._text[part.pos : self.end]
        statements = ""
        while self._at < last:
            kind = self._tokens[self._at].type
            if kind in _VARIABLES:
                part.variables.append(self._part())
            elif kind in _MEMBERS | _ACCESSORS or kind == "USING":
                part.members.append(self._part())
            elif kind in _CHART:
                part.chart.append(self._part())
            else:
                statements += self._statements(last)
        part.body = statements + self._text[self.end : self._tokens[last].pos]
        inner = [(member.pos, member.tokens[-1].end) for member in part.members]
        for offset, instructions in self._lists:
            is_own = part.pos < offset <= self._tokens[last].pos
            if is_own and not any(begin <= offset <= end for begin, end in inner):
                part.instructions = instructions

    def _statements(self, last: int) -> str:
        start = self.end
        while self._at < last and self._tokens[self._at].type not in _MEMBERS | _ACCESSORS | _CHART | _VARIABLES:
            self._at += 1
        self.end = self._tokens[self._at - 1].end
        return self._text[start : self.end]

    def _head(self, start: int) -> int:
        """How many tokens declare a unit."""
        at = start + 1
        while self._kind(at) == "MODIFIER":
            at += 1
        if self._tokens[start].type in _ACCESSORS:
            return at - start
        at += 1  # the name
        while self._kind(at) in ("_EXTENDS", "_IMPLEMENTS"):
            at += 2
            while self._kind(at) in ("_DOT", "_COMMA"):
                at += 2
        if self._kind(at) == "_COLON":
            action = self._tokens[start].type == "ACTION"
            at = at + 1 if action else type_end(self._tokens, at + 1)
        if self._kind(at) == "_SEMI":
            at += 1
        return at - start

    def _kind(self, at: int) -> str:
        return self._tokens[at].type


def type_end(tokens: list[Token], at: int) -> int:
    """The index after the type that begins at one."""
    kind = tokens[at].type
    if kind == "ARRAY":
        return type_end(tokens, closed(tokens, at + 1) + 2)
    if kind in ("POINTER", "REFERENCE"):
        return type_end(tokens, at + 2)
    if kind == "REF_TO":
        return type_end(tokens, at + 1)
    if kind in ("STRUCT", "UNION"):
        depth = 0
        while True:
            depth += (tokens[at].type in ("STRUCT", "UNION")) - (tokens[at].type in ("_END_STRUCT", "_END_UNION"))
            at += 1
            if depth == 0:
                return at
    if kind == "_LPAR":  # an enumeration
        at = closed(tokens, at) + 1
        return at + (at < len(tokens) and tokens[at].type == "IDENT")
    at += 1
    while at < len(tokens) and tokens[at].type == "_DOT":
        at += 2
    if at < len(tokens) and tokens[at].type in ("_LPAR", "_LSQB"):
        at = closed(tokens, at) + 1
    return at


def closed(tokens: list[Token], at: int) -> int:
    """The index of the bracket that closes the one at an index."""
    depth = 0
    while True:
        depth += (tokens[at].type in ("_LPAR", "_LSQB")) - (tokens[at].type in ("_RPAR", "_RSQB"))
        if depth == 0:
            return at
        at += 1
