"""Functions that events call, in the simulator; the promise is in tests/event_functions.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from event_functions import PROGRAM, REGISTERED, EndlessFunctions, check_registered

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
