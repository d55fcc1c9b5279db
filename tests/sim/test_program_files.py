"""What a program does with files in the simulator; the rest of the promise is in tests/file_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from file_programs import FULL, NO_ERROR, PROGRAM, WAITING, WRITE, Files, ProgramFiles

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


def simulate(source: str, folder: Path) -> Simulator:
    (folder / "waiting.st").write_text(source)
    built = compile_sources([folder / "waiting.st"])
    return Simulator(built.image, built.symbols)


def test_functions_that_wait_do_all_of_it_in_one_cycle(tmp_path: Path) -> None:
    with simulate(WAITING, tmp_path) as plc:
        plc.write({"Main.go": True})
        plc.run_cycles(1)
        assert (plc.read("Main.done"), plc.read("Main.wrong")) == (True, 0)  # or the number of the check, from 1
        assert (plc.read("Main.opened"), plc.read("Main.refused")) == (16, 9984)


def test_function_that_finds_no_room_keeps_the_previous_file(tmp_path: Path) -> None:
    with simulate(FULL, tmp_path) as plc:
        plc.put_file("c", b"old")
        plc.write({"Main.go": True})
        plc.run_cycles(1)
        assert (plc.read("Main.r"), plc.read("Main.closed")) == (0x29, 0x14)  # ERR_DISK_FULL, ERR_INVALID_HANDLE
        assert 500_000 < plc.read("Main.total") < 1 << 20
        assert plc.files() == {"c": b"old"}
