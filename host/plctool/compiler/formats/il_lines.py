"""Instruction List: the lines of a body as instructions.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from plctool.compiler.formats.plcopen_body import NotTranslatedError
from plctool.compiler.formats.text import Chunk, Place

OPERATORS = {
    "AND": "AND", "&": "AND", "OR": "OR", "XOR": "XOR", "ADD": "+", "SUB": "-", "MUL": "*", "DIV": "/", "MOD": "MOD",
    "GT": ">", "GE": ">=", "EQ": "=", "NE": "<>", "LE": "<=", "LT": "<",
}  # fmt: skip
"""Operators with two operands, and their signs in Structured Text."""

NEGATING = {f"{name}N": name for name in ("AND", "&", "OR", "XOR")}
LOADS, STORES, BITS = ("LD", "LDN"), ("ST", "STN"), ("S", "R")
JUMPS, CALLS, RETURNS = ("JMP", "JMPC", "JMPCN"), ("CAL", "CALC", "CALCN"), ("RET", "RETC", "RETCN")
INPUTS = ("S1", "R1", "CLK", "CU", "CD", "IN")
"""Inputs of standard blocks that are operators, which call the block."""

PRESETS = ("PV", "PT")
"""Inputs that are operators, which only set them."""

_NO_OPERAND = ("NOT", *RETURNS)
_WITH_OPERAND = (*LOADS, *STORES, *BITS, *JUMPS, *CALLS, *OPERATORS, *NEGATING)
_LINE = re.compile(r"\s*(?:(?P<label>[^\W\d]\w*)[ \t]*:(?!=))?[ \t]*(?P<word>[^\W\d][\w.]*|&N?|\))?[ \t]*(?P<rest>.*)")
_STRINGS = re.compile(r"'(?:[^'$\n]|\$[^\n])*'?|\"(?:[^\"$\n]|\$[^\n])*\"?")
_LINES = 500  # of one call at most
_STATEMENTS = ("IF", "FOR", "WHILE", "REPEAT", "CASE", "RETURN", "EXIT", "CONTINUE")


class Origin:
    """The text of a body and where each character of it stands in the file."""

    def __init__(self, chunks: Sequence[Chunk]) -> None:
        self.text = "".join(chunk.text for chunk in chunks)
        self._chunks = [chunk for chunk in chunks if chunk.text] or [Chunk(" ", 1, 1)]
        self._starts: list[int] = []
        at = 0
        for chunk in self._chunks:
            self._starts.append(at)
            at += len(chunk.text)

    def place(self, offset: int) -> Place:
        """Where a character stands."""
        number = max(0, bisect_right(self._starts, offset) - 1)
        chunk = self._chunks[number]
        before = chunk.text[: offset - self._starts[number]]
        lines = before.count("\n")
        column = len(before) - before.rfind("\n") if lines else chunk.column + len(before)
        return Place(chunk.line + lines, column)

    def chunk(self, start: int, end: int) -> Chunk:
        """A part of the text."""
        return Chunk(self.text[start:end], *self.place(start))


@dataclass
class Instruction:
    """A line: `label: word operand`. `start` and `end` are the offsets of the operand, which may be empty. `nested`:
    the operand begins what is in brackets up to a `)`. `named`: the operand is `(name := value, ...)`."""

    at: int
    word: str
    start: int
    end: int
    label: str = ""
    label_at: int = 0
    nested: bool = False
    named: bool = False

    @property
    def has_operand(self) -> bool:
        """True if there is one."""
        return self.start < self.end


def instructions(origin: Origin, plain: str) -> list[Instruction]:
    """The instructions of a body. `plain`: its text with blanks for comments. Raises NotTranslatedError."""
    return _Reader(origin, plain).read()


class _Reader:
    def __init__(self, origin: Origin, plain: str) -> None:
        self._origin = origin
        self._plain = plain
        self._at = 0  # the beginning of the next line

    def read(self) -> list[Instruction]:
        """All instructions."""
        found: list[Instruction] = []
        while self._at < len(self._plain):
            start, end = self._next_line()
            match = _LINE.fullmatch(self._plain, start, end)
            assert match is not None
            if match["label"] or match["word"] or match["rest"]:
                found.append(self._instruction(match))
        return found

    def _next_line(self) -> tuple[int, int]:
        """Begin and end of the next line, without blanks and a semicolon at its end."""
        start, end = self._at, self._plain.find("\n", self._at)
        end = len(self._plain) if end < 0 else end
        self._at = end + 1
        line = self._plain[start:end].rstrip()
        return start, start + len(line.removesuffix(";").rstrip())

    def _instruction(self, match: re.Match[str]) -> Instruction:
        label, word = match["label"] or "", (match["word"] or "").upper()
        start, end = match.span("rest")
        found = Instruction(match.start("word"), word, start, end, label, match.start("label"))
        if not word:
            found.at = found.label_at
            if start < end:
                raise self._error(start, f"{self._plain[start:end]} is not an instruction; write an operator before it")
            return found
        if word in _STATEMENTS or match["rest"].startswith((":=", "[", "^")):
            raise self._error(found.at, "a list of instructions has no statements of Structured Text; write LD x, ST y")
        self._operand(found)
        return found

    def _operand(self, found: Instruction) -> None:
        """Takes the lines of an operand, and checks whether there is to be one."""
        word = found.word
        if word == ")":
            if found.has_operand:
                raise self._error(found.start, "nothing follows a ) in its line; write the next instruction below")
            return
        if found.has_operand:
            self._brackets(found)
        if word in _NO_OPERAND and found.has_operand:
            what = "negates the result, and has no operand; write LDN or ANDN" if word == "NOT" else "has no operand"
            raise self._error(found.start, f"{word} {what}")
        if word in (*_WITH_OPERAND, *INPUTS, *PRESETS) and not (found.has_operand or found.nested):
            raise self._error(found.at, f"{word} needs an operand; write {word} and a name")

    def _brackets(self, found: Instruction) -> None:
        """Finds out what a bracket at the beginning of an operand, or open at the end of its line, means."""
        opens = self._plain.startswith("(", found.start)
        if opens and found.word in (*OPERATORS, *NEGATING) and self._depth(found):
            found.nested = True
            found.start = found.end - len(self._plain[found.start + 1 : found.end].lstrip())
            return
        lines = 1
        while lines < _LINES and self._at < len(self._plain) and self._continues(found):
            found.end = self._next_line()[1]
            lines += 1
        if self._depth(found):
            raise self._error(found.start, "the brackets of this operand are not closed; write ) at its end")
        if opens and found.word not in (*_WITH_OPERAND, *INPUTS, *PRESETS) and self._is_whole(found):
            found.named = bool(re.search(r":=|=>", self._without_strings(found)))
            if not found.named:
                operands = self._plain[found.start + 1 : found.end - 1].strip()
                name = self._plain[found.at : found.at + len(found.word)]
                raise self._error(found.at, f"a call with operands has no brackets; write LD, then {name} {operands}")

    def _continues(self, found: Instruction) -> bool:
        """Whether the operand goes on in the next line."""
        return self._depth(found) > 0 or self._plain.endswith(",", found.start, found.end)

    def _without_strings(self, found: Instruction) -> str:
        return _STRINGS.sub(lambda m: " " * len(m[0]), self._plain[found.start : found.end])

    def _depth(self, found: Instruction) -> int:
        """How many brackets of the operand are still open."""
        text = self._without_strings(found)
        return text.count("(") - text.count(")")

    def _is_whole(self, found: Instruction) -> bool:
        """Whether the first bracket is closed by the last character."""
        depth, text = 0, self._without_strings(found)
        for at, character in enumerate(text):
            depth += (character == "(") - (character == ")")
            if depth == 0:
                return at == len(text) - 1
        return False

    def _error(self, offset: int, message: str) -> NotTranslatedError:
        return NotTranslatedError(self._origin.place(offset), message)
