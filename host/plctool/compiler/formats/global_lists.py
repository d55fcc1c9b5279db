"""Files that declare the variables of a whole program with VAR alone, as Automation Studio does.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.base.source import Source
from plctool.compiler.formats.text import Text
from plctool.compiler.formats.units import UNITS, tokens_of


def read_list(path: str, text: str) -> Source:
    """A list of globals: VAR stands for VAR_GLOBAL where there is no unit around it."""
    inserts = []
    for token in tokens_of(text):
        if token.type in UNITS:
            break
        if token.text.upper() == "VAR":
            inserts.append((token.end, token.end, "_GLOBAL"))
    made = Text()
    made.spliced(text, inserts)
    return made.source(path, text)
