"""What clients write to a server starts with the initial values of the variables, up to the first write."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.sim import Simulator

PROGRAM = """
PROGRAM Main
VAR setpoint : REAL := 20.0; limit : INT := -5; n, low, seen : INT; END_VAR
n := n + 1;
IF setpoint < 1.0 THEN low := low + 1; END_IF
IF limit = 7 AND seen = 0 THEN seen := n; END_IF
END_PROGRAM
"""
DESCRIPTION = """
[modbus.server.tcp]
name = "Scada"
port = 1502
order = "CDAB"
[modbus.server.tcp.holding]
40001 = "Main.setpoint"
40003 = "Main.limit"
"""
VALUES = ("Main.setpoint", "Main.limit", "Main.low")


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION)
    compile_sources([tmp_path / "main.st"]).write(tmp_path / "main.cdl")
    with Simulator.from_file(tmp_path / "main.cdl") as simulator:
        yield simulator


def test_they_are_kept_until_a_client_writes(plc: Simulator) -> None:
    plc.run_cycles(200)
    assert list(plc.read(*VALUES).values()) == [20.0, -5, 0]


def test_they_are_kept_in_the_registers_that_a_client_did_not_write(plc: Simulator) -> None:
    plc.set_input("Scada.40003", 7)
    plc.run_cycles(200)
    assert list(plc.read(*VALUES).values()) == [20.0, 7, 0]
    assert plc.read("Main.seen") == 1, "in the first cycle"


def test_what_the_program_sets_before_is_shown(plc: Simulator) -> None:
    plc.write({"Main.setpoint": 30.0})
    plc.run_cycles(2)
    plc.set_input("Scada.40003", 7)
    plc.run_cycles(2)
    assert list(plc.read(*VALUES).values()) == [30.0, 7, 0]


@pytest.mark.parametrize("kind", ["warm", "cold"])
def test_they_are_there_again_after_a_reset(plc: Simulator, kind: str) -> None:
    plc.set_input("Scada.40001", 3.0)
    plc.run_cycles(2)
    assert list(plc.read(*VALUES).values()) == [3.0, -5, 0]
    plc.reset(kind)
    plc.start()
    plc.run_cycles(2)
    assert list(plc.read(*VALUES).values()) == [20.0, -5, 0]
