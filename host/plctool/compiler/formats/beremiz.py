"""build/plc.st of OpenPLC Editor and Beremiz: the blocks in C that they put before every program.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.formats.text import Text
from plctool.compiler.source import Source

_BLOCKS = ("LOGGER", "python_eval", "python_poll", "python_gear")
_BLOCK = re.compile(rf"^FUNCTION_BLOCK ({'|'.join(_BLOCKS)})\s.*?^END_FUNCTION_BLOCK", re.MULTILINE | re.DOTALL)
_IN_C = re.compile(r"\{\{|\{extern ")


def without_blocks_in_c(source: Source) -> Source:
    """The text without those blocks, if the program uses none of them."""
    text = source.text
    if source.pieces or not _IN_C.search(text):
        return source
    found = list(_BLOCK.finditer(text))
    rest = _BLOCK.sub("", text)
    if not found or any(re.search(rf"\b{name}\b", rest, re.IGNORECASE) for name in _BLOCKS):
        return source
    made = Text()
    made.spliced(text, [(match.start(), match.end(), "") for match in found])
    return made.source(source.path, text)
