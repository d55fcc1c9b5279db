"""Compiles and runs every program of tests/st; tests/st/README.md explains the comments they carry."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pytest

from plctool.compiler import Level, check_sources
from plctool.compiler.codegen.lower_unit import Options, parse_checks
from plctool.compiler.front import CheckResult
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.debug.symbols import SymbolTable
from plctool.iec.literals import string, typed, unsigned
from plctool.iec.types import ELEMENTARY, REAL
from plctool.iec.value_texts import format_date, parse_date
from plctool.iec.values import decode, encode
from plctool.image.targets import DEFAULT_TARGET, find_target
from plctool.sim import Simulator

FOLDER = Path(__file__).parents[1] / "st"
PROGRAMS = sorted(FOLDER.rglob("*.st"))

Value = bool | int | float | str

DIRECTIVE = re.compile(r"^\(\* (run|options|set|expect|expect-exception|expect-error|expect-warning): (.*) \*\)$")
VALUE = re.compile(r"""'(?:[^'$]|\$.)*'|"(?:[^"$]|\$.)*"|\S+""")
DATES = {"D": "DATE", "DATE": "DATE", "TOD": "TOD", "DT": "DT", "LDATE": "LDATE", "LTOD": "LTOD", "LDT": "LDT"}
SKIP = "-"
MAX_REAL = 3.4e38


@dataclass
class Script:
    """What the comments of a program ask for. Lists hold one text per cycle."""

    cycles: int = 0
    time_ms: int = 0
    options: dict[str, str] = field(default_factory=dict)
    sets: dict[str, list[str]] = field(default_factory=dict)
    expected: list[tuple[str, list[str]]] = field(default_factory=list)
    exception: tuple[str, int] | None = None
    diagnostics: list[tuple[str, int, int, list[str]]] = field(default_factory=list)


def directives(path: Path) -> Iterator[tuple[str, str]]:
    for line in path.read_text("utf-8").splitlines():
        if match := DIRECTIVE.match(line):
            yield match[1], match[2]
        elif not line.startswith("(*"):
            return


def read_script(path: Path) -> Script:
    script = Script()
    for kind, text in directives(path):
        if kind in ("set", "expect"):
            name, values = text.split(" = ", 1)
            listed = VALUE.findall(values)
            if kind == "set":
                script.sets[name] = listed
            else:
                script.expected.append((name, listed))
        elif kind == "run":
            key, value = text.split("=", 1)
            if key == "cycles":
                script.cycles = int(value)
            else:
                script.time_ms = int(parse_value(value)) // 1_000_000
        elif kind == "options":
            script.options = dict(part.split("=", 1) for part in text.split())
        elif kind == "expect-exception":
            name, _, line = text.split()
            script.exception = (name, int(line))
        else:
            place, *words = text.split()
            line, column = place.split(":")
            script.diagnostics.append((kind.removeprefix("expect-"), int(line), int(column), words))
    lists = [*script.sets.values(), *(values for _, values in script.expected)]
    script.cycles = max(script.cycles, *map(len, lists), 1) if lists else max(script.cycles, 1)
    return script


def parse_value(text: str) -> Value:
    """The value of a literal of ST; durations in ns, values of enumerations by name."""
    if text in ("TRUE", "FALSE"):
        return text == "TRUE"
    if text.startswith(("'", '"')):
        return string(text)
    if text.isidentifier():
        return text
    if (prefix := text.partition("#")[0]) in DATES:
        return format_date(parse_date(text, ELEMENTARY[DATES[prefix]]), ELEMENTARY[DATES[prefix]])
    if "#" in text and not text[0].isdigit():
        return typed(text)[1]
    sign, digits = (-1, text[1:]) if text.startswith("-") else (1, text)
    number = unsigned(digits)[1]
    assert not isinstance(number, str)
    return sign * number


def equal(actual: Value, expected: str) -> bool:
    """Whether a value read is the one in the comment. Durations are read as text, REALs with the fewest digits."""
    value = parse_value(expected)
    if expected.upper().startswith(("T#", "TIME#", "LTIME#")):
        return isinstance(actual, str) and typed(actual)[1] == value
    if isinstance(value, float):
        single = decode(REAL, encode(REAL, value)) if abs(value) < MAX_REAL else value
        return isinstance(actual, float) and actual in (value, single)
    return type(actual) is type(value) and actual == value


def run_cycle(plc: Simulator, script: Script, cycle: int) -> None:
    for name, values in script.sets.items():
        text = values[min(cycle, len(values) - 1)]
        if text != SKIP and (cycle < len(values)):
            plc.write({name: parse_value(text)})
    plc.run_cycles(1, check=False)


def differences(plc: Simulator, expected: dict[str, str], cycle: int) -> list[str]:
    actual = {name: plc.read(name) for name, text in expected.items() if text != SKIP}
    return [
        f"cycle {cycle}: {name} is {value!r}, not {expected[name]}"
        for name, value in actual.items()
        if not equal(value, expected[name])
    ]


def exception_of(plc: Simulator) -> tuple[str, int] | None:
    """Name and source line of the exception that stopped the program."""
    exception = plc.status().exception
    return None if exception is None else (exception.name, exception.line)


@cache
def checked(path: Path) -> CheckResult:
    """A program with its unit tests as the front end sees it, for all that is built of it."""
    return check_sources([path])


@cache
def build(path: Path, level: Level, checks: str) -> BuildResult:
    """A program as it is built, for all that runs it; of level 0 also for what is looked at as it is lowered."""
    typed_program = checked(path).program
    assert typed_program is not None, "it does not compile"
    return build_program(typed_program, Options(find_target(DEFAULT_TARGET), level, parse_checks(checks)))


def run_program(script: Script, result: BuildResult) -> list[str]:
    """Runs the program; what is not as expected."""
    per_cycle = {name: values for name, values in script.expected if len(values) > 1}
    at_end = {name: values[0] for name, values in script.expected if len(values) == 1}
    wrong = []
    symbols = SymbolTable.from_json(result.symbols.to_json())  # as they come from the file
    with Simulator(result.image, symbols) as plc:
        if script.time_ms:
            plc.run_for(script.time_ms, check=False)
        for cycle in range(0 if script.time_ms else script.cycles):
            run_cycle(plc, script, cycle)
            now = {name: values[cycle] for name, values in per_cycle.items() if cycle < len(values)}
            wrong += differences(plc, now, cycle + 1)
        wrong += differences(plc, at_end, script.cycles)
        seen = exception_of(plc)
    if seen != script.exception:
        wrong.append(f"exception is {seen}, not {script.exception}")
    return wrong


def check_diagnostics(found: list[Diagnostic], script: Script) -> list[str]:
    """Compares what the compiler said with the comments."""
    wrong = []
    by_place: dict[tuple[str, int, int], list[str]] = defaultdict(list)
    for d in found:
        by_place[d.severity, d.line, d.column].append(d.message)
    for severity, line, column, words in script.diagnostics:
        messages = by_place.pop((severity, line, column), [])
        if not any(all(word in message for word in words) for message in messages):
            wrong.append(f"no {severity} at {line}:{column} with {' '.join(words)}; there: {messages}")
    wrong += [
        f"unexpected: {k[1]}:{k[2]}: {m}" for k, messages in by_place.items() if k[0] == "error" for m in messages
    ]
    return wrong


def runs(script: Script) -> bool:
    return not any(severity == "error" for severity, *_ in script.diagnostics)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda p: p.stem)
def test_program(path: Path) -> None:
    script = read_script(path)
    wrong = check_diagnostics(checked(path).diagnostics, script)
    if runs(script):
        wrong += run_program(script, build(path, 2, script.options.get("checks", "all")))
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("path", [p for p in PROGRAMS if runs(read_script(p))], ids=lambda p: p.stem)
def test_program_without_optimisation(path: Path) -> None:
    """What the optimiser makes of it must not depend on luck."""
    script = read_script(path)
    wrong = run_program(script, build(path, 0, script.options.get("checks", "all")))
    assert not wrong, "\n".join(wrong)


def test_every_comment_that_looks_like_a_directive_is_one() -> None:
    """A misspelt directive would make a test that cannot fail."""
    head = re.compile(r"^\(\*\s*(run|options|set|expect)")
    misspelt = [
        f"{path.name}: {line}"
        for path in PROGRAMS
        for line in path.read_text("utf-8").splitlines()
        if head.match(line) and not DIRECTIVE.match(line)
    ]
    assert not misspelt


def test_every_program_is_in_the_folder_of_a_subject() -> None:
    listed = re.findall(r"^\| `(\w+)` \|", (FOLDER / "README.md").read_text(), re.MULTILINE)
    assert {path.parent for path in PROGRAMS} == {FOLDER / name for name in listed}


def test_names_of_programs_differ() -> None:
    assert len({path.name for path in PROGRAMS}) == len(PROGRAMS)


def test_every_program_expects_something() -> None:
    empty = [p.name for p in PROGRAMS if not any(kind.startswith("expect") for kind, _ in directives(p))]
    assert not empty
