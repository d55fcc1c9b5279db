"""What a program does with files in the simulator; the rest of the promise is in tests/file_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from file_programs import NO_ERROR, PROGRAM, WRITE, Files, ProgramFiles

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.errors import DeviceError
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


def run_until(plc: Simulator, condition: Callable[[], Any]) -> None:
    for _ in range(1000):
        if condition():
            return
        plc.run_cycles(1)
    raise AssertionError("the program does not come to an end")


class TestSimulator(ProgramFiles):
    open_files = 16

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        run_until(plc, condition)


def test_program_reads_what_the_host_put_and_the_host_what_it_wrote(plc: Simulator) -> None:
    files = Files(plc, lambda condition: run_until(plc, condition))
    plc.put_file("recipe.txt", b"12;34")
    assert files.get("recipe.txt") == b"12;34"
    assert files.put("log.txt", b"done") == NO_ERROR
    assert plc.files() == {"recipe.txt": b"12;34", "log.txt": b"done"}


def test_file_survives_power_off(plc: Simulator) -> None:
    files = Files(plc, lambda condition: run_until(plc, condition))
    assert files.put("log.txt", b"done") == NO_ERROR
    plc.restart()
    assert files.get("log.txt") == b"done"


def test_host_is_refused_while_the_program_writes(plc: Simulator) -> None:
    files = Files(plc, lambda condition: run_until(plc, condition))
    assert files.open("log.txt", WRITE) == NO_ERROR
    with pytest.raises(DeviceError, match=r"cannot have the file a\.txt"):
        plc.put_file("a.txt", b"")


def test_call_takes_one_cycle_more(plc: Simulator) -> None:
    plc.write({"Main.name": "none", "Main.op": 10})
    plc.run_cycles(2)
    assert plc.read("Main.op") == 0
