"""The comment about a declaration."""

from __future__ import annotations

import re

COMMENT = re.compile(r"//(?P<line>[^\n]*)|\(\*(?P<block>.*?)\*\)|/\*(?P<c>.*?)\*/", re.DOTALL)
_PRAGMA = re.compile(r"\{[^{}]*\}")
_MARKS = re.compile(r"^[ \t]*[*/!]*[ \t]?", re.MULTILINE)
_FAR = 4000  # characters before a declaration in which its comment is looked for


def comment_of(text: str, offset: int) -> str:
    """Returns the comment about what is declared at an offset: in the lines above, else at the end of the line."""
    return _comment_before(text, _begin_of(text, offset)) or _comment_after(text, offset)


def _begin_of(text: str, offset: int) -> int:
    """The beginning of the line of a declaration; pragmas and the keyword of a type may stand in lines before it."""
    at = text.rfind("\n", 0, offset) + 1
    while True:
        line_begin = text.rfind("\n", 0, max(0, at - 1)) + 1
        line = text[line_begin : max(0, at - 1)].strip()
        if at and (_PRAGMA.fullmatch(line) or line.upper() in ("TYPE",)):
            at = line_begin
        else:
            return at


def _comment_before(text: str, end: int) -> str:
    """Returns the comments in the lines that end before an offset, without a blank line between."""
    begin = max(0, end - _FAR)
    found: list[str] = []
    matches = list(COMMENT.finditer(text, begin, end))
    for match in reversed(matches):
        between = text[match.end() : end]
        if between.strip() or between.count("\n") > 1:
            break
        line_begin = text.rfind("\n", 0, match.start()) + 1
        if text[line_begin : match.start()].strip():
            break  # at the end of a line of another declaration
        found.insert(0, _plain(match))
        end = match.start()
    return "\n".join(found).strip()


def _comment_after(text: str, offset: int) -> str:
    """Returns the comment at the end of a line."""
    end = text.find("\n", offset)
    line_end = len(text) if end < 0 else end
    match = COMMENT.search(text, offset, line_end)
    if match is None:
        return ""
    found = [_plain(match)]
    return "\n".join(found).strip()


def _plain(match: re.Match[str]) -> str:
    """Returns what a comment says, without its marks."""
    inner = next((part for part in match.groups() if part is not None), "")
    return _MARKS.sub("", inner.strip("*/ \t")).strip()
