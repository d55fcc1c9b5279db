"""The warnings by name: which there are, which are wanted.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import guidelines as plcopen
from plctool.compiler.syntax.guidelines import Guidelines
from plctool.compiler.syntax.lexer import Lexer
from plctool.errors import UsageError

_TABLE = (
    ("access", "style", "a VAR of a function block is read from outside"),
    ("address", "io", "a variable has another size than the letter of its address says, as in AT %ML0 : DWORD"),
    ("always", "numbers", "a comparison gives the same for every value of its type"),
    ("assignment", "style", "an assignment is used as a value, as in IF (a := 1) THEN"),
    ("bits", "numbers", "a BYTE, WORD, DWORD or LWORD is taken for an unsigned number where a REAL is needed"),
    ("bounds", "memory", "an array goes to one of the same length with other bounds"),
    ("case", "style", "a CASE about an enumeration has no ELSE and misses some of its values"),
    ("configuration", "tasks", "a task has no time, no event or no program, or a program no task"),
    (
        "conversion",
        "numbers",
        "a constant text or REAL is no value of the type it is converted to, so systems disagree",
    ),
    ("endless", "dead-code", "a loop never ends as it is written"),
    (
        "enum",
        "numbers",
        "a number, or a value of another enumeration, becomes a value of an enumeration or is compared with one",
    ),
    ("escape", "style", "a string ends with \\n, \\r or \\t, which are two characters each"),
    ("for-bound", "style", "the end or step of a FOR changes in its body, or depends on the variable of the loop"),
    (
        "index",
        "memory",
        "a FOR goes past the end of an array in an iteration that comes for certain, which stops the program",
    ),
    ("integer-division", "numbers", "an integer division drops its fraction before the result becomes a REAL"),
    ("io", "io", "something in a description of inputs and outputs is probably not meant"),
    ("kept", "memory", "a variable is RETAIN or PERSISTENT, but what it holds is an address, which is not kept"),
    ("layout", "memory", "a type takes more memory than it does in other systems"),
    ("left-out", "style", "a part of an export, such as a visualisation, has no meaning here"),
    (
        "lifetime",
        "memory",
        "an instance of a function block lives for one call only, and is initialised in the next one",
    ),
    ("narrowing", "numbers", "an integer or an LREAL goes where not all of its values fit"),
    (
        "no-effect",
        "dead-code",
        "an attribute, pragma or qualifier changes nothing here, though it does in other systems",
    ),
    ("no-program", "dead-code", "there is no PROGRAM, or none has a task, so nothing would run"),
    ("not", "numbers", "NOT inverts a number that is compared, as in NOT a = 5"),
    ("order", "memory", "an initial value reads a variable that is declared below it, so systems disagree about it"),
    ("overlap", "io", "two variables with AT share memory, and neither is a bit of the other"),
    ("pointer", "memory", "a pointer becomes a pointer to something else"),
    ("pool", "memory", "__NEW needs memory for a type without {attribute 'pool'}: how much is reserved"),
    ("pragma", "style", "what {warning 'text'} says"),
    ("precision", "numbers", "digits are lost: a large number becomes REAL, a duration or time is finer than its type"),
    ("recursion", "tasks", "a call through a pointer or an interface may lead back to its caller"),
    ("result", "dead-code", "a function or method never assigns its result"),
    ("shared", "tasks", "several tasks write one variable, or variables in one byte of %M"),
    ("shared-output", "tasks", "two tasks write the same bit of an output"),
    (
        "sign",
        "numbers",
        "bits or a number without sign are compared with a number that has one, in a type too small for both",
    ),
    ("statement", "dead-code", "a statement reads a variable and does nothing with it"),
    ("task", "tasks", "a program is called that a task runs as well"),
    ("truncated", "memory", "a string is longer than the STRING it goes to"),
    ("uncalled", "dead-code", "a function block is given an input, but never called"),
    ("unlocated", "io", "a variable AT %I*, %Q* or %M* has no address in VAR_CONFIG, or one such as %IW0.1 no channel"),
    ("unreachable", "dead-code", "a statement is never reached"),
    ("unused", "dead-code", "a variable, label or program is never used, not even by a test, or the result of a call"),
    ("widening", "numbers", "a sum, difference or product is computed in a type that is narrower than where it goes"),
    (
        "wrap",
        "numbers",
        "a sum, difference or product below 32 bits is divided or compared, and may have wrapped in its type",
    ),
    ("written-input", "io", "a program writes an input, which the next cycle overwrites"),
)
"""Name, group and meaning of each warning. The name is the `code` of the diagnostic."""

WARNINGS = {name: meaning for name, _, meaning in _TABLE}
GROUP_OF = {name: group for name, group, _ in _TABLE}
GROUPS = tuple(dict.fromkeys(sorted(GROUP_OF.values())))
MEANINGS = WARNINGS | plcopen.RULES
"""Those that are checked when they are asked for as well."""

_SWITCH = re.compile(r"\{\s*warning\s+(disable|restore)\s+([\w-]+)\s*\}", re.IGNORECASE)

LineRanges = list[tuple[int, int]]  # first line, and the first line that is not in it any more


@dataclass(frozen=True)
class WarningOptions:
    """`disabled`: names of warnings that are not wanted; `as_errors`: whether the others are errors. `guidelines`: what
    those of PLCopen are held to; None: they are not checked."""

    disabled: frozenset[str] = frozenset()
    as_errors: bool = False
    guidelines: Guidelines | None = None


ALL_WARNINGS = WarningOptions()


def warning_options(
    no_warn: Iterable[str] = (), *, as_errors: bool = False, guidelines: Guidelines | None = None
) -> WarningOptions:
    """Options from names of warnings and groups, several in one text with commas between them. Raises UsageError for an
    unknown name."""
    names = [name.strip().lower() for text in no_warn for name in text.split(",")]
    for name in names:
        if not meant_by(name):
            raise UsageError(f"There is no warning '{name}'; the names are {', '.join(WARNINGS)}.", "unknown-warning")
    return WarningOptions(frozenset(code for name in names for code in meant_by(name)), as_errors, guidelines)


def meant_by(name: str) -> list[str]:
    """Returns the warnings of a group, or the one of this name; none if there is neither."""
    groups = GROUP_OF | dict.fromkeys(plcopen.RULES, plcopen.GROUP)
    return [code for code, group in groups.items() if name in (group, code)]


def switched_off(source: Source) -> dict[str, LineRanges]:
    """Where a text says {warning disable name}, up to {warning restore name} or its end. A name may be that of a group;
    others, such as the numbers of other compilers, mean nothing."""
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
        line = source.pos(offset).line
        for code in meant_by(match[2].lower()):
            ranges = found.setdefault(code, [])
            if match[1].lower() == "restore" and ranges:
                ranges[-1] = (ranges[-1][0], min(ranges[-1][1], line))
            elif match[1].lower() == "disable":
                ranges.append((line, len(source.line_starts) + 1))
    return found
