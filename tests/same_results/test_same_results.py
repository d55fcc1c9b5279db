"""The programs of tests/st give the same bytes in every area after every cycle on every target, exceptions included.

The simulator on this machine says what is right; each other target runs all programs in one start of QEMU.
"""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "compiler"))

from runners import RUNNERS, Runner
from test_st_programs import PROGRAMS, Script, read_script, run_cycle

from plctool.compiler import load_sources
from plctool.compiler.build import BuildResult, build_program
from plctool.compiler.front import check_sources
from plctool.compiler.lower_unit import Options, parse_checks
from plctool.compiler.targets import TARGETS, find_target
from plctool.compiler.typed import Area, TypedProgram
from plctool.compiler.types import LREAL, REAL, PointerType, StringType
from plctool.core import ffi, lib
from plctool.sim import Simulator
from plctool.symbols import Symbol

REFERENCE = "x86_64-linux"
AREAS = (Area.DATA, Area.RETAIN, Area.OUTPUT, Area.MEMORY)
STEP_CYCLES, STEP_MS = 0, 1

if sys.platform != "linux" or TARGETS[REFERENCE].device_id == "":
    pytest.skip("the reference is the simulator on x86-64", allow_module_level=True)


@dataclass(frozen=True)
class State:
    """Exception (code, source line, task) or None, and the bytes of each of AREAS."""

    exception: tuple[int, int, int] | None
    areas: tuple[bytes, ...]


@dataclass
class Step:
    """What happens before and in a step; `writes`: area, offset, bytes."""

    kind: int
    amount: int
    writes: list[tuple[int, int, bytes]] = field(default_factory=list)


@dataclass
class Recording:
    """A program and what it did on the reference."""

    path: Path
    script: Script
    typed: TypedProgram
    built: BuildResult
    steps: list[Step] = field(default_factory=list)
    states: list[State] = field(default_factory=list)

    @cached_property
    def leaves(self) -> list[Symbol]:
        """Every scalar and string in memory that has a name."""
        symbols = self.built.symbols
        found = [leaf for symbol in symbols.variables.values() for leaf in symbols.leaves(symbol)]
        return [leaf for leaf in found if Area(leaf.area) in AREAS and leaf.bit is None]


class Recorder(Simulator):
    """A simulator that remembers what was written."""

    writes: list[tuple[int, int, bytes]]

    def write(self, name: str, value: object) -> None:
        super().write(name, value)
        symbol = self._resolve(name)
        self.writes.append((symbol.area, symbol.offset, bytes(ffi.buffer(self._address(symbol), symbol.size))))


def exception_line(built: BuildResult, code_offset: int | None) -> int:
    place = built.symbols.address_to_line(code_offset - 1) if code_offset is not None else None
    return place.line if place else 0


def state_of(plc: Simulator, built: BuildResult) -> State:
    exception = plc.status().exception
    sizes = [lib.AppGetAreaSize(area.value) for area in AREAS]
    areas = (bytes(ffi.buffer(lib.AppGetAreaAddress(a.value, 0, n), n)) for a, n in zip(AREAS, sizes, strict=True))
    return State(
        (exception.code, exception_line(built, exception.code_offset), exception.task) if exception else None,
        tuple(areas),
    )


def compile_for(recording_target: str, typed: TypedProgram, script: Script) -> BuildResult:
    level, checks = int(script.options.get("level", "2")), script.options.get("checks", "all")
    return build_program(typed, Options(find_target(recording_target), level, parse_checks(checks)))


def record(path: Path, script: Script, typed: TypedProgram) -> Recording:
    """Runs a program on the reference."""
    recording = Recording(path, script, typed, compile_for(REFERENCE, typed, script))
    with Recorder(recording.built.image, recording.built.symbols) as plc:
        for cycle in range(1 if script.time_ms else script.cycles):
            plc.writes = []
            if script.time_ms:
                plc.run_for(script.time_ms)
                recording.steps.append(Step(STEP_MS, script.time_ms))
            else:
                run_cycle(plc, script, cycle)
                recording.steps.append(Step(STEP_CYCLES, 1, plc.writes))
            recording.states.append(state_of(plc, recording.built))
    return recording


@cache
def recordings() -> list[Recording]:
    """All programs that compile, with what they do on the reference."""
    found = []
    for path in PROGRAMS:
        script = read_script(path)
        program = check_sources(load_sources([path])).program
        if program is not None and not any(severity == "error" for severity, *_ in script.diagnostics):
            found.append(record(path, script, program))
    return found


# ---- the runner's files --------------------------------------------------------------------------------------------


def padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def batch_entry(recording: Recording, image: bytes) -> bytes:
    out = [struct.pack("<I", len(image)), padded(image), struct.pack("<I", len(recording.steps))]
    for step in recording.steps:
        out.append(struct.pack("<III", step.kind, step.amount, len(step.writes)))
        out += [struct.pack("<III", area, offset, len(data)) + padded(data) for area, offset, data in step.writes]
    return b"".join(out)


class Reader:
    """Takes numbers and bytes from the results of a runner."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def number(self) -> int:
        return int(struct.unpack("<I", self.take(4))[0])

    def take(self, size: int) -> bytes:
        assert self._at + size <= len(self._data), "the results end early"
        self._at += size
        return self._data[self._at - size : self._at]


def read_states(reader: Reader, recording: Recording, built: BuildResult) -> Iterator[State]:
    result = reader.number()
    assert result == lib.ERR_OK, f"{recording.path.stem} was refused with error {result}"
    for state in recording.states:
        code, offset, task = reader.number(), reader.number(), reader.number()
        line = exception_line(built, None if offset == 0xFFFFFFFF else offset)
        exception = (code, line, task) if code else None
        yield State(exception, tuple(reader.take(len(area)) for area in state.areas))


# ---- the comparison ------------------------------------------------------------------------------------------------


def is_nan(data: bytes) -> bool:
    return bool(math.isnan(struct.unpack("<f" if len(data) == 4 else "<d", data)[0]))


def value_of(leaf: Symbol, data: bytes) -> bytes:
    """The bytes of a variable that its value consists of; zeros for those that are nobody's.

    These are what lies behind the end of a string, which of the many not-a-numbers it is, and addresses.
    """
    if isinstance(leaf.type, StringType):
        return data.partition(b"\0")[0].ljust(len(data), b"\0")
    if isinstance(leaf.type, PointerType) or (leaf.type in (REAL, LREAL) and is_nan(data)):
        return bytes([any(data)]).ljust(len(data), b"\0")
    return data


def comparable(recording: Recording, state: State) -> tuple[bytearray, ...]:
    """The areas with what is no value wiped out."""
    areas = tuple(map(bytearray, state.areas))
    for leaf in recording.leaves:
        data = areas[AREAS.index(Area(leaf.area))]
        data[leaf.offset : leaf.offset + leaf.size] = value_of(leaf, bytes(data[leaf.offset : leaf.offset + leaf.size]))
    return areas


def describe(recording: Recording, area: Area, offset: int, want: bytes, got: bytes) -> str:
    """The variable at a place and what it is, for people."""
    for leaf in recording.leaves:
        if leaf.area == area.value and leaf.offset <= offset < leaf.offset + leaf.size:
            place = slice(leaf.offset, leaf.offset + leaf.size)
            return f"{leaf.name} is {leaf.decode(got[place])!r} in place of {leaf.decode(want[place])!r}"
    return f"{area.name} offset {offset} is {got[offset]} in place of {want[offset]}"


def differences(recording: Recording, states: list[State]) -> list[str]:
    wrong = []
    for number, (expected, actual) in enumerate(zip(recording.states, states, strict=True), 1):
        where = f"{recording.path.stem}, step {number}"
        if actual.exception != expected.exception:
            wrong.append(f"{where}: exception {actual.exception} in place of {expected.exception}")
        for area, want, got in zip(AREAS, comparable(recording, expected), comparable(recording, actual), strict=True):
            places = [i for i, (w, g) in enumerate(zip(want, got, strict=True)) if w != g]
            texts = {describe(recording, area, i, bytes(want), bytes(got)): None for i in places}
            wrong += [f"{where}: {text}" for text in texts]
    return wrong


@pytest.mark.parametrize("runner", RUNNERS.values(), ids=lambda r: r.target)
def test_results_are_the_same(runner: Runner, tmp_path: Path) -> None:
    if missing := runner.missing():
        pytest.skip(f"there is no {missing}")
    built = [compile_for(runner.target, r.typed, r.script) for r in recordings()]
    device_id = getattr(lib, find_target(runner.target).device_id)
    batch = struct.pack("<II", device_id, len(built))
    batch += b"".join(batch_entry(r, b.image) for r, b in zip(recordings(), built, strict=True))
    reader = Reader(runner.run(batch, tmp_path))
    wrong = []
    for recording, result in zip(recordings(), built, strict=True):
        wrong += differences(recording, list(read_states(reader, recording, result)))
    assert not wrong, "\n".join(wrong)
