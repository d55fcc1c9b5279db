"""Functions that events call, in the simulator; the promise is in tests/event_functions.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

import online_programs
from event_functions import PROGRAM, REGISTERED, EndlessFunctions, check_registered

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.errors import PlcError
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


class TestSimulator(EndlessFunctions):
    @pytest.fixture
    def image(self, built: BuildResult) -> bytes:
        return built.image

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        while not condition():
            plc.run_cycles(1)


def test_functions_that_the_program_registers_are_called(tmp_path: Path) -> None:
    source = tmp_path / "registered.st"
    source.write_text(REGISTERED)
    with Simulator.from_sources(source) as plc:
        check_registered(plc, lambda: plc.run_cycles(1))


CHANGING = """
VAR_GLOBAL
    asked, changed : DINT;
    batch : BOOL;
END_VAR
{attribute 'call_on' := 'EVT_PrepareOnlineChange'}
FUNCTION MayChange : BOOL
asked := asked + 1;
MayChange := batch;
EventSetReason('a batch runs');
END_FUNCTION
{attribute 'call_on' := 'EVT_OnlineChangeDone'}
FUNCTION HasChanged
changed := changed + STEP;
END_FUNCTION
PROGRAM Main
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
"""


def test_function_denies_an_online_change_and_that_of_the_new_program_hears_of_it(tmp_path: Path) -> None:
    old = online_programs.built(tmp_path, CHANGING.replace("STEP", "1"))
    new = online_programs.built(tmp_path, CHANGING.replace("STEP", "10"), old.symbols)
    with Simulator(old.image, old.symbols) as plc:
        plc.run_cycles(1)
        plc.add_symbols(new.symbols)
        plc.write({"batch": True})
        with pytest.raises(PlcError, match="a batch runs"):
            plc.change(new.image)
        assert plc.read("asked", "changed") == {"asked": 1, "changed": 1}
        plc.write({"batch": False})
        plc.change(new.image)
        assert plc.read("asked", "changed") == {"asked": 2, "changed": 11}
