"""Programs recorded on the simulator and repeated by a runner; the files between them are described in runner.c."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from runners import Runner

from plctool.compiler.codegen.lower_unit import Options, parse_checks
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.typed.nodes import TypedProgram
from plctool.core import ffi, lib
from plctool.debug.variables import Symbol
from plctool.iec.areas import Area
from plctool.image.targets import find_target
from plctool.sim import Simulator

REFERENCE = "x86_64-linux"
AREAS = (Area.DATA, Area.RETAIN, Area.OUTPUT, Area.MEMORY)
STEP_CYCLES, STEP_MS = 0, 1
NO_OFFSET = 0xFFFFFFFF


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
    """A program with its compiler options, and what it did on the reference."""

    name: str
    typed: TypedProgram
    level: int = 2
    checks: str = "all"
    steps: list[Step] = field(default_factory=list)
    states: list[State] = field(default_factory=list)

    def build(self, target: str) -> BuildResult:
        return build_program(self.typed, Options(find_target(target), self.level, parse_checks(self.checks)))

    @cached_property
    def built(self) -> BuildResult:
        """For the reference."""
        return self.build(REFERENCE)

    @cached_property
    def leaves(self) -> list[Symbol]:
        """Every scalar and string in memory that has a name."""
        symbols = self.built.symbols
        found = [leaf for symbol in symbols.variables.values() for leaf in symbol.leaves()]
        return [leaf for leaf in found if Area(leaf.area) in AREAS and leaf.bit is None]


class Recorder(Simulator):
    """A simulator that adds what it does to a recording."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.writes: list[tuple[int, int, bytes]] = []
        super().__init__(recording.built.image, recording.built.symbols)

    def write(self, values: Mapping[str, object]) -> None:
        super().write(values)
        for symbol in map(self.symbols().resolve, values):
            place = self._variables.place(symbol)
            assert place is not None
            self.writes.append((*place, bytes(self._variables.memory(symbol))))

    def run_cycles(self, count: int, *, check: bool = False) -> None:
        super().run_cycles(count, check=check)
        self._remember(Step(STEP_CYCLES, count, self.writes))

    def run_ms(self, ms: int) -> None:
        super().run_for(ms, check=False)
        self._remember(Step(STEP_MS, ms, self.writes))

    def _remember(self, step: Step) -> None:
        self.writes = []
        self.recording.steps.append(step)
        exception = self.raw_status().exception
        sizes = [lib.AppGetAreaSize(area.value) for area in AREAS]
        areas = (bytes(ffi.buffer(lib.AppGetAreaAddress(a.value, 0, n), n)) for a, n in zip(AREAS, sizes, strict=True))
        seen = None
        if exception:
            seen = (exception.code, line_of(self.recording.built, exception.code_offset), exception.task)
        self.recording.states.append(State(seen, tuple(areas)))


def line_of(built: BuildResult, code_offset: int | None) -> int:
    """The source line of an exception, 0 when it is not known."""
    place = built.symbols.address_to_line(code_offset) if code_offset is not None else None
    return place.line if place else 0


def run_batch(runner: Runner, recordings: list[Recording], folder: Path) -> list[list[State]]:
    """What each program does on another target, state by state."""
    built = [recording.build(runner.target) for recording in recordings]
    batch = struct.pack("<II", getattr(lib, find_target(runner.target).device_id), len(built))
    batch += b"".join(_entry(r, b.image) for r, b in zip(recordings, built, strict=True))
    reader = _Reader(runner.run(batch, folder))
    return [list(_read_states(reader, r, b)) for r, b in zip(recordings, built, strict=True)]


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _entry(recording: Recording, image: bytes) -> bytes:
    out = [struct.pack("<I", len(image)), _padded(image), struct.pack("<I", len(recording.steps))]
    for step in recording.steps:
        out.append(struct.pack("<III", step.kind, step.amount, len(step.writes)))
        out += [struct.pack("<III", area, offset, len(data)) + _padded(data) for area, offset, data in step.writes]
    return b"".join(out)


class _Reader:
    """Takes numbers and bytes from the results of a runner."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def number(self) -> int:
        return int(struct.unpack("<I", self.take(4))[0])

    def take(self, size: int) -> bytes:
        assert self._at + size <= len(self._data), "the results end early"
        self._at += size
        return self._data[self._at - size : self._at]


def _read_states(reader: _Reader, recording: Recording, built: BuildResult) -> Iterator[State]:
    result = reader.number()
    assert result == lib.ERR_OK, f"{recording.name} was refused with error {result}"
    for state in recording.states:
        code, offset, task = reader.number(), reader.number(), reader.number()
        exception = (code, line_of(built, None if offset == NO_OFFSET else offset), task) if code else None
        yield State(exception, tuple(reader.take(len(area)) for area in state.areas))
