"""What a program adds to the log of the simulator; the rest of the promise is in tests/logging_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from logging_programs import PROGRAM, Logging

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.sim import Simulator


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


class TestSimulator(Logging):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        while not condition():
            plc.run_cycles(1)


def test_program_gets_one_message_a_second_after_its_burst(plc: Simulator) -> None:
    plc.write({"Main.flood": 10_000})
    plc.run_cycles(100)
    burst = [e for e in plc.log() if e.text == "again"]
    plc.run_for(seconds=5)
    assert len([e for e in plc.log() if e.text == "again"]) == len(burst) + 5


def test_pause_gives_the_whole_burst_back_and_no_more(plc: Simulator) -> None:
    def burst() -> int:
        known = plc.log()[-1].handle
        plc.write({"Main.flood": 50})
        plc.run_cycles(50)
        return len([e for e in plc.log(known) if e.text == "again"])

    first = burst()
    plc.run_for(seconds=3600)
    assert burst() == first
