"""Makes text of devices and of files of other authors fit for a terminal.

A character that would control the terminal or change the order of others becomes an escape such as `\\x1b`.
"""

from __future__ import annotations

import re

_CONTROL = r"\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
"""Control characters of terminals, line separators, and marks that change the direction of text (Unicode's UAX 9)."""
_UNSAFE = re.compile(f"[{_CONTROL}]")
_UNSAFE_IN_LINE = re.compile(f"[\\t\\n{_CONTROL}]")


def printable(text: str) -> str:
    """Text of several lines."""
    return _UNSAFE.sub(_escape, text)


def one_line(text: str) -> str:
    """A name, value or message as a part of a line: its line breaks and tabs are escapes as well."""
    return text if text.isprintable() else _UNSAFE_IN_LINE.sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    return match[0].encode("unicode_escape").decode()
