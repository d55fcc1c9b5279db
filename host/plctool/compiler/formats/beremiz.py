"""Structured Text that OpenPLC Editor and Beremiz make of a project, with code in C.

build/plc.st begins with blocks in C. The program.st that OpenPLC Editor uploads has lines of C after its configuration,
each in a comment: (*DBG:...*) for the debugger, (*FILE:...*) for an added file. C may contain `*)`, so such a comment
ends where the line ends; the runtime of OpenPLC cuts these lines off as well.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.base.source import Source
from plctool.compiler.formats.text import Text

_BLOCKS = ("LOGGER", "python_eval", "python_poll", "python_gear")
_BLOCK = re.compile(rf"^FUNCTION_BLOCK ({'|'.join(_BLOCKS)})\s.*?^END_FUNCTION_BLOCK", re.MULTILINE | re.DOTALL)
_IN_C = re.compile(r"\{\{|\{extern ")
_LINE_OF_C = re.compile(r"^\(\*(?:DBG|FILE):.*\*\)[ \t]*\r?$", re.MULTILINE)


def without_blocks_in_c(source: Source) -> Source:
    """Returns the text without the lines of C after it, and without those blocks if the program uses none of them."""
    text = source.text
    if source.pieces:
        return source
    lines = list(_LINE_OF_C.finditer(text))
    left_out = [*_blocks(text, lines[0].start() if lines else len(text)), *lines]
    if not left_out:
        return source
    made = Text()
    made.spliced(text, [(match.start(), match.end(), "") for match in left_out])
    return made.source(source.path, text)


def _blocks(text: str, end: int) -> list[re.Match[str]]:
    """Returns the blocks in C before `end`; none if the program uses one of them."""
    if not _IN_C.search(text, 0, end):
        return []
    rest = _BLOCK.sub("", text[:end])
    used = any(re.search(rf"\b{name}\b", rest, re.IGNORECASE) for name in _BLOCKS)
    return [] if used else list(_BLOCK.finditer(text, 0, end))
