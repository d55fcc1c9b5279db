"""Where systems disagree about what a program means, and which of them a program is compiled as.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.errors import UsageError, did_you_mean


@dataclass(frozen=True)
class Dialect:
    """What the rules ask. It holds for the program and its libraries, not for the standard library.

    `errors`: warnings that are errors; `limits_each_turn`: FOR evaluates its end and step in each turn; `reals_wrap`:
    REAL and LREAL to BYTE .. LWORD as `Rounding.AWAY` says; `computes_in_32_bits`: arithmetic of integers below 32 bits
    has the result of 32 bits, which an assignment or a conversion cuts; `writes_locals`: a VAR of a function block may
    be written from outside, with a warning.
    """

    name: str
    errors: frozenset[str] = frozenset()
    limits_each_turn: bool = False
    reals_wrap: bool = False
    computes_in_32_bits: bool = False
    writes_locals: bool = False


OWN = Dialect("")
"""Without a choice."""

DIALECTS = {
    dialect.name: dialect
    for dialect in (
        Dialect("iec", errors=frozenset(("address", "enum"))),
        Dialect("codesys", limits_each_turn=True, reals_wrap=True, computes_in_32_bits=True),
        Dialect("twincat", limits_each_turn=True, reals_wrap=True, computes_in_32_bits=True),
        Dialect("openplc", writes_locals=True),
    )
}


def find_dialect(name: str | None) -> Dialect:
    """The dialect of this name; our own for None. Raises UsageError."""
    if name is None:
        return OWN
    if name not in DIALECTS:
        hint = did_you_mean(name, DIALECTS) or f"; there are {', '.join(DIALECTS)}"
        raise UsageError(f"There is no dialect '{name}'{hint}.", "bad-dialect")
    return DIALECTS[name]
