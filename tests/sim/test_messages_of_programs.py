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


COMPONENTS = """
PROGRAM Main
VAR
    done : BOOL; first, again, nothing : UDINT := 99; handle, full : UDINT; i : UDINT; name : STRING := 'x';
    removed, twice : UDINT := 99;
END_VAR
IF NOT done THEN
    done := TRUE;
    handle := CMAddComponent('MyLibrary', 16#12341005, 16#03050500, ADR(first));
    CMAddComponent('Other', 16#12341005, 0, ADR(again));
    CMAddComponent('', 1, 0, ADR(nothing));
    LogAdd2(0, 16#12341005, LogClass.LOG_WARNING, 0, 0, 'pump is slow');
    LogAdd2(0, 16#12341006, LogClass.LOG_WARNING, 0, 0, 'of no component');
    FOR i := 1 TO 8 DO full := CMAddComponent(name, i, 0, 0); END_FOR
    removed := CMRemoveComponent(handle);
    twice := CMRemoveComponent(handle);
    LogAdd2(0, 16#12341005, LogClass.LOG_WARNING, 0, 0, 'no name any more');
END_IF
END_PROGRAM
"""


def test_components_of_a_program_have_their_names_before_their_messages(tmp_path: Path) -> None:
    source = tmp_path / "components.st"
    source.write_text(COMPONENTS)
    with Simulator.from_sources(source) as plc:
        plc.run_cycles(1)
        texts = [entry.text for entry in plc.log()]
        results = [plc.read(f"Main.{name}") for name in ("first", "again", "nothing", "full", "removed", "twice")]
    assert texts[-3:] == ["MyLibrary: pump is slow", "of no component", "no name any more"]
    assert results == [0, 0x12, 2, 0xFFFFFFFF, 0, 0x10]
