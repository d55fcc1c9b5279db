"""A text without its comments and pragmas, for what looks at words without parsing them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

NAME = r"(?u:(?!\d)\w++)"
"""The pattern of a name, for patterns with re.ASCII: letters and digits of any language. It does not begin with a set
of characters, because Python looks for those with re.ASCII first."""

FLAT_COMMENT = r"//[^\n]*|\(\*(?:[^(*]++|\((?!\*)|\*(?!\)))*+\*\)|/\*(?:[^/*]++|/(?!\*)|\*(?!/))*+\*/"
"""The pattern of a comment with none in it."""

_MARKS = {"(*": re.compile(r"\(\*|\*\)"), "/*": re.compile(r"/\*|\*/")}
_QUOTES = "'\""
_STRUCTURE = re.compile(r":\s*(?:STRUCT|UNION)\b.*?\bEND_(?:STRUCT|UNION)\b", re.IGNORECASE | re.DOTALL)
_LEFT_OUT = re.compile(
    rf"(?P<plain>{FLAT_COMMENT}|\{{[^{{}}]*\}}|\{{\{{.*?\}}\}})|(?P<nested>\(\*|/\*)|"
    r"(?P<string>'(?:[^'$\n]|\$[^\n])*+'?|\"(?:[^\"$\n]|\$[^\n])*+\"?)",
    re.DOTALL,
)


def comment_ends(text: str, mark: str, at: int, end: int) -> tuple[int, int]:
    """Where a comment ends whose `mark`, (* or /*, is before `at`: with the comments in it, and at the first mark of an
    end; -1 if it does not."""
    depth, first = 1, -1
    for match in _MARKS[mark].finditer(text, at, end):
        depth += 1 if match.group() == mark else -1
        first = match.end() if first < 0 and match.group() != mark else first
        if depth == 0:
            return match.end(), first
    return -1, first


@lru_cache(maxsize=16)
def plain_text(text: str, *, strings: bool) -> str:
    """The text with blanks in place of comments, pragmas and, unless wanted, `strings`, so that all else stays where it
    is. All branches of a conditional pragma are in it."""
    parts, kept = [], 0
    for begin, end in _left_out(text):
        if text[begin] not in _QUOTES or not strings:
            parts += [text[kept:begin], " " * (end - begin)]
            kept = end
    return "".join([*parts, text[kept:]])


def is_in_comment(text: str, offset: int) -> bool:
    """True if the character at `offset` belongs to a comment."""
    for begin, end in _left_out(text):
        if offset < end:
            return begin <= offset and text[begin] in "(/"
    return False


def _left_out(text: str) -> Iterator[tuple[int, int]]:
    """Yields begin and end of comments, pragmas and strings."""
    at = 0
    while match := _LEFT_OUT.search(text, at):
        begin, at = match.start(), match.end()
        if match["nested"]:
            ends = comment_ends(text, match["nested"], at, len(text))
            at = next((end for end in ends if end >= 0), len(text))
        yield begin, at


def without_structures(types: str) -> str:
    """The plain text of types without what is in STRUCT and UNION."""
    return _STRUCTURE.sub(":", types)
