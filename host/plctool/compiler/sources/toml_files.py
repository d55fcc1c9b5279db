"""TOML files that belong to a program: their mistakes are shown as those of sources are.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.diagnostics import CompileError, Diagnostic
from plctool.errors import UsageError
from plctool.files import Pos
from plctool.io.mistakes import Mistake, Mistakes
from plctool.io.positions import BadToml, TomlText
from plctool.io.tables import Table

T = TypeVar("T")


def read_checked(path: str, text: str, what: str, read: Callable[[Table], T]) -> T:
    """What `read` makes of a TOML text. Raises CompileError with all mistakes in it, each with its location. `what`:
    how messages call the file."""
    mistakes, made = Mistakes(), None
    try:
        toml = TomlText(path, text)
        table = Table(toml, (), toml.values, mistakes, what)
        made = read(table)
        table.close()
    except BadToml as error:
        mistakes.error(error.pos, error.message)
    if mistakes.found or made is None:
        raise errors_at(mistakes.found, path, text)
    return made


def error_at(pos: Pos, message: str, text: str) -> UsageError:
    """The same for one mistake, in a file with this text, that is seen from outside."""
    return errors_at([Mistake(pos, message)], pos.file, text)


def errors_at(mistakes: Sequence[Mistake], path: str, text: str) -> UsageError:
    """The same for all mistakes of a file that are found after it was read."""
    found = sorted(mistakes, key=lambda m: (m.pos.line, m.pos.column))
    diagnostics = [Diagnostic(m.pos.file, m.pos.line, m.pos.column, m.severity, "toml", m.message) for m in found]
    return CompileError(diagnostics, [Source(path, text)])
