"""Runs the tests, each from a cold start."""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, TypeVar

from plctool.compiler import CompileError, IoFiles, Sources, io_sources, library_sources, program_files
from plctool.compiler.base.internal import bugs_reported
from plctool.compiler.codegen.lower_init import encode_scalar
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.kept.tree_cache import trees_of_user
from plctool.compiler.semantics.assertions import FAILED, LIVE, NUMBER, Assertion, Operand
from plctool.compiler.semantics.statement_marks import StatementMarks
from plctool.compiler.semantics.unit_tests import TestCase, TestSuite
from plctool.compiler.syntax.warnings import ALL_WARNINGS, WarningOptions
from plctool.controller import ExceptionInfo
from plctool.core import lib
from plctool.debug.symbols import SourceLine
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.iec.dialect import find_dialect
from plctool.iec.value_texts import literal
from plctool.iec.values import decode
from plctool.image.targets import find_target, host_target
from plctool.sim import Simulator, is_debugged
from plctool.st_tests.coverage import Coverage, marked
from plctool.st_tests.devices import Devices
from plctool.st_tests.report import TEST_NAME, Failure, Outcome, Report

LIMIT_MS = 10_000
"""Time of the processor after which a test is taken for an endless loop: it may be millions of cycles of a program."""

_IN_TEST = re.compile(rf"{TEST_NAME.pattern}|SETUP|TEARDOWN")
_COMPARED = {"ASSERT_GT": "> ", "ASSERT_GE": ">= ", "ASSERT_LT": "< ", "ASSERT_LE": "<= "}
_EXCEPTIONS = {
    lib.RTSEXCPT_DIVIDEBYZERO: "division by zero",
    lib.RTSEXCPT_ARRAYBOUNDS: "an index or value is out of bounds",
    lib.RTSEXCPT_ACCESS_VIOLATION: "access to memory that does not exist, perhaps through a NULL pointer",
    lib.RTSEXCPT_WATCHDOG: "the test takes too long, perhaps in an endless loop",
    lib.RTSEXCPT_STACK_OVERFLOW: "the stack is too small for this",
    lib.RTSEXCPT_UNRESOLVED_EXTREFS: "this function is implemented in C on the device; mock it with MOCK_FUNCTION",
}


def run_tests(
    paths: Sources,
    *,
    pattern: str = "*",
    level: int = 0,
    warnings: WarningOptions = ALL_WARNINGS,
    io: IoFiles | None = None,
    libraries: Sequence[Path | str] = (),
    coverage: bool = False,
    dialect: str | None = None,
) -> Report:
    """Runs the tests in sources whose name matches `pattern` (with * and ?) or contains it; case does not matter.

    `level`: optimisation; the lowest compiles fastest, and the results are the same. `io`: inputs and outputs;
    `libraries`: those it uses; `coverage`: whether to note which statements run;
    `dialect`: as in `compile_sources`. Raises CompileError when the program
    has errors, UsageError when there are no tests.
    """
    begin = time.perf_counter()
    program = TestProgram(
        paths, level=level, warnings=warnings, io=io, libraries=libraries, coverage=coverage, dialect=dialect
    )
    return run_chosen(program, program.find(pattern), begin)


def run_chosen(program: TestProgram, chosen: Sequence[int], begin: float | None = None) -> Report:
    """Runs the tests with these indices. `begin`: when the work for the report began."""
    begin = time.perf_counter() if begin is None else begin
    outcomes = list(program.run(chosen))
    return Report(outcomes, time.perf_counter() - begin, program.sources, program.diagnostics, program.coverage)


class TestProgram:
    """A program with its tests, compiled when the first one runs. `cases`: the tests, in the order of the sources;
    `diagnostics`: warnings of the compiler; `io`: inputs and outputs; `coverage`: which statements ran, if that is
    wanted; `debug`: for a debugger. Raises CompileError when the program has errors."""

    __test__ = False  # nothing for pytest to collect

    def __init__(
        self,
        paths: Sources,
        *,
        level: int = 0,
        warnings: WarningOptions = ALL_WARNINGS,
        io: IoFiles | None = None,
        libraries: Sequence[Path | str] = (),
        coverage: bool = False,
        dialect: str | None = None,
        debug: bool = False,
    ) -> None:
        files = program_files(paths, io, libraries)
        description, imported = files.load_io(), files.load_libraries()
        self.sources = files.load_sources()
        system = find_dialect(dialect)
        marks = StatementMarks() if coverage else None
        self._suite = TestSuite(marks)
        self._level = level
        self._debug = debug
        with _power(), bugs_reported():
            checked = check_sources(
                self.sources,
                tests=self._suite,
                warnings=warnings,
                io=description,
                libraries=imported,
                dialect=system,
                trees=trees_of_user(),
                information=files.information,
            )
        self.sources += [*io_sources(description), *library_sources(imported)]
        if checked.program is None:
            raise CompileError([d for d in checked.diagnostics if d.severity == "error"], self.sources)
        self._program = checked.program
        self.cases = self._suite.cases
        self.coverage = Coverage(marks.places, self.sources) if marks else None
        self.diagnostics = checked.diagnostics

    @cached_property
    def _built(self) -> BuildResult:
        with bugs_reported():
            debug = self._debug or is_debugged()
            options = Options(find_target(host_target()), 0 if debug else self._level, debug=debug)
            return build_program(self._program, options, keeps=False)  # each test starts on fresh variables

    def find(self, pattern: str) -> list[int]:
        """The tests whose name matches a pattern (with * and ?) or contains it. Raises UsageError if none does."""
        chosen = [i for i, case in enumerate(self.cases) if _fits(case.name.casefold(), pattern.casefold())]
        if not chosen:
            what = (
                f"No test matches '{pattern}'" if self.cases else "There are no tests: write TEST 'name' ... END_TEST"
            )
            raise UsageError(f"{what}.", "no-tests")
        return chosen

    def run(self, numbers: Iterable[int]) -> Iterator[Outcome]:
        """Runs the tests with these indices in `cases`, each from a cold start."""
        built = self._built
        sizes = self._program.area_sizes
        devices = Devices(sizes[Area.INPUT], LIMIT_MS)
        called = devices.functions
        with Simulator(built.image, built.symbols, start=False, cycle_limit_ms=LIMIT_MS, functions=called) as plc:
            bench = _Bench(plc, devices, self._suite, sizes)
            for number in numbers:
                outcome = bench.run(number)
                if self.coverage is not None:
                    self.coverage.add(marked(plc))
                yield outcome


def _fits(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern.replace("[", "[[]")) if any(c in pattern for c in "*?") else pattern in name


@contextmanager
def _power() -> Iterator[None]:
    """The first simulator is on, with or without a program: so that the compiler can see which C functions there
    are."""
    begin = not lib.SimIsOn()
    if begin:
        lib.SimStart()
    try:
        yield
    finally:
        if begin:
            lib.SimStop()


class _Bench:
    """Runs one test after the other."""

    def __init__(self, plc: Simulator, devices: Devices, suite: TestSuite, sizes: dict[Area, int]) -> None:
        self._plc = plc
        self._devices = devices
        self._sizes = sizes
        self._suite = suite

    def run(self, number: int) -> Outcome:
        plc, case = self._plc, self._suite.cases[number]
        begin = time.perf_counter()
        self._devices.prepare(plc, case)
        plc.reset("cold")
        failure = self._exception(case)
        if failure is None:
            self._cycle(number, live=bool(case.faults))
            failure = self._exception(case) or self._assert()
            teardown = self._suite.teardown_of(case)
            if failure is not None and failure.is_exception and teardown is not None:
                self._continue(teardown, live=bool(case.faults))
        return Outcome(case.name, case.pos.file, case.pos.line, time.perf_counter() - begin, failure)

    def _cycle(self, number: int, *, live: bool) -> None:
        self._plc.write({NUMBER: number, LIVE: live})
        self._plc.start()
        self._plc.run_cycles(1, check=False)

    def _continue(self, number: int, *, live: bool) -> None:
        """Runs the test with this number on the variables as they are after an exception."""
        areas = [self._plc.memory(area, 0, size) for area, size in self._sizes.items() if size]
        kept = [bytes(area) for area in areas]
        self._plc.reset("cold")
        for area, content in zip(areas, kept, strict=True):
            area[:] = content
        self._cycle(number, live=live)

    def _exception(self, case: TestCase) -> Failure | None:
        info = self._plc.status().exception
        if info is None:
            return None
        where = f" in {info.pou}" if info.pou and not TEST_NAME.fullmatch(info.pou) else ""
        text = (info.detail or _EXCEPTIONS.get(info.code, "run-time exception")) + where
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
    return up_to_test(exception.calls)


class _HasPou(Protocol):
    @property
    def pou(self) -> str: ...


_C = TypeVar("_C", bound=_HasPou)


def up_to_test(calls: Sequence[_C]) -> list[_C]:
    """Calls, the nearest first, without what calls the test."""
    first = next((i for i, call in enumerate(calls) if _IN_TEST.fullmatch(call.pou)), len(calls))
    return list(calls[: first + 1])
