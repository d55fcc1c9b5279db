"""examples/tanks on a real plcrt, with its plant in a process of its own, over Modbus TCP."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import plctool
from plctool.compiler import IoFiles, compile_sources
from plctool.device import Plc
from plctool.errors import UsageError
from plctool.testing.plcrt import Plcrt
from plctool.testing.tanks import PlantServer, describe_tanks, examples

Eventually = Callable[[Callable[[], Any]], Any]


@dataclass
class Tanks:
    """The controller and its plant."""

    plc: Plc
    plant: PlantServer


@pytest.fixture
def tanks(tmp_path: Path, plcrt: Plcrt) -> Iterator[Tanks]:
    with PlantServer() as plant, plctool.connect(f"serial:{plcrt.port}") as plc:
        image = tmp_path / "tanks.cdl"
        compile_sources([examples() / "tanks"], io=IoFiles(describe_tanks(tmp_path, plant.port))).write(image)
        plc.flash(image)
        yield Tanks(plc, plant)


def test_level_rises_because_the_controller_runs_the_pump(tanks: Tanks, eventually: Eventually) -> None:
    eventually(lambda: tanks.plc.read("Plant.ok") and tanks.plc.read("Control.pump"))
    eventually(lambda: tanks.plc.read("Control.level2") > 12.0)  # it began with 5 and would sink by itself
    tanks.plc.write({"Control.mode": "Off"})
    eventually(lambda: tanks.plc.read("Control.level2") < 9.0)
    eventually(lambda: tanks.plc.read("Control.level1") > 80.0)  # the valve at its inlet is open
    assert tanks.plc.read("Plant.ok")


def test_bus_is_pulled_and_plugged_in_again(tanks: Tanks, eventually: Eventually) -> None:
    eventually(lambda: tanks.plc.read("Control.level2") > 20.0)
    assert tanks.plant.press_enter().startswith("bus pulled; process tank ")
    eventually(lambda: tanks.plc.read("Control.alarm_plant"))
    seen = tanks.plc.read("Plant.ok", "Control.pump", "Control.speed", "Control.inlet", "Control.level2")
    level = seen.pop("Control.level2")
    assert seen == {"Plant.ok": False, "Control.pump": False, "Control.speed": 0.0, "Control.inlet": False}
    assert level > 19.0  # what it saw last
    assert tanks.plant.press_enter().startswith("bus connected; process tank ")
    eventually(lambda: tanks.plc.read("Plant.ok") and not tanks.plc.read("Control.alarm_plant"))
    eventually(lambda: tanks.plc.read("Control.pump") and tanks.plc.read("Control.level2") > level + 1.0)


def test_plant_switches_off_when_the_controller_is_silent(tanks: Tanks, plcrt: Plcrt, eventually: Eventually) -> None:
    eventually(lambda: tanks.plc.read("Control.level2") > 20.0)
    plcrt.stop()
    eventually(lambda: float(tanks.plant.press_enter().split()[-2]) < 15.0)


def test_stop_of_the_program_stops_the_plant(tanks: Tanks, eventually: Eventually) -> None:
    eventually(lambda: tanks.plc.read("Control.level2") > 15.0)
    tanks.plc.stop()
    eventually(lambda: tanks.plc.read("Control.level2") < 10.0)  # inputs are read on


def test_without_pymodbus_there_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pymodbus.py").write_text("raise ImportError\n")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    with pytest.raises(UsageError, match=r"The plant needs pymodbus, .*; type: pip install"), PlantServer():
        pass


def test_port_that_is_in_use_is_named() -> None:
    with PlantServer() as plant:
        command = [sys.executable, str(examples() / "tanks/plant_server.py"), "--port", str(plant.port)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert f"Port {plant.port} is in use" in done.stderr


def test_plant_checks_what_is_written_to_it() -> None:
    """A speed that is no number leaves the tanks as they are."""
    from pymodbus.client import ModbusTcpClient

    with PlantServer() as plant, ModbusTcpClient("127.0.0.1", port=plant.port, timeout=10, retries=0) as client:
        assert not client.write_coils(0, [True, True]).isError()
        assert not client.write_registers(0, [0x7FC0, 0]).isError()
        assert client.write_registers(2, [1]).isError()
        assert client.write_coil(40, True).isError()
        assert not client.write_register(0, 0x42C8).isError()  # 100.0
        first = client.read_input_registers(0, count=4).registers
        assert all(register > 0 for register in (first[0], first[2]))
        assert first[0] & 0x7F80 != 0x7F80
        assert first[2] & 0x7F80 != 0x7F80
