"""A device with unit 0 is all of a serial line: what it has is written to each, and it is well when that was sent."""

from __future__ import annotations

from pathlib import Path

from plctool import Simulator
from plctool.iec.types import UDINT

SOURCE = "PROGRAM Main VAR clock : INT; level : INT; n : DINT; END_VAR n := n + 1; END_PROGRAM"
DESCRIPTION = """
[[modbus.rs485]]
name = "Bus"
port = "/dev/ttyS1"
baud = 19200
[[modbus.rs485.device]]
name = "Everyone"
unit = 0
[[modbus.rs485.device.write]]
function = 6
address = 40009
every = "T#200ms"
var = "Main.clock"
"""
TANK = """
[[modbus.rs485.device]]
name = "Tank"
unit = 3
[[modbus.rs485.device.read]]
function = 4
address = 30001
every = "T#100ms"
var = "Main.level"
"""


def started(folder: Path, description: str) -> Simulator:
    (folder / "main.st").write_text(SOURCE)
    (folder / "main.io.toml").write_text(description)
    return Simulator.from_sources(folder / "main.st")


def test_it_is_well_when_its_writes_were_sent(tmp_path: Path) -> None:
    with started(tmp_path, DESCRIPTION) as plc:
        plc.run_for(1000)
        assert plc.read("Everyone.ok") is True
        assert plc.read("Bus.ok") is True
        assert plc.io_read_parameter("Everyone", 0x8000, UDINT) in (5, 6)  # requests: every 200 ms


def test_it_does_not_speak_for_a_device_that_is_lost(tmp_path: Path) -> None:
    with started(tmp_path, DESCRIPTION + TANK) as plc:
        plc.run_for(1000)
        assert [plc.read(f"{name}.ok") for name in ("Everyone", "Tank", "Bus")] == [True, True, True]
        plc.fault("Tank", "absent")
        plc.run_for(5000)
        assert [plc.read(f"{name}.ok") for name in ("Everyone", "Tank", "Bus")] == [True, False, False]
        plc.fault("Tank", "absent", 0)
        plc.run_for(5000)
        assert [plc.read(f"{name}.ok") for name in ("Everyone", "Tank", "Bus")] == [True, True, True]
