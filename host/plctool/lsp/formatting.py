"""Formatting by `plctool fmt`: of a whole file, or of some of its lines."""

from __future__ import annotations

from collections.abc import Sequence

from lsprotocol import types as lsp

from plctool.compiler.sources.source_files import TEXTS
from plctool.errors import PlcError, listed
from plctool.fmt.formatter import DEFAULT_WIDTH, Range, formatted
from plctool.lsp.project import Project
from plctool.lsp.session import Refused


def format_text(path: str, text: str, project: Project | None, ranges: Sequence[Range] = ()) -> list[lsp.TextEdit]:
    """Returns the changes that format a text. Raises Refused if it has syntax errors or is not Structured Text."""
    if not path.lower().endswith(TEXTS):
        raise Refused(f"plctool fmt formats Structured Text in files {listed(TEXTS, 'and')}.")
    made = None if project is None or project.files.project is None else project.files.project.line_length
    try:
        after = formatted(path, text, made or DEFAULT_WIDTH, ranges)
    except PlcError as error:
        raise Refused(f"Not formatted: {error.message}") from None
    return _changes(text, after)


def _changes(before: str, after: str) -> list[lsp.TextEdit]:
    """One change from the first line that differs to the last one, so that the cursor stays where it is."""
    if before == after:
        return []
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    first = 0
    while first < min(len(old), len(new)) and old[first] == new[first]:
        first += 1
    last = 0
    while last < min(len(old), len(new)) - first and old[-1 - last] == new[-1 - last]:
        last += 1
    end_line = len(old) - last
    end = lsp.Position(end_line, 0)
    if last == 0 and old and not old[-1].endswith("\n"):
        end = lsp.Position(len(old) - 1, len(old[-1].encode("utf-16-le")) // 2)
    return [lsp.TextEdit(lsp.Range(lsp.Position(first, 0), end), "".join(new[first : len(new) - last]))]
