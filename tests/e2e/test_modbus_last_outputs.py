"""When a program goes, devices get what its outputs are then: `on_stop`. Later nothing writes to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from free_ports import free_port
from modbus_support import Devices, Wire

import plctool
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = "PROGRAM Main VAR speed, position, pump : INT := 1500; END_VAR END_PROGRAM"
OTHER = "PROGRAM Other VAR n : INT; END_VAR n := n + 1; END_PROGRAM"

# One write that changes for each device: then it is sent at once, however long the device takes to reply.
DESCRIPTION = """
[[modbus.tcp]]
host = "127.0.0.1"
port = {drive}
[[modbus.tcp.device]]
name = "Drive"
unit = 1
timeout = "T#60s"
[[modbus.tcp.device.write]]
function = 6
address = 40001
on_change = true
var = "Main.speed"
[[modbus.tcp.device.write]]
function = 6
address = 40002
on_change = true
var = "Main.position"
on_stop = "hold"
[[modbus.rs485]]
port = "{line}"
baud = 38400
[[modbus.rs485.device]]
name = "Pump"
unit = 3
timeout = "T#60s"
[[modbus.rs485.device.write]]
function = 6
address = 40001
every = "T#2s"
var = "Main.pump"
on_stop = 7
"""


@dataclass
class Plant:
    plcrt: Plcrt
    plc: Plc
    other: Path
    wire: Wire
    drive: Devices
    pump: Devices


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[Plant]:
    port = free_port()
    with Wire() as wire:
        (tmp_path / "main.st").write_text(PROGRAM)
        (tmp_path / "main.io.toml").write_text(DESCRIPTION.format(drive=port, line=wire.plc))
        other = tmp_path / "other"
        other.mkdir()
        (other / "other.st").write_text(OTHER)
        compile_sources([tmp_path / "main.st"]).write(tmp_path / "main.cdl")
        compile_sources([other / "other.st"]).write(other / "other.cdl")
        drive, pump = Devices([1], tcp=port), Devices([3], serial=wire.other, baud=38400)
        with drive, pump, Plcrt(tmp_path / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
            plc.flash(tmp_path / "main.cdl")
            yield Plant(plcrt, plc, other / "other.cdl", wire, drive, pump)


def registers(devices: Devices, unit: int, count: int) -> list[int]:
    return devices.memory.get(unit, [0] * count)[:count]


def ends(plant: Plant) -> None:
    plant.plc.close()
    plant.plcrt.stop()


WAYS: dict[str, Callable[[Plant], object]] = {
    "stop": lambda plant: plant.plc.stop(),
    "reset origin": lambda plant: plant.plc.reset("origin"),
    "another program": lambda plant: plant.plc.flash(plant.other),
    "end of the runtime": ends,
}


@pytest.mark.parametrize("way", WAYS)
def test_devices_get_what_outputs_are_when_the_program_goes(plant: Plant, way: str) -> None:
    eventually(lambda: registers(plant.drive, 1, 2) == [1500, 1500])
    eventually(lambda: registers(plant.pump, 3, 1) == [1500])
    WAYS[way](plant)
    eventually(lambda: registers(plant.drive, 1, 2) == [0, 1500])
    eventually(lambda: registers(plant.pump, 3, 1) == [7])


def test_a_device_that_does_not_reply_holds_up_neither_the_end_nor_the_others(plant: Plant) -> None:
    eventually(lambda: registers(plant.drive, 1, 1) == [1500] and registers(plant.pump, 3, 1) == [1500])
    plant.wire.pulled = True
    plant.plc.close()
    assert plant.plcrt.stop() == 0
    eventually(lambda: registers(plant.drive, 1, 1) == [0])
    assert registers(plant.pump, 3, 1) == [1500]
