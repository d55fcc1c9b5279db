"""The programs of tests/st give the same values in every area after every cycle on every target, exceptions included.

The simulator on this machine says what is right; each other target runs all programs in one start of QEMU.
"""

from __future__ import annotations

import math
import struct
import sys
from functools import cache
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "compiler"))

from batch import AREAS, Recorder, Recording, State, run_batch
from runners import RUNNERS, Runner
from test_st_programs import PROGRAMS, Script, read_script, run_cycle

from plctool.compiler import load_sources
from plctool.compiler.front import check_sources
from plctool.compiler.typed import Area, TypedProgram
from plctool.compiler.types import LREAL, REAL, PointerType, StringType
from plctool.symbols import Symbol


def record(path: Path, script: Script, typed: TypedProgram) -> Recording:
    """Runs a program as its comments say."""
    options = script.options
    recording = Recording(path.stem, typed, int(options.get("level", "2")), options.get("checks", "all"))
    plc = Recorder(recording)
    with plc:
        if script.time_ms:
            plc.run_ms(script.time_ms)
        for cycle in range(0 if script.time_ms else script.cycles):
            run_cycle(plc, script, cycle)
    return recording


@cache
def recordings() -> list[Recording]:
    """All programs that compile, with what they do on the reference."""
    found = []
    for path in PROGRAMS:
        script = read_script(path)
        if not any(severity == "error" for severity, *_ in script.diagnostics):
            program = check_sources(load_sources([path])).program
            assert program is not None, f"{path.name} does not compile"
            found.append(record(path, script, program))
    return found


# ---- the comparison ------------------------------------------------------------------------------------------------


def is_nan(data: bytes) -> bool:
    return math.isnan(struct.unpack("<f" if len(data) == 4 else "<d", data)[0])


def value_of(leaf: Symbol, data: bytes) -> bytes:
    """The bytes of a variable without what is not part of its value.

    That is what lies behind the end of a string, which of the many not-a-numbers it is, and an address, of which only
    remains whether it is NULL.
    """
    if isinstance(leaf.type, StringType):
        return data.partition(b"\0")[0].ljust(len(data), b"\0")
    if isinstance(leaf.type, PointerType) or (leaf.type in (REAL, LREAL) and is_nan(data)):
        return bytes([any(data)]).ljust(len(data), b"\0")
    return data


def values_of(recording: Recording, state: State) -> tuple[bytes, ...]:
    """The areas without what is not part of a value."""
    areas = tuple(map(bytearray, state.areas))
    for leaf in recording.leaves:
        place = slice(leaf.offset, leaf.offset + leaf.size)
        area = areas[AREAS.index(Area(leaf.area))]
        area[place] = value_of(leaf, bytes(area[place]))
    return tuple(map(bytes, areas))


def describe(recording: Recording, area: Area, offset: int, want: bytes, got: bytes) -> str:
    """The variable at a place and what it is, for people."""
    for leaf in recording.leaves:
        place = slice(leaf.offset, leaf.offset + leaf.size)
        if leaf.area == area.value and leaf.offset <= offset < place.stop:
            return f"{leaf.name} is {leaf.decode(got[place])!r} in place of {leaf.decode(want[place])!r}"
    return f"{area.name} offset {offset} is {got[offset]} in place of {want[offset]}"


def differences(recording: Recording, states: list[State]) -> list[str]:
    wrong = []
    for number, (expected, actual) in enumerate(zip(recording.states, states, strict=True), 1):
        where = f"{recording.name}, step {number}"
        if actual.exception != expected.exception:
            wrong.append(f"{where}: exception {actual.exception} in place of {expected.exception}")
        for area, want, got in zip(AREAS, values_of(recording, expected), values_of(recording, actual), strict=True):
            places = [i for i, (w, g) in enumerate(zip(want, got, strict=True)) if w != g]
            wrong += [f"{where}: {text}" for text in {describe(recording, area, i, want, got): None for i in places}]
    return wrong


@pytest.mark.parametrize("runner", RUNNERS.values(), ids=lambda r: r.target)
def test_results_are_the_same(runner: Runner, tmp_path: Path) -> None:
    runner.skip_without_tools()
    results = run_batch(runner, recordings(), tmp_path)
    wrong = [text for r, states in zip(recordings(), results, strict=True) for text in differences(r, states)]
    assert not wrong, "\n".join(wrong)


def test_a_difference_is_found() -> None:
    """What is compared can differ."""
    recording = next(r for r in recordings() if any(r.states[-1].areas))
    state = recording.states[-1]
    for index, area in enumerate(state.areas):
        for i, byte in enumerate(area):
            changed = bytearray(area)
            changed[i] = byte ^ 1
            other = State(state.exception, (*state.areas[:index], bytes(changed), *state.areas[index + 1 :]))
            if differences(recording, [*recording.states[:-1], other]):
                return
    pytest.fail("no change of any byte was found")
