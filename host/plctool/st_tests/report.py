"""What became of the tests: for programs, for users, and for continuous integration."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from plctool.compiler.front import Diagnostic, render
from plctool.debug.symbols import SourceLine
from plctool.errors import counted
from plctool.st_tests.coverage import Coverage

if TYPE_CHECKING:
    from plctool.compiler.base.source import Source

TEST_NAME = re.compile(r"TEST_\d+")  # names that `unit_tests.py` gives


@dataclass(frozen=True)
class Failure:
    """Why a test failed. `kind` is the name of the assert, or of the exception; only asserts have values."""

    kind: str
    text: str
    file: str
    line: int
    message: str = ""
    actual: Any = None
    expected: Any = None
    is_exception: bool = False
    pou: str | None = None  # where an exception happened
    calls: Sequence[SourceLine] = ()  # led there, the nearest first

    def document(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {**vars(self), "calls": [vars(call) for call in self.calls]}


@dataclass(frozen=True)
class Outcome:
    """What became of a test; `failure` is None when it passed."""

    name: str
    file: str
    line: int
    seconds: float
    failure: Failure | None


@dataclass(frozen=True)
class Report:
    """All outcomes in the order of the sources. `seconds`: with compiling. `warnings`: of the compiler. `coverage`: if
    it is wanted."""

    outcomes: list[Outcome]
    seconds: float
    sources: Sequence[Source]
    warnings: Sequence[Diagnostic] = ()
    coverage: Coverage | None = None

    @property
    def failed(self) -> int:
        return sum(outcome.failure is not None for outcome in self.outcomes)

    def warning_texts(self) -> list[str]:
        """The warnings with their lines, as `check` prints them."""
        return [render(warning, self.sources) for warning in self.warnings]

    def document(self) -> dict[str, Any]:
        """What `--json` prints."""
        tests = []
        for outcome in self.outcomes:
            failure = outcome.failure.document() if outcome.failure else None
            tests.append({**vars(outcome), "passed": failure is None, "failure": failure})
        passed = len(tests) - self.failed
        return {
            "tests": tests,
            "passed": passed,
            "failed": self.failed,
            "seconds": round(self.seconds, 3),
            "warnings": [asdict(warning) for warning in self.warnings],
            "coverage": self.coverage and self.coverage.document(),
        }


# ---- for people ------------------------------------------------------------------------------------------------------


def report_text(report: Report) -> str:
    """The tests by file, what failed and where, and the sum."""
    lines: list[str] = []
    file = ""
    for outcome in report.outcomes:
        if outcome.file != file:
            file = outcome.file
            lines.append(file)
        if outcome.failure is None:
            lines.append(f"  pass  {outcome.name}")
        else:
            lines.append(f"  FAIL  {outcome.name}")
            lines += [f"        {line}" for line in _failure_lines(outcome.failure, report.sources)]
    failed, total = report.failed, len(report.outcomes)
    lines.append("")
    lines.append(f"{counted(total, 'test')}, {total - failed} passed, {failed} failed ({report.seconds:.2f} s)")
    if report.coverage is not None:
        lines += ["", report.coverage.text()]
    return "\n".join(lines)


def failure_text(failure: Failure, sources: Sequence[Source]) -> str:
    """Where and why a test failed, with the source line and the calls that led there."""
    return "\n".join(_failure_lines(failure, sources))


def _failure_lines(failure: Failure, sources: Sequence[Source]) -> Iterator[str]:
    message = f" ({failure.message})" if failure.message else ""
    yield f"{failure.file}:{failure.line}: {failure.kind}: {failure.text}{message}"
    source = next((s for s in sources if s.path == failure.file), None)
    if source is not None:
        yield f"    {source.line_text(failure.line).strip()}"
    for call in failure.calls:
        unit = "" if TEST_NAME.fullmatch(call.pou) else f"{call.pou}, "
        yield f"called from {unit}{call.file}:{call.line}"


# ---- for continuous integration --------------------------------------------------------------------------------------


def junit_xml(report: Report) -> bytes:
    """The report as JUnit XML: a suite per file; asserts are failures, exceptions are errors."""
    root = ElementTree.Element("testsuites", _totals(report.outcomes), name="plctool test")
    for file in dict.fromkeys(outcome.file for outcome in report.outcomes):
        outcomes = [outcome for outcome in report.outcomes if outcome.file == file]
        suite = ElementTree.SubElement(root, "testsuite", _totals(outcomes), name=_printable(file))
        for outcome in outcomes:
            case = ElementTree.SubElement(
                suite, "testcase", classname=_printable(Path(file).stem), name=_printable(outcome.name),
                file=_printable(file), line=str(outcome.line), time=f"{outcome.seconds:.6f}",
            )  # fmt: skip
            if outcome.failure is not None:
                _add_failure(case, outcome.failure, report.sources)
    ElementTree.indent(root)
    data: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def _totals(outcomes: Sequence[Outcome]) -> dict[str, str]:
    exceptions = [o.failure.is_exception for o in outcomes if o.failure is not None]
    return {
        "tests": str(len(outcomes)),
        "failures": str(exceptions.count(False)),
        "errors": str(exceptions.count(True)),
        "time": f"{sum(o.seconds for o in outcomes):.6f}",
    }


def _add_failure(case: ElementTree.Element, failure: Failure, sources: Sequence[Source]) -> None:
    tag = "error" if failure.is_exception else "failure"
    message = _printable(f"{failure.kind}: {failure.text}")
    element = ElementTree.SubElement(case, tag, message=message, type=failure.kind)
    element.text = "\n".join(map(_printable, _failure_lines(failure, sources)))


def _printable(text: str) -> str:
    """Without the characters XML cannot hold."""
    return "".join(c if c.isprintable() or c == "\t" else "?" for c in text)
