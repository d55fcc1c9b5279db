"""The comments about a declaration: those in the lines above it, else the one at the end of its line.

A declaration of several lines may also have its comment after its first line, as TwinCAT's pages have it.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import lru_cache
from textwrap import dedent

from plctool.compiler.syntax.plain_text import FLAT_COMMENT, comment_ends

_TRIVIA = re.compile(
    rf"(?P<comment>{FLAT_COMMENT})|(?P<nested>\(\*|/\*)|(?P<string>'(?:[^'$\n]|\$[^\n])*'|\"(?:[^\"$\n]|\$[^\n])*\")",
    re.ASCII | re.DOTALL,
)
_BETWEEN = re.compile(r"(?:\s|\{[^{}]*\}|\bTYPE\b)*", re.IGNORECASE)
_OWN_LINE = re.compile(r"\}|\bTYPE\b", re.IGNORECASE)  # what may have a line between
_NOT_DOCUMENTATION = re.compile(r"\s*(?:SPDX-License-Identifier|fmt:|region\b|endregion\b|@)", re.IGNORECASE)


class Comments:
    """All comments of a text."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._spans = spans(text)
        self._ends = [end for _, end in self._spans]

    def about(self, offset: int, end: int) -> str:
        """What the comments say of the declaration that begins at an offset and ends at another."""
        return self.before(offset) or self.after(end)

    def before(self, offset: int) -> str:
        """What the comments above a declaration say; pragmas may be between, a blank line may not."""
        found: list[str] = []
        begin = self._begin_of_declaration(offset)
        for at in range(bisect_right(self._ends, begin) - 1, -1, -1):
            start, end = self._spans[at]
            between = self._text[end:begin]
            if not _BETWEEN.fullmatch(between) or between.count("\n") - len(_OWN_LINE.findall(between)) > 1:
                break
            if self._text[self._line_of(start) : start].strip():
                break  # about what stands before it in its line
            found.insert(0, _said(self._text[start:end]))
            begin = start
        return _joined(found)

    def after(self, offset: int) -> str:
        """What the comments say that begin in the line of an offset, after it, and those that continue them."""
        found: list[str] = []
        at = offset
        for start, end in self._from(offset):
            between = self._text[at:start]
            if between.strip(" \t;,") or (found and not self._text[start:end].startswith("//")):
                break
            found.append(_said(self._text[start:end]))
            at = end
        return _joined(found)

    def of_line(self, offset: int) -> str:
        """What the comments say of the declaration at an offset: above it, else at the end of its line."""
        line_end = self._text.find("\n", offset)
        end = len(self._text) if line_end < 0 else line_end
        start = next((start for start, _ in self._from(offset) if offset <= start < end), None)
        return self.before(offset) or ("" if start is None else self.after(start))

    def first_inside(self, offset: int) -> str:
        """What the comments directly after the head of a POU say, before anything else."""
        line_end = self._text.find("\n", offset)
        head = self.after(offset)
        if head or line_end < 0:
            return head
        found: list[str] = []
        at = line_end
        for start, end in self._from(line_end):
            between = self._text[at:start]
            if between.strip() or (found and between.count("\n") > 1):
                break
            found.append(_said(self._text[start:end]))
            at = end
        return _joined(found)

    def _from(self, offset: int) -> Iterator[tuple[int, int]]:
        for at in range(bisect_right(self._ends, offset), len(self._spans)):
            yield self._spans[at]

    def _line_of(self, offset: int) -> int:
        return self._text.rfind("\n", 0, offset) + 1

    def _begin_of_declaration(self, offset: int) -> int:
        """The first character of its line that is no blank: modifiers may stand before a name."""
        line = self._line_of(offset)
        before = self._text[line:offset]
        return line + len(before) - len(before.lstrip())


@lru_cache(maxsize=8)
def comments_in(text: str) -> Comments:
    """Returns the comments of a text. Editors ask for the same ones again and again."""
    return Comments(text)


def spans(text: str) -> list[tuple[int, int]]:
    """Returns where each comment begins and ends; one without an end goes to the end of the text."""
    found: list[tuple[int, int]] = []
    at = 0
    while match := _TRIVIA.search(text, at):
        at = match.end()
        if match["nested"]:
            at = next((end for end in comment_ends(text, match["nested"], at, len(text)) if end >= 0), len(text))
        if not match["string"]:
            found.append((match.start(), at))
    return found


def _said(comment: str) -> str:
    """The text of a comment without its marks, and without the stars of a frame."""
    if comment.startswith("//"):
        return re.sub(r"^//[/!]? ?", "", comment).rstrip()
    inner = re.sub(r"^[*!]+(?= |\n|$)", "", comment[2:].removesuffix(f"*{comment[-1]}")).rstrip("* \t\n")
    lines = inner.expandtabs(4).split("\n")
    framed = all(re.match(r"\s*\*(?!\*)", line) for line in lines[1:] if line.strip())
    if framed and len(lines) > 1:
        lines[1:] = [re.sub(r"^\s*\* ?", "", line) for line in lines[1:]]
    return "\n".join([lines[0].strip(), dedent("\n".join(lines[1:]))]).strip()


def _joined(parts: list[str]) -> str:
    """Lines of one comment follow each other; what is no documentation is left out."""
    return "\n".join(part for part in parts if not _NOT_DOCUMENTATION.match(part)).strip()
