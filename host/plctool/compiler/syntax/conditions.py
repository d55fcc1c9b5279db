"""Conditional pragmas: {define NAME}, {undefine NAME}, {IF defined(NAME)}, {ELSIF ...}, {ELSE}, {END_IF}. In a
condition also defined(pou: NAME), (type: NAME), (variable: NAME): whether the program or the library declares it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from plctool.compiler.syntax.plain_text import NAME, plain_text, without_structures

_DIRECTIVE = re.compile(r"\{\s*(define|undefine|IF|ELSIF|ELSE|END_IF)\b(.*)\}", re.IGNORECASE | re.DOTALL)
_MISSPELT = re.compile(r"\{\s*(END\s?IF|FI|ELSE\s?IF|ELIF)\b(.*)\}", re.IGNORECASE | re.DOTALL)
_BEGINS = re.compile(r"\{\s*(?:define|undefine|IF)\b", re.IGNORECASE)
_DEFINE = re.compile(r"\s*([A-Za-z_]\w*)\s*(?:'.*')?\s*", re.DOTALL)
_TOKEN = re.compile(
    r"\s*(?:defined\s*\(\s*(?:(?P<kind>pou|type|variable)\s*:\s*)?(?P<name>"
    + NAME
    + r")\s*\)|(?P<word>AND|OR|NOT|\(|\)))",
    re.IGNORECASE | re.ASCII,
)
_ASKS = re.compile(r"\bdefined\s*\(\s*(?:pou|type|variable)\s*:", re.IGNORECASE)
_UNIT = re.compile(
    r"(?<!\.)\b(?:FUNCTION_BLOCK|FUNCTION|PROGRAM|INTERFACE|CLASS)\s+"
    rf"(?:(?:PUBLIC|PRIVATE|INTERNAL|ABSTRACT|FINAL)\s+)*({NAME})",
    re.IGNORECASE | re.ASCII,
)
_LITTLE_ENDIAN = "ISLITTLEENDIAN"  # CODESYS and TwinCAT define it so; here every processor is
_TYPES = re.compile(r"(?<!\.)\bTYPE\b(.*?)\bEND_TYPE\b", re.IGNORECASE | re.DOTALL)
_TYPE = re.compile(rf"({NAME})\s*(?::(?!=)|EXTENDS\b)", re.IGNORECASE | re.ASCII)
_GLOBALS = re.compile(r"\bVAR_GLOBAL\b(.*?)\bEND_VAR\b", re.IGNORECASE | re.DOTALL)
_VARIABLES = re.compile(rf"((?:{NAME}\s*,\s*)*{NAME})\s*(?:AT\s*%[\w.*]+\s*)?:(?!=)", re.IGNORECASE | re.ASCII)
_NAME = re.compile(NAME, re.ASCII)


def is_directive(pragma: str) -> bool:
    """True for a pragma that belongs to conditional compilation."""
    return _DIRECTIVE.fullmatch(pragma) is not None


def names_asked_for(texts: Sequence[str], library: Callable[[], Iterable[str]]) -> frozenset[str]:
    """What `defined(pou: NAME)` finds in the sources of a program and in the library, in capitals; nothing when nothing
    asks. Branches that are left out count as well."""
    if not any(map(_ASKS.search, texts)):
        return frozenset()
    found = {name for text in texts for name in _declared(plain_text(text, strings=False))}
    return frozenset(name.upper() for name in (*found, *library()))


def _declared(text: str) -> Iterator[str]:
    yield from _UNIT.findall(text)
    for block in _TYPES.findall(text):
        yield from _TYPE.findall(without_structures(block))
    for block in _GLOBALS.findall(text):
        for names in _VARIABLES.findall(block):
            yield from _NAME.findall(names)


def has_conditions(text: str) -> bool:
    """Whether some of a text may be left out."""
    return _BEGINS.search(text) is not None


class _NotUnderstood(Exception):
    """The condition is none this compiler knows."""


@dataclass
class _Branches:
    """An {IF} that is not at its end. `taken`: one of its branches was; `active`: this one is."""

    pos: int
    taken: bool
    active: bool
    last: bool = False  # there was an {ELSE}


class Conditions:
    """Which parts of a text count."""

    def __init__(self, report: Callable[[int, str, str], None], declared: frozenset[str]) -> None:
        self._report = report
        self._declared = declared
        self._defined = {_LITTLE_ENDIAN}
        self._open: list[_Branches] = []

    @property
    def active(self) -> bool:
        """Whether the text here counts."""
        return all(branches.active for branches in self._open)

    def take(self, pragma: str, pos: int) -> bool:
        """Follows a pragma; False when it is none of these."""
        misspelt = _MISSPELT.fullmatch(pragma)
        if misspelt is not None:
            right = "ELSIF" if misspelt[1].upper().startswith("EL") else "END_IF"
            self._report(pos, "pragma", f"{{{misspelt[1]}}} is written {{{right}}}")
            pragma = f"{{{right}{misspelt[2]}}}"
        match = _DIRECTIVE.fullmatch(pragma)
        if match is None:
            return False
        word, rest = match[1].upper(), match[2]
        if word in ("DEFINE", "UNDEFINE"):
            self._define(word, rest, pos)
        elif word == "IF":
            holds = self.active and self._holds(rest, pos)
            self._open.append(_Branches(pos, holds, holds))
        elif not self._open or (self._open[-1].last and word != "END_IF"):
            self._report(pos, "pragma", f"{{{word}}} without an {{IF}} before it")
        elif word == "END_IF":
            self._open.pop()
        else:
            self._next_branch(word, rest, pos)
        return True

    def finish(self) -> None:
        """Reports what is open at the end of the text."""
        for branches in self._open:
            self._report(branches.pos, "pragma", "{END_IF} missing for this {IF}")

    def _define(self, word: str, rest: str, pos: int) -> None:
        match = _DEFINE.fullmatch(rest)
        if match is None:
            self._report(pos, "pragma", f"{{{word.lower()} NAME}} takes one name")
        elif self.active:
            (self._defined.add if word == "DEFINE" else self._defined.discard)(match[1].upper())

    def _next_branch(self, word: str, rest: str, pos: int) -> None:
        branches = self._open[-1]
        outer = all(b.active for b in self._open[:-1])
        holds = outer and not branches.taken and (word == "ELSE" or self._holds(rest, pos))
        branches.active, branches.last = holds, word == "ELSE"
        branches.taken = branches.taken or holds

    def _holds(self, condition: str, pos: int) -> bool:
        tokens: list[str | bool] = []
        at, end = 0, len(condition.rstrip())
        try:
            while at < end:
                match = _TOKEN.match(condition, at)
                if match is None:
                    raise _NotUnderstood
                known = self._declared if match["kind"] else self._defined
                tokens.append(match["word"].upper() if match["word"] else match["name"].upper() in known)
                at = match.end()
            return _Evaluation(tokens).value()
        except _NotUnderstood:
            message = "a condition here is made of defined(NAME), defined(pou: NAME), NOT, AND, OR and parentheses"
            self._report(pos, "pragma", message)
            return False


class _Evaluation:
    """The value of a condition whose names are replaced by whether they are defined."""

    def __init__(self, tokens: list[str | bool]) -> None:
        self._tokens: Iterator[str | bool | None] = iter([*tokens, None])
        self._next = next(self._tokens)

    def value(self) -> bool:
        """The value of all of it."""
        result = self._either()
        if self._next is not None:
            raise _NotUnderstood
        return result

    def _accept(self, word: str) -> bool:
        if self._next != word:
            return False
        self._next = next(self._tokens)
        return True

    def _either(self) -> bool:
        result = self._both()
        while self._accept("OR"):
            result = self._both() or result
        return result

    def _both(self) -> bool:
        result = self._operand()
        while self._accept("AND"):
            result = self._operand() and result
        return result

    def _operand(self) -> bool:
        if self._accept("NOT"):
            return not self._operand()
        if self._accept("("):
            result = self._either()
            if not self._accept(")"):
                raise _NotUnderstood
            return result
        if not isinstance(self._next, bool):
            raise _NotUnderstood
        result, self._next = self._next, next(self._tokens)
        return result
