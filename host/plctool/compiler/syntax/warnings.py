"""The warnings by name: which there are, which are wanted.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.lexer import Lexer
from plctool.errors import UsageError

WARNINGS = {
    "access": "a VAR of a function block is read from outside",
    "address": "a variable has another size than the letter of its address says, as in AT %ML0 : DWORD",
    "always": "a comparison gives the same for every value of its type",
    "assignment": "an assignment is used as a value, as in IF (a := 1) THEN",
    "bits": "a BYTE, WORD, DWORD or LWORD is taken for an unsigned number where a REAL is needed",
    "bounds": "an array goes to one of the same length with other bounds",
    "case": "a CASE about an enumeration has no ELSE and misses some of its values",
    "configuration": "a task has no time, no event or no program, or a program no task",
    "conversion": "a constant text or REAL is no value of the type it is converted to, so systems disagree",
    "endless": "a loop never ends as it is written",
    "enum": "a number, or a value of another enumeration, becomes a value of an enumeration or is compared with one",
    "escape": "a string ends with \\n, \\r or \\t, which are two characters each",
    "for-bound": "the end or step of a FOR changes in its body, or depends on the variable of the loop",
    "index": "a FOR goes past the end of an array in an iteration that comes for certain, which stops the program",
    "integer-division": "an integer division drops its fraction before the result becomes a REAL",
    "io": "something in a description of inputs and outputs is probably not meant",
    "kept": "a variable is RETAIN or PERSISTENT, but what it holds is an address, which is not kept",
    "layout": "a type takes more memory than it does in other systems",
    "left-out": "a part of an export, such as a visualisation, has no meaning here",
    "lifetime": "an instance of a function block lives for one call only, and is initialised in the next one",
    "narrowing": "an integer or an LREAL goes where not all of its values fit",
    "no-effect": "an attribute, pragma or qualifier changes nothing here, though it does in other systems",
    "no-program": "there is no PROGRAM, or none has a task, so nothing would run",
    "not": "NOT inverts a number that is compared, as in NOT a = 5",
    "order": "an initial value reads a variable that is declared below it, so systems disagree about it",
    "overlap": "two variables with AT share memory, and neither is a bit of the other",
    "pointer": "a pointer becomes a pointer to something else",
    "pool": "__NEW needs memory for a type without {attribute 'pool'}: how much is reserved",
    "pragma": "what {warning 'text'} says",
    "precision": "digits are lost: a large number becomes REAL, a duration or time is finer than its type",
    "recursion": "a call through a pointer or an interface may lead back to its caller",
    "result": "a function or method never assigns its result",
    "shared": "several tasks write one variable, or variables in one byte of %M",
    "shared-output": "two tasks write the same bit of an output",
    "sign": "bits or a number without sign are compared with a number that has one, in a type too small for both",
    "statement": "a statement reads a variable and does nothing with it",
    "task": "a program is called that a task runs as well",
    "truncated": "a string is longer than the STRING it goes to",
    "uncalled": "a function block is given an input, but never called",
    "unlocated": "a variable AT %I*, %Q* or %M* has no address in VAR_CONFIG, or one such as %IW0.1 no channel",
    "unreachable": "a statement is never reached",
    "unused": "a variable, label or program is never used, not even by a test, or the result of a call",
    "widening": "a sum, difference or product is computed in a type that is narrower than where it goes",
    "wrap": "a sum, difference or product below 32 bits is divided or compared, and may have wrapped in its type",
    "written-input": "a program writes an input, which the next cycle overwrites",
}
"""What each warning is about; its name is the `code` of the diagnostic."""

_SWITCH = re.compile(r"\{\s*warning\s+(disable|restore)\s+([\w-]+)\s*\}", re.IGNORECASE)

LineRanges = list[tuple[int, int]]  # first line, and the first line that is not in it any more


@dataclass(frozen=True)
class WarningOptions:
    """`disabled`: names of warnings that are not wanted; `as_errors`: whether the others are errors."""

    disabled: frozenset[str] = frozenset()
    as_errors: bool = False


ALL_WARNINGS = WarningOptions()


def warning_options(no_warn: Iterable[str] = (), *, as_errors: bool = False) -> WarningOptions:
    """Options from names, several in one text with commas between them. Raises UsageError for an unknown name."""
    names = [name.strip().lower() for text in no_warn for name in text.split(",")]
    for name in names:
        if name not in WARNINGS:
            raise UsageError(f"There is no warning '{name}'; the names are {', '.join(WARNINGS)}.", "unknown-warning")
    return WarningOptions(frozenset(names), as_errors)


def switched_off(source: Source) -> dict[str, LineRanges]:
    """Where a text says {warning disable name}, up to {warning restore name} or its end. Other names, such as the
    numbers of other compilers, mean nothing."""
    if not _SWITCH.search(source.text):
        return {}
    lexer = Lexer(source.text, lambda offset, code, message: None)
    for _ in lexer:
        pass
    found: dict[str, LineRanges] = {}
    for offset, text in lexer.pragmas:
        match = _SWITCH.fullmatch(text)
        if match is None:
            continue
        ranges = found.setdefault(match[2].lower(), [])
        line = source.pos(offset).line
        if match[1].lower() == "restore" and ranges:
            ranges[-1] = (ranges[-1][0], min(ranges[-1][1], line))
        elif match[1].lower() == "disable":
            ranges.append((line, len(source.line_starts) + 1))
    return found
