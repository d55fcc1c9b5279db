"""What people write that is no Structured Text, or none for this compiler, and what to write instead.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

SIGNS = {
    "==": ("EQ", "=", "a comparison is written =, an assignment :=; there is no =="),
    "!=": ("OP", "<>", "unequal is written <>, not !="),
    "&&": ("OP", "AND", "and is written AND, not &&"),
    "||": ("OP", "OR", "or is written OR, not ||"),
    "|": ("OP", "OR", "or is written OR, not |"),
    "!": ("NOT", "NOT", "not is written NOT, not !"),
    "%": ("OP", "MOD", "a remainder is written MOD, not %"),
}
"""Operators of other languages: the terminal and text they stand for, and what to say."""

WORDS = {
    "ELSEIF": "ELSIF",
    **{f"END{word}": f"END_{word}" for word in ("IF", "CASE", "FOR", "WHILE", "REPEAT", "VAR", "STRUCT", "TYPE")},
}
"""Keywords spelled wrongly, and rightly."""


@dataclass(frozen=True)
class Refusal:
    """What is said of a word, and up to where the text is left out: a word or sign that is left out as well, or an end
    of a unit, which is not."""

    message: str
    end: str = ""


_GRAPHIC = "this is a diagram; only Structured Text can be compiled"

REFUSED = {
    "JMP": Refusal("JMP and labels are not supported; write a loop, IF, EXIT or RETURN", ";"),
    "__TRY": Refusal("exceptions cannot be caught, they stop the program; test beforehand what may fail", "__ENDTRY"),
    "_LD_BODY": Refusal(_GRAPHIC),
    "_FBD_BODY": Refusal(_GRAPHIC),
}
"""Words that begin what this compiler leaves out."""

_NO_MEMORY = "nothing is allocated while the program runs; declare an instance, or an array of them"

REFUSED_CALLS = {
    "__NEW": _NO_MEMORY,
    "__DELETE": _NO_MEMORY,
    "BITADR": "a bit has no address of its own here; use the variable itself, or ADR and a bit number",
    "INDEXOF": "a unit has no number here; call it by its name",
    "INI": "an instance gets its initial values when the program starts; assign them one by one",
}
"""Functions of other systems that this one has not, and why."""
