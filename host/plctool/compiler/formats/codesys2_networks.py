"""Exports of CODESYS 2.3: bodies in LD and FBD (_LD_BODY, _FBD_BODY), one word or operand in each line.

    _NETWORK                      the line after it is a label, or empty
    _COMMENT '...' _END_COMMENT
    _ASSIGN box _EXPRESSION sign _OUTPUTS : n, n times: _OUTPUT sign, _SET or _NO_SET, variable
    _LD_ASSIGN rung _EXPRESSION sign ENABLELIST : n, n statements with _ENABLED, ENABLELIST_END _OUTPUTS : n ...

A box is _FUNCTIONBLOCK, instance, _BOX_EXPR : n, n inputs, _EXPRESSION, sign, type, _OUTPUTS : n with the outputs
after the first; or _OPERATOR or _FUNCTION without instance and outputs. An operand is _OPERAND _EXPRESSION sign text; a
rung is made of _LD_AND, _LD_OR (_LD_OPERATOR : n) and _LD_CONTACT. The vendor does not describe this; it was seen in
programs that write such files. Every other word is refused by name.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from plctool.compiler.formats.network_trees import (
    Assignment,
    Box,
    Branch,
    Definition,
    Elements,
    Operand,
    Output,
    Rail,
    Target,
    Tree,
    TreeNetwork,
)
from plctool.compiler.formats.plcopen_body import NotTranslatedError
from plctool.compiler.formats.text import Place

Parameters = Callable[[str], tuple[tuple[str, ...], tuple[str, ...]]]
"""Inputs and outputs of a type, in order; () for an unknown one."""

_COUNTED = re.compile(r"(_?[A-Z_]+) ?: ?(\d{1,5});?")
_SIGNS = {"_POSITIV": False, "_NEGATIV": True}
_STORED = {"_NO_SET": False, "_SET": True}
_GATES = {"_LD_AND": "AND", "_LD_OR": "OR"}
_CALLS = frozenset(("_OPERATOR", "_FUNCTION", "_FUNCTIONBLOCK"))
_OPEN = "???"
_RUNG = "rung"  # the branch that boxes after a rung take


class Line(NamedTuple):
    """A line without blanks around it."""

    text: str
    at: Place


def read_networks(
    language: str, lines: Sequence[Line], parameters: Parameters, *, contacts: bool = False, first: int = 1
) -> Elements:
    """Returns the networks in the lines after _LD_BODY or _FBD_BODY. `contacts`, `first`: as in Elements. Raises
    NotTranslatedError."""
    reader = _Reader(lines, parameters)
    made = Elements(language, lines[0].at if lines else Place(1, 1), contacts, first)
    reader.skip_count("_NETWORKS")
    try:
        while reader.more:
            made.add(reader.network())
    except RecursionError:
        raise NotTranslatedError(made.at, "it is too deep") from None
    return made


class _Reader:
    def __init__(self, lines: Sequence[Line], parameters: Parameters) -> None:
        self._lines = lines
        self._at = 0
        self._parameters = parameters
        self._skip_blank()

    @property
    def more(self) -> bool:
        """True until the end."""
        return self._at < len(self._lines)

    def _skip_blank(self) -> None:
        while self.more and not self._lines[self._at].text:
            self._at += 1

    @property
    def _here(self) -> Place:
        return self._lines[min(self._at, len(self._lines) - 1)].at

    def _peek(self) -> str:
        return self._lines[self._at].text if self.more else ""

    def _next(self) -> Line:
        if not self.more:
            raise NotTranslatedError(self._here, "it ends within a network")
        line = self._lines[self._at]
        self._at += 1
        self._skip_blank()
        return line

    def _expect(self, word: str) -> None:
        line = self._next()
        if line.text != word:
            raise NotTranslatedError(line.at, f"it has {line.text[:40]} where {word} is known")

    def _sign(self) -> bool:
        """True for a negation."""
        line = self._next()
        if line.text not in _SIGNS:
            raise NotTranslatedError(line.at, f"it has {line.text[:40]}, which is not known")
        return _SIGNS[line.text]

    def _end(self) -> bool:
        self._expect("_EXPRESSION")
        return self._sign()

    def _count(self, word: str) -> int:
        line = self._next()
        found = _COUNTED.fullmatch(line.text)
        if found is None or found[1] != word:
            raise NotTranslatedError(line.at, f"it has {line.text[:40]} where {word} is known")
        return int(found[2])

    def skip_count(self, word: str) -> None:
        """Passes over a count that says nothing new."""
        if self._peek().startswith(word):
            self._count(word)

    # ---- networks ----

    def network(self) -> TreeNetwork:
        """The next network."""
        at = self._here
        self._expect("_NETWORK")
        label = "" if self._peek().startswith("_") or not self.more else self._next().text
        if self._peek() == "_COMMENT":
            while self._next().text != "_END_COMMENT":
                pass
        items: list[Assignment | Definition | Box] = []
        while self.more and self._peek() != "_NETWORK":
            items += self._statement()
        return TreeNetwork(label, at, tuple(items))

    def _statement(self) -> list[Assignment | Definition | Box]:
        line = self._lines[self._at]
        if line.text == "_EMPTY":
            self._next()
            return []
        if line.text in _CALLS:
            return [self._box(None)]
        if line.text == "_ASSIGN":
            return [self._assignment(None)]
        if line.text == "_LD_ASSIGN":
            return self._rung()
        raise NotTranslatedError(line.at, f"it has {line.text[:40]}, which is not known")

    def _assignment(self, enable: Tree | None) -> Assignment | Box:
        at = self._next().at
        value = self._value(enable)
        if self._end():
            value = _negated(value, at)
        targets = self._targets()
        return Assignment(value, targets, at) if enable is None else _enabled(value, targets, at)

    def _rung(self) -> list[Assignment | Definition | Box]:
        at = self._next().at
        value = self._contacts()
        if self._end():
            value = _negated(value, at) or value
        found: list[Assignment | Definition | Box] = []
        enabled = self._count("ENABLELIST") if self._peek().startswith("ENABLELIST") else 0
        if enabled:
            found.append(Definition(_RUNG, value))
            value = Branch(_RUNG, at)
        for _ in range(enabled):
            found.append(self._assignment(value) if self._peek() == "_ASSIGN" else self._box(value))
        if self._peek() == "ENABLELIST_END":
            self._next()
        targets = self._targets()
        return [*found, Assignment(value, targets, at)] if targets else found

    def _targets(self) -> tuple[Target, ...]:
        return tuple(self._target() for _ in range(self._count("_OUTPUTS")))

    def _target(self) -> Target:
        self._expect("_OUTPUT")
        negated, line = self._sign(), self._next()
        if line.text not in _STORED:
            raise NotTranslatedError(line.at, f"an output has {line.text[:40]}, which is not known")
        name = self._next()
        if name.text in (_OPEN, "_EMPTY") or not name.text:
            raise NotTranslatedError(name.at, "a coil or output has no variable")
        if _STORED[line.text]:
            return Target(name.text, name.at, storage="reset" if negated else "set")
        return Target(name.text, name.at, negated)

    # ---- values ----

    def _contacts(self) -> Tree:
        line = self._next()
        if line.text == "_EMPTY":
            return Rail(line.at)
        if line.text == "_LD_CONTACT":
            name = self._next()
            if name.text == _OPEN:
                raise NotTranslatedError(name.at, f"an operand is missing ({_OPEN})")
            return Operand(name.text, name.at, self._end())
        if line.text not in _GATES:
            raise NotTranslatedError(line.at, f"a rung has {line.text[:40]}, which is not known")
        values = [self._contacts() for _ in range(self._count("_LD_OPERATOR"))]
        negated = self._end()
        inputs = tuple((f"IN{n + 1}", v) for n, v in enumerate(values))
        return Box(_GATES[line.text], line.at, inputs, (Output("", "", "BOOL"),), negated=negated)

    def _value(self, enable: Tree | None) -> Tree | None:
        line = self._lines[self._at] if self.more else Line("", self._here)
        if line.text in _CALLS:
            return self._box(enable)
        self._next()
        if line.text == "_EMPTY":
            return None
        if line.text != "_OPERAND":
            raise NotTranslatedError(line.at, f"it has {line.text[:40]}, which is not known")
        negated, text = self._end(), self._next()
        return None if text.text == _OPEN else Operand(text.text, text.at, negated)

    def _box(self, enable: Tree | None) -> Box:
        word = self._next()
        is_block = word.text == "_FUNCTIONBLOCK"
        if not is_block and word.text not in _CALLS:
            raise NotTranslatedError(word.at, f"it has {word.text[:40]}, which is not known")
        instance = self._next().text if is_block else ""
        count = self._count("_BOX_EXPR")
        inputs: list[tuple[str, Tree | None]] = [] if enable is None else [("EN", enable)]
        if (self._peek() == "_ENABLED") != (enable is not None):
            raise NotTranslatedError(word.at, "a box with EN stands outside of a rung, or one without EN in it")
        if enable is not None:
            self._next()
        values = [self._value(None) for _ in range(count)]
        negated, kind = self._end(), self._next()
        if not is_block:
            return _function(kind, inputs, values, negated=negated)
        names, outputs = self._parameters(kind.text)
        if len(values) > len(names):
            more = "is not declared in this file" if not names else f"has only {len(names)} inputs"
            raise NotTranslatedError(kind.at, f"{kind.text} {more}")
        inputs += [(name, value) for name, value in zip(names, values, strict=False)]
        others = self._others() if self._peek().startswith("_OUTPUTS") else []
        if len(others) > max(0, len(outputs) - 1):
            raise NotTranslatedError(kind.at, f"{kind.text} has only {len(outputs)} outputs")
        targets = ["", *others]
        made = tuple(Output(n, targets[i] if i < len(targets) else "") for i, n in enumerate(outputs))
        return Box(kind.text, kind.at, tuple(inputs), made, instance, negated)

    def _others(self) -> list[str]:
        """The variables of the outputs after the first; "" for none."""
        found = []
        for _ in range(self._count("_OUTPUTS")):
            self._expect("_OUTPUT")
            line = self._lines[min(self._at, len(self._lines) - 1)]
            if self._sign() or self._next().text != "_NO_SET":
                raise NotTranslatedError(line.at, "an output of a block is negated or set, which is not known")
            name = self._next().text
            found.append("" if name in (_OPEN, "_EMPTY") else name)
        return found


def _function(kind: Line, inputs: list[tuple[str, Tree | None]], values: list[Tree | None], *, negated: bool) -> Box:
    if any(value is None for value in values):
        raise NotTranslatedError(kind.at, f"an input of {kind.text} is connected to nothing")
    named = [*inputs, *((f"IN{n + 1}", value) for n, value in enumerate(values))]
    return Box(kind.text, kind.at, tuple(named), (Output(""),), negated=negated)


def _enabled(value: Tree | None, targets: tuple[Target, ...], at: Place) -> Box:
    """A box after a rung with the variable that it writes, only while the rung is TRUE."""
    plain = len(targets) == 1 and not (targets[0].negated or targets[0].storage)
    if not isinstance(value, Box) or not value.outputs or not plain:
        raise NotTranslatedError(at, "what stands after a rung is not a box with one variable at its output")
    first, *others = value.outputs
    return replace(value, outputs=(first._replace(target=targets[0].text), *others))


def _negated(value: Tree | None, at: Place) -> Tree | None:
    return None if value is None else Box("NOT", at, (("IN", value),), (Output("", "", "BOOL"),))
