"""Several simulators in one process: each has its own program, memory, clock, inputs and exceptions."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest

import plctool
from plctool import Simulator, UsageError
from plctool.controller import ProgramStopped
from plctool.core import lib

COUNTS = """PROGRAM Main VAR n : DINT; by : DINT := {by}; go : BOOL; x : DINT; END_VAR
n := n + by;
IF go THEN x := n / (by - {by}); END_IF
END_PROGRAM
CONFIGURATION c TASK fast(INTERVAL := T#{ms}ms, PRIORITY := 1); PROGRAM Main WITH fast : Main; END_CONFIGURATION
"""
LOOPS = "PROGRAM Main VAR n : DINT; END_VAR WHILE TRUE DO n := n + 1; END_WHILE END_PROGRAM"


def simulator(folder: Path, source: str, *, limit_ms: int = 0) -> Simulator:
    path = folder / "main.st"
    path.write_text(source)
    return Simulator.from_sources(path, start=False, cycle_limit_ms=limit_ms)


def test_each_has_its_own_memory_and_clock(tmp_path: Path) -> None:
    with (
        simulator(tmp_path, COUNTS.format(by=1, ms=10)) as a,
        simulator(tmp_path, COUNTS.format(by=5, ms=1)) as b,
        simulator(tmp_path, COUNTS.format(by=7, ms=2)) as c,
    ):
        for plc in (a, b, c):
            plc.start()
        for ms, plc in itertools.product((10, 20), (b, a, c)):
            plc.run_for(ms=ms)
        c.run_for(ms=4)
        assert [plc.read("Main.n") for plc in (a, b, c)] == [3, 5 * 30, 7 * 17]
        assert [plc.now_ns for plc in (a, b, c)] == [30_000_000, 30_000_000, 34_000_000]


def test_they_exchange_values_in_python(tmp_path: Path) -> None:
    with simulator(tmp_path, COUNTS.format(by=1, ms=10)) as a, simulator(tmp_path, COUNTS.format(by=2, ms=10)) as b:
        a.start(), b.start()
        for _ in range(5):
            a.run_for(ms=10)
            b.write({"Main.n": a.read("Main.n")})
            b.run_for(ms=10)
        assert (a.read("Main.n"), b.read("Main.n")) == (5, 7)


@pytest.mark.parametrize("order", [*itertools.permutations(range(3))])
def test_an_exception_stops_only_its_own_program(tmp_path: Path, order: tuple[int, ...]) -> None:
    """Signals go to the runtime whose code they interrupted, in whatever order the runtimes began and end."""
    plcs = [simulator(tmp_path, COUNTS.format(by=1 + i, ms=10)) for i in range(3)]
    for number in order:
        plcs[number].start()
    for number in order:
        plcs[number].write({"Main.go": True})
        with pytest.raises(ProgramStopped, match="DIVIDEBYZERO"):
            plcs[number].run_for(ms=10)
        plcs[number].close()
    assert not lib.SimIsOn()


def test_an_access_violation_goes_to_the_runtime_that_runs(tmp_path: Path) -> None:
    """A fault of the processor, which is a signal, not a check of the program."""
    source = """PROGRAM Main VAR p : POINTER TO DINT; n : DINT; END_VAR
    p := ADR(n); p := p + 16#7000_0000_0000; p^ := 1;
    END_PROGRAM"""
    plcs = [simulator(tmp_path, source) for _ in range(3)]
    for plc in plcs:
        plc.start()
        with pytest.raises(ProgramStopped, match="ACCESS_VIOLATION"):
            plc.run_cycles(1)
    for plc in plcs:
        plc.close()


def test_an_endless_loop_is_aborted_in_each(tmp_path: Path) -> None:
    plcs = [simulator(tmp_path, LOOPS, limit_ms=100) for _ in range(3)]
    for plc in plcs:
        plc.start()
        with pytest.raises(ProgramStopped, match="WATCHDOG"):
            plc.run_cycles(1)
    for plc in plcs:
        plc.close()


def test_a_closed_one_touches_no_other(tmp_path: Path) -> None:
    first = simulator(tmp_path, COUNTS.format(by=1, ms=10))
    first.close()
    with simulator(tmp_path, COUNTS.format(by=2, ms=10)) as second:
        second.start()
        for use in (first.start, lambda: first.run_for(ms=10), lambda: first.write({"Main.n": 9}), first.status):
            with pytest.raises(UsageError, match="closed"):
                use()
        first.close()
        second.run_for(ms=10)
        assert second.read("Main.n") == 2


def test_a_folder_without_room_for_a_copy_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("plctool.core._free", [])
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with pytest.raises(UsageError, match="TMPDIR"):
        simulator(tmp_path, LOOPS)


@pytest.mark.parametrize("time", ["1s", None])
def test_what_is_no_time_is_refused(tmp_path: Path, time: Any) -> None:
    with simulator(tmp_path, "PROGRAM Main END_PROGRAM") as plc, pytest.raises(UsageError, match="or a timedelta, not"):
        plc.run_for(time)


def test_names_of_the_package_are_those_that_docs_import() -> None:
    assert plctool.ProgramStopped is ProgramStopped
    assert all(getattr(plctool, name) for name in plctool.__all__)
