"""How documents look to users: short lines and aligned columns, no decoration that disturbs other tools.

All that a command prints goes through `say`, because names, logs and errors come from devices and files that others
made.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TextIO

from plctool.controller_documents import Document
from plctool.errors import UsageError
from plctool.files import STDOUT
from plctool.printable import one_line, printable

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
_DIAGNOSTIC = re.compile(r"^(.+?:\d+:\d+:) (error|warning):(?= )|^(\s*\^)$|^  (pass|FAIL)(?=  )", re.MULTILINE)
_OF_SEVERAL_LINES = ("answer", "script", "page", "diff", "formatted_text")
"""The strings of documents whose line breaks are shown: of a shell, a script, a manual page and sources."""
_BOLD, _RED, _MAGENTA, _GREEN, _PLAIN = "\33[1m", "\33[1;31m", "\33[1;35m", "\33[1;32m", "\33[0m"


def say(text: str, stream: TextIO | None = None, *, colours: bool = False) -> None:
    """Prints text to a stream, by default the standard output, at once. `colours`: of diagnostics and of the results of
    tests, if the stream wants them."""
    stream = stream or sys.stdout
    safe = printable(text)
    print(coloured(safe, stream) if colours else safe, file=stream, flush=True)


def shown(value: Any) -> Any:
    """A document whose strings are parts of lines, but for those that have several lines."""
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, dict):
        return {
            one_line(name) if isinstance(name, str) else name: item if name in _OF_SEVERAL_LINES else shown(item)
            for name, item in value.items()
        }
    return [shown(item) for item in value] if isinstance(value, list | tuple) else value


def as_json(document: Any) -> str:
    """One line of JSON. It has no numbers that are infinite or NaN: these are strings."""
    return json.dumps(_for_json(document), allow_nan=False)


def _for_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _for_json(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_for_json(item) for item in value]
    if not isinstance(value, float) or math.isfinite(value):
        return value
    from plctool.iec.value_texts import real_text

    return real_text(value)


def wants_colour(stream: TextIO) -> bool:
    """Whether text for a stream may have colours: on a terminal with colours, unless NO_COLOR is set (no-color.org)."""
    return stream.isatty() and os.environ.get("TERM") != "dumb" and not os.environ.get("NO_COLOR")


def coloured(text: str, stream: TextIO) -> str:
    """Diagnostics with location, kind and caret in colours, and results of tests, if the stream wants them."""
    return _DIAGNOSTIC.sub(_colour, text) if wants_colour(stream) else text


def _colour(match: re.Match[str]) -> str:
    location, kind, caret, result = match.groups()
    if result:
        return f"  {_GREEN if result == 'pass' else _RED}{result}{_PLAIN}"
    if caret:
        return f"{_GREEN}{caret}{_PLAIN}"
    return f"{_BOLD}{location}{_PLAIN} {_RED if kind == 'error' else _MAGENTA}{kind}:{_PLAIN}"


def values_text(texts: dict[str, str], separator: str = "\n") -> str:
    """Names and values, as ST writes them."""
    return separator.join(f"{one_line(name)} = {one_line(text)}" for name, text in texts.items())


def table(rows: Sequence[dict[str, Any]], columns: Iterable[str]) -> str:
    """Rows under their column names; numbers are aligned right."""
    names = list(columns)
    cells = [names, *([str(row[name]) for name in names] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(names))]
    right = [bool(rows) and isinstance(rows[0][name], int | float) for name in names]
    lines = [
        "  ".join(
            cell.rjust(width) if r else cell.ljust(width) for cell, width, r in zip(line, widths, right, strict=True)
        )
        for line in cells
    ]
    return "\n".join(line.rstrip() for line in lines)


def show(
    args: argparse.Namespace,
    document: Document,
    text: Callable[[Document], str],
    stream: TextIO | None = None,
    *,
    colours: bool = False,
) -> int:
    """Prints a result for machines or for users."""
    words = as_json(document) if args.json else text(shown(document))
    if words:
        say(words, stream, colours=colours and not args.json)
    return EXIT_OK


def check_one_output(args: argparse.Namespace) -> None:
    """Raises UsageError if a file and the document would both go to the standard output."""
    if args.json and args.output == STDOUT:
        raise UsageError("-o - and --json both write to the standard output; name a file after -o.", "usage")


def beside_output(args: argparse.Namespace) -> TextIO:
    """Where a result is printed that must not be among what goes to the standard output."""
    return sys.stderr if args.output == STDOUT else sys.stdout


def print_warnings(args: argparse.Namespace, warnings: Sequence[str]) -> None:
    if not args.json:
        for warning in warnings:
            say(warning, sys.stderr, colours=True)
