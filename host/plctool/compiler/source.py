"""Source texts and places in them.

Inside the front end a place is a character offset into one text; lines and columns are worked out when somebody asks.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePath

from plctool.compiler.typed import Pos


@dataclass(frozen=True)
class Source:
    """A text to compile; `path` is what diagnoses and debug information call it."""

    path: str
    text: str

    @cached_property
    def line_starts(self) -> list[int]:
        """Offsets of the first character of each line."""
        starts = [0]
        find = self.text.find
        at = find("\n")
        while at >= 0:
            starts.append(at + 1)
            at = find("\n", at + 1)
        return starts

    @property
    def stem(self) -> str:
        """The file name without folder and extension: how a list of globals is qualified."""
        return PurePath(self.path).stem

    def pos(self, offset: int) -> Pos:
        """Line and column (from 1) of a character offset."""
        starts = self.line_starts
        line = bisect_right(starts, offset)
        return Pos(self.path, line, offset - starts[line - 1] + 1)

    def line_text(self, line: int) -> str:
        """The text of a line (from 1) without its end."""
        starts = self.line_starts
        if not 1 <= line <= len(starts):
            return ""
        end = starts[line] - 1 if line < len(starts) else len(self.text)
        return self.text[starts[line - 1] : end].rstrip("\r")
