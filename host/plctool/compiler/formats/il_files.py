"""Instruction List in files of text: which bodies are written in it, and their statements.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

from plctool.compiler.base.source import Source
from plctool.compiler.formats.text import Chunk, Findings, Part, Place, Text
from plctool.compiler.syntax.plain_text import plain_text

_FIRST = re.compile(
    r"\s*(?:[^\W\d]\w*[ \t]*:(?!=)\s*)*((?:(?:LDN?|CALC?N?)[ \t]+[\w%'\"-]|JMP[ \t]+\w+[ \t]*$))",
    re.IGNORECASE | re.MULTILINE,
)
_HINT = re.compile(r"[LCJ](?:DN?|ALC?N?|MP)[ \t]", re.IGNORECASE)  # is found faster: it begins with no repetition
_BOUNDARY = re.compile(
    r"\bEND_\w+\b[ \t]*;?|^[ \t]*(?:PROGRAM|FUNCTION_?BLOCK|FUNCTION|ACTION|METHOD)\b[^\n]*|^[ \t]*(VAR\w*)\b",
    re.IGNORECASE | re.MULTILINE,
)


def is_list(plain: str, start: int, end: int) -> bool:
    """True if a body, in a text without comments, is a list of instructions."""
    return _FIRST.match(plain, start, end) is not None


def bodies(plain: str, start: int = 0, end: int | None = None) -> Iterator[tuple[int, int]]:
    """Where lists of instructions begin and end in a text, which has blanks for comments."""
    marks = list(_BOUNDARY.finditer(plain, start, len(plain) if end is None else end))
    for mark, following in pairwise(marks):
        if not mark[1] and is_list(plain, mark.end(), following.start()):
            yield mark.end(), following.start()


def has_lists(text: str) -> bool:
    """True if a text has a body that is a list of instructions."""
    if _HINT.search(text) is None or _FIRST.search(text) is None:
        return False
    return any(True for _ in bodies(plain_text(text, strings=True)))


def statements(text: str, plain: str, span: tuple[int, int], at: Place, findings: Findings) -> list[Part]:
    """What stands in place of a list of instructions that begins at a place; only a line end after an error."""
    from plctool.compiler.formats.instruction_list import translate  # late: few files have lists
    from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError

    start, end = span
    body = Body()
    try:
        translate([Chunk(text[start:end], at.line, at.column)], body, plain[start:end])
    except NotTranslatedError as error:
        findings.add(error.at, "language", str(error))
        return [("\n", at)]
    return [("\n", at), *body.parts]


def read_lists(path: str, text: str) -> Source | None:
    """The source of a file in whose text there are lists of instructions; None if there are none."""
    if not has_lists(text):
        return None
    plain = plain_text(text, strings=True)
    findings, inserts = Findings(), list[tuple[int, int, str | list[Part]]]()
    for start, end in bodies(plain):
        place = Place(text.count("\n", 0, start) + 1, start - text.rfind("\n", 0, start))
        inserts.append((start, end, statements(text, plain, (start, end), place, findings)))
    made = Text()
    made.spliced(text, inserts)
    return made.source(path, text, findings=findings.all)
