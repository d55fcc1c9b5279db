"""Runs the unit tests of a program (TEST ... END_TEST) in this process, each from a cold start, and reports on them."""

from __future__ import annotations

import platform
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from plctool.compiler import CompileError, load_sources
from plctool.compiler.build import BuildResult, build_program
from plctool.compiler.codegen.lower_init import encode_scalar
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import Diagnostic, check_sources, render
from plctool.compiler.internal import bugs_reported
from plctool.compiler.semantics.unit_test_statements import FAILED, NUMBER, Assertion, Operand
from plctool.compiler.semantics.unit_tests import TestCase, TestSuite
from plctool.compiler.warnings import ALL_WARNINGS, WarningOptions
from plctool.core import ffi, lib
from plctool.debug.symbols import SourceLine
from plctool.device import ExceptionInfo, explain_exception
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.iec.value_texts import literal
from plctool.iec.values import decode
from plctool.image.targets import DEFAULT_TARGET, TARGETS, find_target
from plctool.sim import Simulator

if TYPE_CHECKING:
    from plctool.compiler.source import Source

_TEST = re.compile(r"TEST_\d+")  # names that `unit_tests.py` gives
_IN_TEST = re.compile(r"TEST_\d+|SETUP|TEARDOWN")
_COMPARED = {"ASSERT_GT": "> ", "ASSERT_GE": ">= ", "ASSERT_LT": "< ", "ASSERT_LE": "<= "}
_EXCEPTIONS = {
    lib.RTSEXCPT_DIVIDEBYZERO: "division by zero",
    lib.RTSEXCPT_ARRAYBOUNDS: "an index or value is out of bounds",
    lib.RTSEXCPT_ACCESS_VIOLATION: "access to memory that is not there, perhaps through a NULL pointer",
    lib.RTSEXCPT_WATCHDOG: "this takes too long, perhaps it is an endless loop",
    lib.RTSEXCPT_STACK_OVERFLOW: "the stack is too small for this",
    lib.RTSEXCPT_UNRESOLVED_EXTREFS: "this function is implemented in C and not here; mock it with MOCK_FUNCTION",
}


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
    """All outcomes in the order of the sources. `seconds`: with compiling. `warnings`: of the compiler."""

    outcomes: list[Outcome]
    seconds: float
    sources: Sequence[Source]
    warnings: Sequence[Diagnostic] = ()

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
        }


def run_tests(
    paths: Sequence[Path | str], *, pattern: str = "*", level: int = 0, warnings: WarningOptions = ALL_WARNINGS
) -> Report:
    """Runs the tests in sources whose name fits `pattern`: with * and ? all of it, else it holds the pattern; upper and
    lower case are the same.

    `level`: optimisation; the lowest compiles fastest, and the results are the same. Raises CompileError when the
    program has errors, UsageError when there are no tests.
    """
    begin = time.perf_counter()
    sources = load_sources(paths)
    suite = TestSuite()
    with _power(), bugs_reported():
        checked = check_sources(sources, tests=suite, warnings=warnings)
    if checked.program is None:
        raise CompileError([d for d in checked.diagnostics if d.severity == "error"], sources)
    chosen = [i for i, case in enumerate(suite.cases) if _fits(case.name.casefold(), pattern.casefold())]
    if not chosen:
        what = f"no test fits '{pattern}'" if suite.cases else "there are no tests: write TEST 'name' ... END_TEST"
        raise UsageError(f"{what[:1].upper()}{what[1:]}.", "no-tests")
    here = f"{platform.machine()}-linux"
    target = find_target(here if here in TARGETS else DEFAULT_TARGET)
    with bugs_reported():
        built = build_program(checked.program, Options(target, level))
    with Simulator(built.image, built.symbols, start=False) as plc:
        bench = _Bench(plc, built, suite, checked.program.area_sizes)
        outcomes = [bench.run(number) for number in chosen]
    return Report(outcomes, time.perf_counter() - begin, sources, checked.diagnostics)


def _fits(name: str, pattern: str) -> bool:
    return fnmatch(name, pattern) if any(c in pattern for c in "*?[") else pattern in name


@contextmanager
def _power() -> Iterator[None]:
    """The simulator without a program: so that the compiler can see which C functions there are."""
    lib.SimStart()
    try:
        yield
    finally:
        lib.SimStop()


class _Bench:
    """Runs one test after the other."""

    def __init__(self, plc: Simulator, built: BuildResult, suite: TestSuite, sizes: dict[Area, int]) -> None:
        self._plc = plc
        self._sizes = sizes
        self._built = built
        self._suite = suite

    def run(self, number: int) -> Outcome:
        plc, case = self._plc, self._suite.cases[number]
        begin = time.perf_counter()
        plc.reset(lib.RESET_OPTION_COLD)
        failure = self._exception(case)
        if failure is None:
            self._cycle(number)
            failure = self._exception(case) or self._assert()
            teardown = self._suite.teardown_of(case)
            if failure is not None and failure.is_exception and teardown is not None:
                self._continue(teardown)
        return Outcome(case.name, case.pos.file, case.pos.line, time.perf_counter() - begin, failure)

    def _cycle(self, number: int) -> None:
        self._plc.write(NUMBER, number)
        self._plc.start()
        self._plc.run_cycles(1)

    def _continue(self, number: int) -> None:
        """Runs what has this number on the variables as they are after an exception."""
        areas = {lib.AppGetAreaAddress(area.value, 0, size): size for area, size in self._sizes.items() if size}
        kept = {address: bytes(ffi.buffer(address, size)) for address, size in areas.items()}
        self._plc.reset(lib.RESET_OPTION_COLD)
        for address, content in kept.items():
            ffi.memmove(address, content, len(content))
        self._cycle(number)

    def _exception(self, case: TestCase) -> Failure | None:
        exception = self._plc.status().exception
        if exception is None:
            return None
        info = explain_exception(exception, None, self._built.symbols)
        where = f" in {info.pou}" if info.pou and not _TEST.fullmatch(info.pou) else ""
        text = _EXCEPTIONS.get(exception.code, "run-time exception") + where
        place = (info.file, info.line) if info.file and info.line else (case.pos.file, case.pos.line)
        return Failure(info.name, text, *place, is_exception=True, pou=info.pou, calls=_calls(info))

    def _assert(self) -> Failure | None:
        number = self._plc.read(FAILED)
        if number == 0:
            return None
        assertion = self._suite.asserts[number - 1]
        actual, expected = self._value(assertion.actual), self._value(assertion.expected)
        message = str(self._value(assertion.message)) if assertion.message else ""
        text = self._text(assertion, actual, expected)
        return Failure(assertion.name, text, assertion.pos.file, assertion.pos.line, message, actual, expected)

    def _value(self, operand: Operand) -> Any:
        if operand.variable:
            return self._plc.read(operand.variable)
        return decode(operand.type, encode_scalar(operand.value, operand.type))

    def _text(self, assertion: Assertion, actual: Any, expected: Any) -> str:
        name, got = assertion.name, literal(assertion.actual.type, actual)
        if name == "MOCK_VERIFY_CALLED":
            return "expected a call, got none"
        wanted = _COMPARED.get(name, "") + literal(assertion.expected.type, expected)
        if name == "MOCK_VERIFY_CALL_COUNT":
            return f"expected {wanted} calls, got {got}"
        if name == "ASSERT_NEQ":
            return f"expected anything but {wanted}"
        if assertion.tolerance is not None:
            wanted += f" +- {literal(assertion.tolerance.type, self._value(assertion.tolerance))}"
        return f"expected {wanted}, got {got}"


def _calls(exception: ExceptionInfo) -> list[SourceLine]:
    """The calls between the test and the exception. What calls the test is ours."""
    if _IN_TEST.fullmatch(exception.pou or ""):
        return []
    first = next((i for i, call in enumerate(exception.calls) if _IN_TEST.fullmatch(call.pou)), len(exception.calls))
    return exception.calls[: first + 1]


# ---- for people ------------------------------------------------------------------------------------------------------


def report_text(report: Report, *, colour: bool = False) -> str:
    """The tests by file, what failed and where, and the sum."""
    green, red, plain = ("\033[32m", "\033[31m", "\033[0m") if colour else ("", "", "")
    lines: list[str] = []
    file = ""
    for outcome in report.outcomes:
        if outcome.file != file:
            file = outcome.file
            lines.append(file)
        if outcome.failure is None:
            lines.append(f"  {green}pass{plain}  {outcome.name}")
        else:
            lines.append(f"  {red}FAIL{plain}  {outcome.name}")
            lines += [f"        {line}" for line in _failure_lines(outcome.failure, report.sources)]
    failed, total = report.failed, len(report.outcomes)
    lines.append("")
    lines.append(f"{total} tests, {total - failed} passed, {failed} failed ({report.seconds:.2f} s)")
    return "\n".join(lines)


def _failure_lines(failure: Failure, sources: Sequence[Source]) -> Iterator[str]:
    message = f" ({failure.message})" if failure.message else ""
    yield f"{failure.file}:{failure.line}: {failure.kind}: {failure.text}{message}"
    source = next((s for s in sources if s.path == failure.file), None)
    if source is not None:
        yield f"    {source.line_text(failure.line).strip()}"
    for call in failure.calls:
        unit = "" if _TEST.fullmatch(call.pou) else f"{call.pou}, "
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
