"""Diagnostics as the editor shows them: only files whose diagnostics have changed are sent."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from lsprotocol import types as lsp

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.files import Pos, read_regular
from plctool.lsp import positions
from plctool.lsp.session import Session

SOURCE = "plctool"  # of diagnostics
MAX_SHOWN = 1000  # diagnostics of a file
_WORD = re.compile(r"\w+|:=|=>|<=|>=|<>|\*\*|'[^'\n]*'|\S")
_MAX_TEXT = 8 << 20


class Published:
    """What was sent. `send` sends the diagnostics of a file."""

    def __init__(self, session: Session, send: Callable[[lsp.PublishDiagnosticsParams], None]) -> None:
        self._session = session
        self._send = send
        self._sent: dict[object, dict[str, tuple[Diagnostic, ...]]] = {}

    def update(self, key: object, diagnostics: Iterable[Diagnostic], sources: Sequence[Source]) -> None:
        """Sends what has changed of a program."""
        by_file: dict[str, list[Diagnostic]] = {}
        for diagnostic in diagnostics:
            by_file.setdefault(diagnostic.file, []).append(diagnostic)
        before = self._sent.get(key, {})
        after = {file: tuple(found) for file, found in by_file.items()}
        self._sent[key] = after
        by_path = {source.path: source for source in sources}
        for file in dict.fromkeys((*before, *after)):
            if before.get(file) != after.get(file) and Path(file).is_absolute():
                self._send_file(file, by_path)

    def update_file(self, key: object, file: str, diagnostics: Sequence[Diagnostic], source: Source) -> None:
        """Sends those of one file, if they have changed."""
        known = self._sent.setdefault(key, {})
        if known.get(file, ()) != tuple(diagnostics):
            known[file] = tuple(diagnostics)
            self._send_file(file, {file: source})

    def of(self, key: object, file: str) -> tuple[Diagnostic, ...]:
        """Returns what was last found in a file."""
        return self._sent.get(key, {}).get(file, ())

    def forget(self, key: object) -> None:
        """Takes back all diagnostics of a program."""
        self.update(key, (), ())
        self._sent.pop(key, None)

    def _send_file(self, file: str, sources: dict[str, Source]) -> None:
        """Sends what all programs have found in a file; several may have it."""
        found = dict.fromkeys(d for of_program in self._sent.values() for d in of_program.get(file, ()))
        source = sources.get(file) or Source(file, _text_of(file) if found else "")
        shown = [self.shown(d, source) for d in list(found)[:MAX_SHOWN]]
        self._send(lsp.PublishDiagnosticsParams(positions.uri_of(file), shown))

    def shown(self, diagnostic: Diagnostic, source: Source) -> lsp.Diagnostic:
        """Returns a diagnostic for the editor; its range is the word at its place."""
        line = source.line_text(diagnostic.line)
        word = _WORD.match(line, diagnostic.column - 1)
        length = len(word.group()) if word else 1
        encoding = self._session.encoding
        first = positions.position_at(source, Pos(*_place(diagnostic)), encoding)
        file, number, column = _place(diagnostic)
        last = positions.position_at(source, Pos(file, number, column + length), encoding)
        severities = lsp.DiagnosticSeverity
        unused = diagnostic.code in ("unused", "unreachable", "uncalled")
        return lsp.Diagnostic(
            lsp.Range(first, last),
            f"{diagnostic.message} (in {diagnostic.element})" if diagnostic.element else diagnostic.message,
            severities.Error if diagnostic.severity == "error" else severities.Warning,
            diagnostic.code,
            source=SOURCE,
            tags=[lsp.DiagnosticTag.Unnecessary] if unused else None,
        )


def _place(diagnostic: Diagnostic) -> tuple[str, int, int]:
    return diagnostic.file, max(1, diagnostic.line), max(1, diagnostic.column)


def _text_of(file: str) -> str:
    try:
        return read_regular(Path(file), _MAX_TEXT).decode("utf-8", "replace")
    except OSError:
        return ""
