"""What a program forbids in the simulator; the rest of the promise is in tests/forbidding.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from forbidding import PROGRAM, Forbidding

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import OPERATIONS, Controller
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


class TestSimulator(Forbidding):
    @pytest.fixture
    def image(self, built: BuildResult) -> bytes:
        return built.image

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        while not condition():
            plc.run_cycles(1, check=False)


def test_what_one_program_forbids_ends_with_it(plc: Simulator, tmp_path: Path) -> None:
    """The next program has something else at the place of the variable."""
    plc.write({f"Main.lock[{OPERATIONS.index('stop')}]": True})
    plc.run_cycles(1)
    other = tmp_path / "other.st"
    other.write_text("PROGRAM Main VAR a : ARRAY[0..9999] OF BYTE := [10000(1)]; END_VAR a[0] := a[1]; END_PROGRAM")
    plc.flash(compile_sources([other]).image)
    assert plc.status().forbidden == []
    plc.stop()


def test_inputs_of_a_simulation_are_written_whatever_the_program_forbids(plc: Simulator) -> None:
    plc.write({f"Main.lock[{OPERATIONS.index('write')}]": True})
    plc.run_cycles(1)
    plc.write({"Main.n": 7})
    assert plc.read("Main.n") == 7
