"""The rules of PLCopen's Coding Guidelines 1.0 that are checked when they are asked for, and what a project sets.

Rules that the compiler holds to in any case, as errors or ordinary warnings, are not among them; docs/guidelines.md has
all 64.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

GROUP = "guidelines"
"""What all rules are called together where warnings are named."""

RULES = {
    "n1": "an address stands where the name of a variable could",
    "n2": "the name of a variable has not the form that the project asks for",
    "n3": "a name is among those that the project avoids",
    "n4": "the name of a unit or constant has not the form that the project asks for",
    "n5": "a local name hides that of a global variable",
    "n6": "a name is shorter or longer than the project allows",
    "n9": "a variable has the name of a type or unit",
    "n10": "the name of a type has not the form that the project asks for",
    "c2": "no comment stands before a unit, a type or a member of a unit",
    "cp6": "a function or function block uses a global variable",
    "cp8": "REAL or LREAL values are compared with = or <>",
    "cp9": "a unit has more branches and loops than the project allows",
    "cp14": "RETURN ends a unit before its end",
    "cp18": "a unit uses more global variables than the project allows",
    "cp19": "JMP",
    "cp20": "an instance of a function block is called in several places of a unit",
    "cp23": "a unit has more parameters than the project allows",
    "cp26": "several programs write one global variable",
    "cp28": "durations, dates or times are compared with = or <>",
    "l10": "EXIT or CONTINUE leaves the order of a loop",
    "l17": "IF without ELSE",
    "l22": "the variable of a FOR is assigned in its body",
    "e1": "memory is allocated while the program runs",
    "e2": "a pointer is moved by arithmetic",
    "e3": "pointers are compared with <, <=, > or >=",
}
"""Numbers as the guidelines have them, in lower case as names of warnings are, and what is found."""

NAME_KINDS = (
    "program", "function", "function-block", "interface", "method", "property", "action",
    "struct", "enumeration", "type",
    "constant", "global", "input", "output", "in-out", "local",
)  # fmt: skip
"""What a project can ask a form of the name for: units, types, variables."""

STYLES = {
    "UPPER_CASE": "[A-Z][A-Z0-9_]*",
    "lower_case": "[a-z][a-z0-9_]*",
    "CamelCase": "[A-Z][A-Za-z0-9]*",
    "camelCase": "[a-z][A-Za-z0-9]*",
    "*": r"\w*",
}
"""What a form has once, before or after what names begin or end with: `FB_CamelCase`."""

_FORM = re.compile(rf"(\w*?)({'|'.join(map(re.escape, STYLES))})(\w*)", re.ASCII)


def read_form(text: str) -> re.Pattern[str] | None:
    """What names of a form fit, which takes time in proportion to a name; None if it has no style."""
    found = _FORM.fullmatch(text)
    return None if found is None else re.compile(f"{found[1]}{STYLES[found[2]]}{found[3]}", re.ASCII)


@dataclass(frozen=True)
class Guidelines:
    """What a project sets. `forms`: what a name looks like by kind, one of NAME_KINDS; `avoided`: names, case-folded.
    Numbers are the greatest that are well."""

    forms: Mapping[str, str] = field(default_factory=dict)
    avoided: frozenset[str] = frozenset()
    shortest_name: int = 1
    longest_name: int = 32
    branches: int = 20
    globals: int = 10
    parameters: int = 15


PROPOSED = Guidelines()
"""What holds in a project that sets nothing."""
