"""Instruction List (IL): bodies as statements.

The accumulator is an expression that grows until an instruction needs it twice; then it is a `Temp`, which gets its
type when the program is checked. Where a label is reached with a result, all that lead there assign it to one variable.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from plctool.compiler.formats.il_lines import (
    BITS,
    CALLS,
    INPUTS,
    JUMPS,
    LOADS,
    NEGATING,
    OPERATORS,
    PRESETS,
    RETURNS,
    STORES,
    Instruction,
    Origin,
    instructions,
)
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError
from plctool.compiler.formats.text import Chunk, Listing, Part, Place
from plctool.compiler.syntax.plain_text import plain_text
from plctool.records import dataclass

_SIMPLE = re.compile(r"[\w.#%$]+")
_CALL = re.compile(r"\w\s*\(")
_LONG = 40  # operators in one expression; what is longer is computed in parts
_DEFINES = frozenset(LOADS)
_USES = frozenset((*STORES, *BITS, *INPUTS, *PRESETS, *OPERATORS, *NEGATING, "NOT", ")"))
_CONDITIONAL = frozenset(("JMPC", "JMPCN", "CALC", "CALCN", "RETC", "RETCN"))


@dataclass
class _Value:
    """An expression. `kept`: it is a variable that nothing changes, or a constant."""

    parts: list[Part]
    at: Place
    length: int = 1
    kept: bool = False


@dataclass
class _Bracket:
    """An operator whose right operand is in brackets. `left`: what it is applied to."""

    opening: Instruction
    left: _Value


def translate(chunks: Sequence[Chunk], body: Body, plain: str | None = None) -> None:
    """Adds the statements of a list of instructions. `plain`: the text with blanks for comments, where these do not
    nest. Raises NotTranslatedError."""
    origin = Origin(chunks)
    lines = instructions(origin, plain_text(origin.text, strings=True) if plain is None else plain)
    body.parts.append(Listing(origin.text))
    _List(origin, lines, body).translate()


class _List:
    def __init__(self, origin: Origin, lines: list[Instruction], body: Body) -> None:
        self._origin = origin
        self._lines = lines
        self._body = body
        self._labels = {line.label.casefold(): number for number, line in enumerate(lines) if line.label}
        self._needed = self._liveness()
        self._value: _Value | None = None
        self._reached = True
        self._brackets: list[_Bracket] = []
        self._temps = 0

    def translate(self) -> None:
        """Adds the statements."""
        for number, line in enumerate(self._lines):
            if line.label:
                self._label(number, line)
            if line.word:
                self._instruction(line, needed=self._needed[number + 1])
        if self._brackets:
            raise self._error(self._brackets[-1].opening, "this ( is not closed; write ) on a line of its own")

    # ---- which instructions need the result of those before ----

    def _liveness(self) -> list[bool]:
        """For each instruction whether it, or what follows it, needs the result before it; and False at the end."""
        needed = [False] * (len(self._lines) + 1)
        changed = True
        while changed:
            changed = False
            for number in range(len(self._lines) - 1, -1, -1):
                now = self._needs(number, self._lines[number], needed)
                changed = changed or now != needed[number]
                needed[number] = now
        return needed

    def _needs(self, number: int, line: Instruction, needed: list[bool]) -> bool:
        word = line.word
        if word in _DEFINES or word == "RET" or line.named:
            return False
        if word in _USES or word in _CONDITIONAL or self._is_function(word):
            return True
        if word == "JMP":
            return needed[self._target(line)]
        return needed[number + 1]

    @staticmethod
    def _is_function(word: str) -> bool:
        known = (*LOADS, *STORES, *BITS, *JUMPS, *CALLS, *RETURNS, *INPUTS, *PRESETS, *OPERATORS, *NEGATING, "NOT", ")")
        return bool(word) and word not in known

    def _target(self, line: Instruction) -> int:
        """The number of the instruction at a label; the end, if there is none: the compiler reports that."""
        return self._labels.get(self._text(line).casefold(), len(self._lines))

    # ---- labels and brackets ----

    def _label(self, number: int, line: Instruction) -> None:
        place = self._origin.place(line.label_at)
        if self._brackets:
            raise NotTranslatedError(place, "a label cannot be in brackets; write it before the instruction with the (")
        if self._labels[line.label.casefold()] == number and self._needed[number]:
            if self._reached or self._value is not None:
                self._join(line.label, self._result(line, f"the instructions at {line.label}"), place)
            self._value = _Value([(f"@@{line.label.casefold()}", place)], place, kept=True)
        else:
            self._value = None
        self._reached = True
        self._body.parts += [self._origin.chunk(line.label_at, line.label_at + len(line.label)), (":\n", place)]

    def _join(self, label: str, value: _Value, at: Place) -> None:
        """Assigns the result with which a label is reached."""
        self._body.parts += [(f"@@{label.casefold()} := ", at), *value.parts, (";\n", at)]

    def _open(self, line: Instruction) -> None:
        self._brackets.append(_Bracket(line, self._result(line, line.word)))
        self._value = self._operand(line) if line.has_operand else None

    def _close(self, line: Instruction) -> None:
        if not self._brackets:
            raise self._error(line, "there is no ( before this )")
        right, bracket = self._result(line, "the )"), self._brackets.pop()
        self._combine(bracket.opening, bracket.left, right)

    # ---- instructions ----

    def _instruction(self, line: Instruction, *, needed: bool) -> None:
        word = line.word
        if word in LOADS:
            self._value = self._operand(line)
            if word == "LDN":
                self._value = self._negated(self._value)
        elif word == "NOT":
            self._value = self._negated(self._result(line, word))
        elif word == ")":
            self._close(line)
        elif line.nested:
            self._open(line)
        elif word in OPERATORS or word in NEGATING:
            self._combine(line, self._result(line, word), self._operand(line))
        elif self._is_function(word):
            self._call_function(line, needed=needed)
        else:
            self._act(line, needed=needed)

    def _act(self, line: Instruction, *, needed: bool) -> None:
        """Adds the statement of an instruction that changes something or leads elsewhere."""
        word, at, operand = line.word, self._origin.place(line.at), self._parts(line)
        for bracket in self._brackets:
            bracket.left = self._kept(bracket.left)
        if needed and self._value is not None:
            self._value = self._kept(self._value)
        if word in JUMPS or word in RETURNS:
            self._leave(line)
        elif word in CALLS:
            called = operand if self._text(line).endswith(")") else [*operand, ("()", at)]
            self._guarded(line, [*called, (";", at)])
        elif word in INPUTS:
            self._line([*operand, (f"({word} := ", at), *self._result(line, word).parts, (");\n", at)])
        elif word in PRESETS:
            self._line([*operand, (f".{word} := ", at), *self._result(line, word).parts, (";\n", at)])
        elif word in BITS:
            stored = "TRUE" if word == "S" else "FALSE"
            condition = self._result(line, word).parts
            self._line([("IF ", at), *condition, (" THEN ", at), *operand, (f" := {stored}; END_IF;\n", at)])
        else:
            value = self._result(line, word)
            value = self._negated(value) if word == "STN" else value
            self._line([*operand, (" := ", at), *value.parts, (";\n", at)])

    def _leave(self, line: Instruction) -> None:
        """JMP and RET."""
        if self._brackets:
            raise self._error(line, f"{line.word} cannot be in brackets; write it after the )")
        at = self._origin.place(line.at)
        leave: list[Part] = [("RETURN;", at)]
        if line.word in JUMPS:
            leave = [("JMP ", at), *self._parts(line), (";", at)]
            if self._needed[self._target(line)]:
                self._value = self._kept(self._result(line, line.word))
                label: list[Part] = [(f"@@{self._text(line).casefold()} := ", at), *self._value.parts, ("; ", at)]
                leave = [*label, *leave]
        self._guarded(line, leave)
        if line.word in ("JMP", "RET"):
            self._reached, self._value = False, None

    def _guarded(self, line: Instruction, statement: list[Part]) -> None:
        """Adds a statement, for C and CN under the condition that the result is TRUE or FALSE."""
        at = self._origin.place(line.at)
        if line.word in _CONDITIONAL:
            condition = self._result(line, line.word)
            condition = self._negated(condition) if line.word.endswith("N") else condition
            statement = [("IF ", at), *condition.parts, (" THEN ", at), *statement, (" END_IF;", at)]
        self._line([*statement, ("\n", at)])

    def _call_function(self, line: Instruction, *, needed: bool) -> None:
        at = self._origin.place(line.at)
        name = self._origin.chunk(line.at, line.at + len(line.word))
        if line.named:
            call: list[Part] = [name, *self._parts(line)]
        else:
            first = self._result(line, name.text)
            more: list[Part] = [(", ", at), *self._parts(line)] if line.has_operand else []
            call = [name, ("(", at), *first.parts, *more, (")", at)]
        self._value = _Value(call, at)
        if not needed:
            self._line([*call, (";\n", at)])
            self._value = None

    def _combine(self, line: Instruction, left: _Value, right: _Value) -> None:
        at, word = self._origin.place(line.at), line.word
        if word in NEGATING:
            word, right = NEGATING[word], self._negated(right)
        parts: list[Part] = [("(", at), *left.parts, (f" {OPERATORS[word]} ", at), *right.parts, (")", at)]
        self._value = _Value(parts, at, left.length + right.length)
        if self._value.length > _LONG:
            self._value = self._kept(self._value)

    # ---- values ----

    def _result(self, line: Instruction, what: str) -> _Value:
        if self._value is None:
            raise self._error(line, f"{what} needs a result, and nothing is loaded here; begin with LD")
        return self._value

    def _operand(self, line: Instruction) -> _Value:
        text, at = self._text(line), self._origin.place(line.at)
        parts = self._parts(line)
        if not _SIMPLE.fullmatch(text):
            parts = [("(", at), *parts, (")", at)]
        return _Value(parts, at)

    @staticmethod
    def _negated(value: _Value) -> _Value:
        return _Value([("(NOT ", value.at), *value.parts, (")", value.at)], value.at, value.length + 1)

    def _kept(self, value: _Value) -> _Value:
        """The value as one that stays while variables change."""
        if value.kept:
            return value
        self._temps += 1
        name = f"@t{self._temps}"
        self._line([(f"{name} := ", value.at), *value.parts, (";\n", value.at)])
        return _Value([(name, value.at)], value.at, kept=True)

    def _text(self, line: Instruction) -> str:
        return self._origin.text[line.start : line.end]

    def _parts(self, line: Instruction) -> list[Part]:
        return [self._origin.chunk(line.start, line.end)]

    def _line(self, parts: list[Part]) -> None:
        self._body.parts += parts

    def _error(self, line: Instruction, message: str) -> NotTranslatedError:
        return NotTranslatedError(self._origin.place(line.at), message)
