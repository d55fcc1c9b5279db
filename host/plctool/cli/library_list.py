"""The functions and blocks of the standard library, as `plctool symbols --library` lists them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase

from plctool.cli.documents import Document
from plctool.cli.output import table
from plctool.errors import UsageError

_SENTENCE = re.compile(r"(?P<first>.*?[.:;])(?:\s|$)", re.DOTALL)
_KINDS = {"FUNCTION": "function", "FUNCTION_BLOCK": "block"}


def library(patterns: Sequence[str]) -> Document:
    """Those whose names match one of the patterns; without patterns all. Raises UsageError for a pattern that matches
    nothing."""
    from plctool.compiler.syntax.library import shown_name, standard_library

    found = standard_library()
    rows = [_row(found.entry(name.casefold()), shown_name(name)) for name in set(found.names(*_KINDS))]
    rows.sort(key=lambda row: row["name"].casefold())
    for pattern in patterns:
        if not any(_matches(row["name"], pattern) for row in rows):
            raise UsageError(
                f"The library has no function or block {pattern}; write for example 'CRC*'.", "unknown-symbol"
            )
    wanted = [row for row in rows if not patterns or any(_matches(row["name"], pattern) for pattern in patterns)]
    return {"library": wanted}


def library_text(document: Document) -> str:
    """A line for each."""
    return table(document["library"], ("name", "kind", "about"))


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name.casefold(), pattern.casefold())


def _row(entry: object, name: str) -> dict[str, str]:
    from plctool.compiler.syntax.library import Entry

    assert isinstance(entry, Entry)  # it has each name that it lists
    return {"name": name, "kind": _KINDS[entry.keyword], "about": _first_sentence(entry.comment())}


def _first_sentence(comment: str) -> str:
    words = " ".join(comment.split())
    match = _SENTENCE.match(words)
    return (match["first"] if match else words).rstrip(".:;")
