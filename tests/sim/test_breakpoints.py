"""Breakpoints in the simulator, whose time stands still while a program is halted."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from breakpoints import FILE, Breaking, build, halt, place

from plctool import Simulator
from plctool.errors import UsageError


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    with Simulator.from_file(build(tmp_path)) as plc:
        yield plc


class TestSimulator(Breaking):
    pass


def test_time_stands_still_while_the_program_is_halted(plc: Simulator) -> None:
    plc.breakpoints.set(FILE, 15)
    plc.run_for(20)
    assert plc.is_halted
    before = plc.now_ns
    halt(plc.breakpoints)
    assert plc.now_ns == before
    plc.breakpoints.step_over()
    assert place(halt(plc.breakpoints)) == ("Counter", 16)
    assert plc.now_ns == before


def test_time_does_not_pass_past_a_halt(plc: Simulator) -> None:
    plc.breakpoints.set(FILE, 15)
    plc.run_cycles(5)
    with pytest.raises(UsageError, match="halted at a breakpoint; let it go on first"):
        plc.run_for(1)
    with pytest.raises(UsageError, match="let it go on first"):
        plc.run_cycles(1)


def test_a_function_in_python_runs_in_a_debugged_program(tmp_path: Path) -> None:
    source = tmp_path / "python.st"
    source.write_text(
        "FUNCTION Twice : INT\nVAR_INPUT x : INT; END_VAR\nEND_FUNCTION\n"
        "PROGRAM Main\nVAR n : INT; END_VAR\nn := Twice(n + 1);\nn := n + 1;\nEND_PROGRAM\n"
    )
    with Simulator.from_sources(source, level=0, functions={"Twice": lambda x: 2 * x}) as plc:
        plc.breakpoints.set("python.st", 7)
        plc.run_cycles(1)
        found = halt(plc.breakpoints)
        assert (found.calls[0].line, plc.read("Main.n")) == (7, 2)


def test_a_closed_simulator_leaves_nothing_halted(tmp_path: Path) -> None:
    for _ in range(3):
        with Simulator.from_file(build(tmp_path)) as plc:
            plc.breakpoints.set(FILE, 15)
            plc.run_cycles(1)
            assert plc.is_halted
    with Simulator.from_file(build(tmp_path)) as plc:
        plc.run_cycles(10)
        assert plc.read("Main.cycles") == 10
