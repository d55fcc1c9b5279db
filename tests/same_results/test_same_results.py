"""The programs of tests/st give the same values in every area after every cycle on every target, exceptions included.

The simulator on this machine says what is right; each other target runs its programs in one start of QEMU. In
`make test` each program is run by one target, which its name decides, in `make test-whole` by all.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "compiler"))

from batch import Recorder, Recording, State, run_batch
from comparison import differences
from runners import RUNNERS, Runner
from shares import share_by_name
from test_st_programs import PROGRAMS, Script, build, checked, read_script, run_cycle

from plctool.compiler.typed.nodes import TypedProgram

UNOPTIMISED = 6  # of so many programs one is repeated without optimisation
# The clock of the runners is not set back for each program, and the bare ones have none.
OF_ONE_DEVICE = ("wall_clock_is_read_and_set", "time_passes_within_a_cycle_under_the_names_of_syslibtime")
TARGETS = [target for target in RUNNERS if target != "x86_64-windows"]  # these together run all programs
KEEPS_ALL = 2  # the highest level at which no variable is in registers only, and memory is that of -O0


def record(path: Path, script: Script, typed: TypedProgram, highest: int = 3) -> Recording:
    """Runs a program as its comments say, at that level or the `highest` one."""
    options = script.options
    level = min(int(options.get("level", "2")), highest)
    checks = options.get("checks", "all")
    recording = Recording(path.stem, typed, level, checks)
    recording.built = build(path, level, checks)  # which tests/compiler has built in the same process
    plc = Recorder(recording)
    with plc:
        if script.time_ms:
            plc.run_ms(script.time_ms)
        for cycle in range(0 if script.time_ms else script.cycles):
            run_cycle(plc, script, cycle)
    return recording


@cache
def programs() -> list[tuple[Path, Script, TypedProgram]]:
    """All that compile."""
    found = []
    for path in (path for path in PROGRAMS if path.stem not in OF_ONE_DEVICE):
        script = read_script(path)
        if not any(severity == "error" for severity, *_ in script.diagnostics):
            program = checked(path).program
            if program is not None:  # what does not compile is a failure of tests/compiler
                found.append((path, script, program))
    return found


@cache
def recordings() -> list[Recording]:
    """All programs, with what they do on the reference."""
    return [record(*program) for program in programs()]


@pytest.mark.parametrize("runner", RUNNERS.values(), ids=lambda r: r.target)
def test_results_are_the_same(runner: Runner, tmp_path: Path) -> None:
    runner.skip_without_tools()
    chosen = share_by_name(recordings(), lambda r: r.name, len(TARGETS), list(RUNNERS).index(runner.target))
    results = run_batch(runner, chosen, tmp_path)
    wrong = [text for r, states in zip(chosen, results, strict=True) for text in differences(r, states)]
    assert not wrong, "\n".join(wrong)


def test_results_are_the_same_without_optimisation(tmp_path: Path) -> None:
    """The optimiser leaves out what is wrong but has no effect; some programs show what it would have been."""
    runner = RUNNERS["cortex-m3"]
    runner.skip_without_tools()
    both = list(zip(programs(), recordings(), strict=True))
    chosen = share_by_name(both, lambda case: case[1].name, UNOPTIMISED, 0)
    kept = [r if r.level <= KEEPS_ALL else record(*program, KEEPS_ALL) for program, r in chosen]
    plain = [replace(recording, level=0) for recording in kept]
    results = run_batch(runner, plain, tmp_path)
    wrong = [text for r, states in zip(plain, results, strict=True) for text in differences(r, states)]
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
