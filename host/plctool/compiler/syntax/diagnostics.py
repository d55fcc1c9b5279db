"""What the compiler has to say about a program.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from typing import Literal

from plctool.compiler.base.missing_names import Use, library_of, table
from plctool.compiler.base.nesting import NestingError
from plctool.compiler.base.source import Source
from plctool.compiler.syntax.warnings import ALL_WARNINGS, MEANINGS, LineRanges, WarningOptions, switched_off
from plctool.compiler.typed.nodes import Pos
from plctool.errors import UsageError, counted
from plctool.errors import did_you_mean as did_you_mean
from plctool.iec.dialect import OWN, Dialect
from plctool.records import dataclass

Severity = Literal["error", "warning"]

MAX_ERRORS = 20  # what follows is seldom news
MAX_MISSING = 10  # places of unknown names that are shown each; of more there is a table
MAX_OF_LIBRARY = 2  # places of names of one known library that are shown each; of more there is one line
MAX_OF_KIND = 20  # warnings of one kind that are shown each; the rest is counted
MAX_MESSAGE = 300  # characters; names may be of any length
_UNCOUNTED = frozenset(("language",))  # errors that hide no others
_BY_OPTION = " (an error because of --werror)"
MAX_LINE = 160  # characters of a source line that are shown with a finding


@dataclass(frozen=True)
class Diagnostic:
    """One finding. `line` and `column` count from 1; `code` is a short slug for machines, `message` one sentence."""

    file: str
    line: int
    column: int
    severity: Severity
    code: str
    message: str
    missing: str = ""  # the name that nothing declares and that no other is like: maybe of a library
    element: str = ""  # of a diagram, with the unit that it is in


class TooManyErrors(Exception):
    """The error limit is reached: checking stops here."""


class Diagnostics:
    """Collects findings, each only once, and stops the check after `limit` errors. The files in `quiet` get no
    warnings."""

    def __init__(
        self,
        quiet: Iterable[str] = (),
        *,
        options: WarningOptions = ALL_WARNINGS,
        dialect: Dialect = OWN,
        limit: int = MAX_ERRORS,
    ) -> None:
        self._quiet = frozenset(quiet)
        self.options = options
        self.dialect = dialect
        self._muted: dict[tuple[str, str], LineRanges] = {}
        self._drawn: dict[str, Source] = {}  # files with diagrams, by path
        self._found: dict[Diagnostic, None] = {}
        self._reported: set[tuple[str, Pos]] = set()  # codes and where
        self.incomplete: set[str] = set()  # units, case-folded, that lack what has an unknown type or base
        self.errors = 0
        self._counted = 0  # errors that are counted to the limit
        self._unknown: set[str] = set()  # what was said of unknown names: said again it does not count
        self._limit = limit

    def error(self, pos: Pos, code: str, message: str) -> None:
        """Records an error; raises TooManyErrors when it is one too many."""
        self._add(pos, "error", code, message)

    def nested_too_deeply(self, error: NestingError) -> None:
        """Reports what goes beyond MAX_DEPTH."""
        self.error(error.pos, "nesting", "this is nested too deeply; split it")

    def missing(self, pos: Pos, name: str, message: str) -> None:
        """Records that nothing is known by a name. These do not count: what a program needs is said in full."""
        self._add(pos, "error", "unknown", message, missing=name)

    def warning(self, pos: Pos, code: str, message: str) -> None:
        """Records a warning, unless it is not wanted; `code` is one of MEANINGS. A dialect may make it an error, which
        cannot be turned off."""
        if code in self.dialect.errors and not self.is_quiet(pos.file):
            self.error(pos, code, f"{message} (an error in the dialect {self.dialect.name})")
            return
        muted = self._muted.get((pos.file, code), ())
        if self.is_quiet(pos.file) or code in self.options.disabled or any(a <= pos.line < b for a, b in muted):
            return
        if self.options.as_errors:
            self._add(pos, "error", code, f"{message}{_BY_OPTION}")
        else:
            self._add(pos, "warning", code, message)

    def has(self, code: str, pos: Pos) -> bool:
        """True if this was reported there: what has the same cause need not be."""
        return (code, pos) in self._reported

    def quiet(self, paths: Iterable[str]) -> None:
        """There are no warnings about these files."""
        self._quiet |= frozenset(paths)

    @property
    def count(self) -> int:
        """How many findings there are."""
        return len(self._found)

    def since(self, count: int) -> list[Diagnostic]:
        """Returns the findings after the first `count`."""
        return list(islice(self._found, count, None))

    def begin_again(self, found: Iterable[Diagnostic]) -> None:
        """Puts these findings, which are warnings, in place of all that there are."""
        self._found = dict.fromkeys(found)
        self._reported = {(d.code, Pos(d.file, d.line, d.column)) for d in self._found}
        self.errors = self._counted = 0

    def is_quiet(self, path: str) -> bool:
        """Whether there are no warnings about a file."""
        return path in self._quiet

    def mute(self, source: Source) -> None:
        """Heeds the pragmas of a text that turn warnings off."""
        for code, ranges in switched_off(source).items():
            self._muted.setdefault((source.path, code), []).extend(ranges)

    def knows(self, source: Source) -> None:
        """Names the elements of diagrams in a file."""
        if source.elements:
            self._drawn[source.path] = source

    @contextmanager
    def apart(self, source: Source) -> Iterator[Callable[[], list[Diagnostic]]]:
        """Collects apart what is found inside the context, about a new text of a file; gives a function that returns
        it. Afterwards all is as before, but for the pragmas of the text."""
        before = self._found, self.errors, self._counted, self._unknown, self.incomplete
        self._found, self.errors, self._counted, self._unknown = {}, 0, 0, set()
        self.incomplete = set(self.incomplete)
        for path, code in [key for key in self._muted if key[0] == source.path]:
            del self._muted[path, code]
        self.mute(source)
        try:
            yield lambda: list(self._found)
        finally:
            self._found, self.errors, self._counted, self._unknown, self.incomplete = before

    def found_by_reader(self, source: Source) -> None:
        """Takes over what the reader of a file found. Diagrams do not count: all are named, and the rest is checked."""
        for found in source.findings:
            pos = Pos(source.path, found.line, found.column)
            if found.severity == "warning":
                self.warning(pos, found.code, found.message)
            else:
                self._add(pos, "error", found.code, found.message, counts=found.code not in _UNCOUNTED)

    def at(self, source: Source) -> SourceDiagnostics:
        """Reports by offset in a source."""
        return SourceDiagnostics(self, source)

    def _add(
        self, pos: Pos, severity: Severity, code: str, message: str, *, counts: bool = True, missing: str = ""
    ) -> None:
        if len(message) > MAX_MESSAGE:
            message = message[: MAX_MESSAGE - 3] + "..."
        drawn = self._drawn.get(pos.file)
        element = "" if drawn is None else drawn.element_at(pos.line, pos.column)
        diagnostic = Diagnostic(pos.file, pos.line, pos.column, severity, code, message, missing, element)
        if diagnostic in self._found:
            return
        self._found[diagnostic] = None
        self._reported.add((code, pos))
        if severity == "error":
            self.errors += 1
            repeated = code == "unknown" and message in self._unknown
            self._unknown.add(message)
            self._counted += counts and not missing and not repeated
            if self._counted >= self._limit:
                raise TooManyErrors

    def sorted(self) -> list[Diagnostic]:
        """All findings by file and place."""
        return sorted(self._found, key=lambda d: (d.file, d.line, d.column, d.severity, d.message))


@dataclass(frozen=True)
class SourceDiagnostics:
    """Findings by their offset in one text."""

    diagnostics: Diagnostics
    source: Source

    def error(self, offset: int, code: str, message: str) -> None:
        """As `Diagnostics.error`."""
        self.diagnostics.error(self.source.pos(offset), code, message)

    def warning(self, offset: int, code: str, message: str) -> None:
        """As `Diagnostics.warning`."""
        self.diagnostics.warning(self.source.pos(offset), code, message)


def render(diagnostic: Diagnostic, sources: Iterable[Source] = ()) -> str:
    """`file.st:12:7: error: message`, and below it the source line with a caret when the file is among `sources`. A
    warning ends with its name: `[integer-division]`. In a diagram the unit and the element follow."""
    d = diagnostic
    is_warning = d.severity == "warning" or d.message.endswith(_BY_OPTION)
    name = f" [{d.code}]" if is_warning and d.code in MEANINGS else ""
    head = f"{d.file}:{d.line}:{d.column}: {d.severity}: {d.message}{name}"
    source = next((s for s in sources if s.path == d.file), None)
    where = f"\n    in {d.element}" if d.element else ""
    if source is None or not source.text:  # "" of a file that is no text
        return f"{head}{where}"
    line, column = _part_of(source.line_text(d.line), d.column - 1)
    indent = "".join("\t" if c == "\t" else " " for c in line[:column])
    return f"{head}\n{line}\n{indent}^{where}"


def render_all(diagnostics: Sequence[Diagnostic], sources: Iterable[Source]) -> list[str]:
    """All findings as people read them, and whether there may be more. Many missing names become one table."""
    listed = _listed([d for d in diagnostics if d.missing])
    hidden = {id(d) for d in listed}
    if listed:  # what is never used may be used with what is missing, and would push the table out of sight
        hidden |= {id(d) for d in diagnostics if d.severity == "warning" and d.code == "unused"}
    single = _folded([d for d in diagnostics if id(d) not in hidden])
    shown, counts = _few_of_each_kind(single)
    texts = [render(d, () if d.code in _UNCOUNTED else sources) for d in shown]
    texts += [
        f"{MAX_OF_KIND} of {count} warnings '{kind}' are shown; --json shows all."
        for kind, count in counts.items()
        if count > MAX_OF_KIND
    ]
    texts += missing_names_text(listed) if listed else []
    if sum(d.severity == "error" and d.code not in _UNCOUNTED and not d.missing for d in single) >= MAX_ERRORS:
        texts.append(f"There may be more than these {MAX_ERRORS} errors; correct some and check again.")
    return texts


def _folded(diagnostics: Sequence[Diagnostic]) -> list[Diagnostic]:
    """One error for each unknown name, at its first place, with the number of the other places."""
    uses = Counter(d.message for d in diagnostics if d.severity == "error" and d.code == "unknown")
    found: list[Diagnostic] = []
    for d in diagnostics:
        count = uses.pop(d.message, 0) if d.severity == "error" and d.code == "unknown" else 1
        if count > 1:
            d = replace(d, message=f"{d.message} (and {counted(count - 1, 'more place')})")
        if count:
            found.append(d)
    return found


def _few_of_each_kind(diagnostics: Sequence[Diagnostic]) -> tuple[list[Diagnostic], Counter[str]]:
    """All errors and the first warnings of each kind, and how many there are of each."""
    shown, counts = [], Counter[str]()
    for d in diagnostics:
        if d.severity == "warning":
            counts[d.code] += 1
        if d.severity == "error" or counts[d.code] <= MAX_OF_KIND:
            shown.append(d)
    return shown, counts


def _listed(missing: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Those that become a table: all when they are many, else those of a library that has several of them."""
    if len(missing) > MAX_MISSING:
        return list(missing)
    counts = Counter(library_of(d.missing) for d in missing)
    return [d for d in missing if (library := library_of(d.missing)) and counts[library] > MAX_OF_LIBRARY]


def missing_names_text(missing: Sequence[Diagnostic]) -> list[str]:
    """What a program needs and nothing declares, by library."""
    return table([Use(d.missing, d.file, d.line) for d in missing])


def _part_of(line: str, column: int) -> tuple[str, int]:
    """What is shown of a line, and the place of its column in that: all, or what fits a terminal around the column."""
    if len(line) <= MAX_LINE:
        return line, column
    begin = max(0, min(column - MAX_LINE // 2, len(line) - MAX_LINE))
    before, behind = "..." * (begin > 0), "..." * (begin + MAX_LINE < len(line))
    return before + line[begin : begin + MAX_LINE] + behind, column - begin + len(before)


class CompileError(UsageError):
    """The program has errors. The message has all diagnostics as users read them; `diagnostics` is for programs."""

    def __init__(self, diagnostics: Sequence[Diagnostic], sources: Sequence[Source]) -> None:
        super().__init__("\n".join(render_all(diagnostics, sources)), "compile")
        self.diagnostics = list(diagnostics)
