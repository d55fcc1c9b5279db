"""The simulator aborts a cycle that takes too long on the processor: that cycle, never one of another program."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.controller import ProgramStopped
from plctool.core import lib
from plctool.errors import DeviceError
from plctool.sim import Simulator

DEFAULT_MS = 2000  # SIM_CYCLE_LIMIT_MS
SLOW = """
FUNCTION Slow : LREAL
VAR_INPUT turns : DINT; END_VAR
VAR i : DINT; END_VAR
FOR i := 1 TO turns DO Slow := SQRT(Slow + 1.5); END_FOR
END_FUNCTION
PROGRAM Main
VAR x : LREAL := Slow({turns}); END_VAR
END_PROGRAM
"""


@pytest.fixture(autouse=True)
def limit() -> Iterator[None]:
    yield
    lib.SimSetCycleLimit(0)


def test_initialisations_of_programs_one_after_the_other_are_not_one_long_cycle(tmp_path: Path) -> None:
    """Each is the first cycle of its runtime, and nearly all of the time is spent in one."""
    path = tmp_path / "slow.st"
    path.write_text(SLOW.format(turns=30_000_000))
    built = compile_sources([path])
    limit_s = DEFAULT_MS / 1000
    longest = 0.0
    for _ in range(8):
        begin = time.monotonic()
        try:
            Simulator(built.image, built.symbols).close()
            aborted = False
        except DeviceError:
            aborted = True
        seconds = time.monotonic() - begin
        assert not aborted or seconds > limit_s, f"aborted after {seconds:.3f} s, before its {limit_s:.3f} s were over"
        longest = max(longest, seconds)
        limit_s = 3 * longest
        lib.SimSetCycleLimit(int(1000 * limit_s))


@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize(
    "loop", ["again: n := n + 1; JMP again;", "again: JMP again;", "again: IF go THEN JMP again; END_IF"]
)
def test_a_loop_made_of_a_jump_is_aborted_as_well(loop: str, level: int, tmp_path: Path) -> None:
    """Even one that does nothing stays a loop."""
    path = tmp_path / "main.st"
    path.write_text(
        f"PROGRAM Main\nVAR n : DINT; go : BOOL; END_VAR\nIF NOT go THEN RETURN; END_IF\n{loop}\nEND_PROGRAM\n"
    )
    lib.SimSetCycleLimit(100)
    built = compile_sources([path], level=level)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        plc.write({"Main.go": True})
        with pytest.raises(ProgramStopped, match=r"WATCHDOG in task Main, Main, .*main\.st:4"):
            plc.run_cycles(1)
