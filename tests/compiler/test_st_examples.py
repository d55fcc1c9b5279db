"""The example programs do what their comments say."""

from __future__ import annotations

import ctypes
import runpy
import shutil
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from plctool.compiler import IoFiles, compile_sources
from plctool.sim import Simulator

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
BENCH = ROOT / "bench"
INTERVAL_MS = 10
STEP_PERCENT = 0.1  # what a level moves in INTERVAL_MS at most: single precision may see a tank empty a step later


def started(name: str) -> Simulator:
    result = compile_sources([EXAMPLES / name])
    assert not result.warnings
    return Simulator(result.image, result.symbols)


@dataclass
class Tanks:
    """The controller, and the plant in Python at its simulated inputs and outputs."""

    plc: Simulator
    plant: Any  # examples/tanks/plant.py: Plant

    def level(self) -> float:
        """Of the process tank, %."""
        return float(self.plant.process.level)


@pytest.fixture
def tanks() -> Iterator[Tanks]:
    with started("tanks") as plc:
        file = runpy.run_path(str(EXAMPLES / "tanks/plant.py"))
        plc.attach(file["step"], file["EVERY_MS"])
        yield Tanks(plc, file["plant"])


def test_blink_is_half_a_second_dark_and_half_a_second_bright() -> None:
    with started("blink") as plc:
        lamp = []
        for _ in range(30):
            plc.run_for(100)
            lamp.append(plc.read("Main.lamp"))
    changes = [i for i in range(1, len(lamp)) if lamp[i] != lamp[i - 1]]
    assert not lamp[0]
    assert all(4 <= later - earlier <= 6 for earlier, later in pairwise(changes))
    assert len(changes) >= 4


def test_traffic_light_goes_through_its_phases() -> None:
    with started("traffic_light") as plc:
        seen = [plc.read("Main.state")]
        for _ in range(400):
            plc.run_cycles(1)
            if plc.read("Main.state") != seen[-1]:
                seen.append(plc.read("Main.state"))
            assert plc.read("Main.cars.green") + plc.read("Main.walk") <= 1
    assert seen[:5] == ["Red", "RedYellow", "Green", "Yellow", "Red"]


def test_batch_fills_both_components_at_once_and_counts_what_it_made() -> None:
    steps = ("Idle", "FillA", "FullA", "FillB", "FullB", "Mix", "Empty")
    seen: list[list[str]] = []
    with started("batch") as plc:
        for _ in range(1700):
            plc.run_cycles(1)
            active = [name for name in steps if plc.read(f"Main.mixer.{name}.X")]
            if not seen or active != seen[-1]:
                seen.append(active)
        assert plc.read("Main.mixer.batches") == 1
    assert seen[:3] == [["Idle"], ["FillA", "FillB"], ["FillA", "FullB"]]
    assert seen[3:] == [["FullA", "FullB"], ["Mix"], ["Empty"], ["Idle"], ["FillA", "FillB"]]


def test_traffic_light_shortens_green_for_the_button() -> None:
    with started("traffic_light") as plc:
        plc.run_for(8000)
        assert plc.read("Main.text").startswith("green since T#")
        plc.write({"Main.button": True})
        plc.run_for(5000)
        assert plc.read("Main.state") in ("Yellow", "Red")


def test_tanks_level_settles_at_the_set_point_within_fifteen_seconds(tanks: Tanks) -> None:
    for setpoint in (50.0, 65.0, 30.0):
        tanks.plc.write({"Control.setpoint": setpoint})
        tanks.plc.run_for(seconds=15)
        levels = []
        for _ in range(50):
            tanks.plc.run_for(100)
            levels.append(tanks.level())
        assert all(abs(level - setpoint) < 1.5 for level in levels)


def test_tanks_pump_does_not_run_dry(tanks: Tanks) -> None:
    tanks.plc.run_for(seconds=2)
    assert tanks.plc.read("Control.pump")
    tanks.plant.supply.volume = 10.0  # 2.5 %
    tanks.plc.run_for(50)
    assert not tanks.plc.read("Control.pump")
    assert tanks.plc.read("Control.inlet")
    tanks.plc.run_for(seconds=10)
    assert tanks.plant.supply.level > 6
    assert tanks.plc.read("Control.pump")


def test_tanks_pump_stays_off_for_its_least_time(tanks: Tanks) -> None:
    tanks.plc.run_for(400)
    assert not tanks.plc.read("Control.pump")
    tanks.plc.run_for(200)
    assert tanks.plc.read("Control.pump")


def test_tanks_alarm_waits_and_is_acknowledged(tanks: Tanks) -> None:
    tanks.plc.write({"Control.mode": "Off"})
    tanks.plc.run_for(seconds=1.9)
    assert not tanks.plc.output("Panel.low")
    tanks.plc.run_for(200)
    assert tanks.plc.output("Panel.low")
    assert tanks.plc.output("Panel.horn")
    tanks.plc.write({"Control.acknowledge": True})
    tanks.plc.run_for(50)
    assert tanks.plc.output("Panel.low")
    assert not tanks.plc.output("Panel.horn")


def test_tanks_set_point_survives_a_warm_start(tanks: Tanks) -> None:
    tanks.plc.write({"Control.setpoint": 42.0})
    tanks.plc.run_for(seconds=1)
    tanks.plc.restart()
    assert tanks.plc.read("Control.setpoint") == 42.0


def test_tanks_stop_while_the_plant_does_not_reply_and_go_on_when_it_does(tanks: Tanks) -> None:
    tanks.plc.run_for(seconds=15)
    seen = tanks.plc.read("Control.level2")
    tanks.plc.fault("Plant", "absent")
    tanks.plc.run_for(seconds=5)
    assert tanks.plc.read("Control.pump", "Control.inlet", "Control.speed", "Plant.ok") == {
        "Control.pump": False, "Control.inlet": False, "Control.speed": 0.0, "Plant.ok": False
    }  # fmt: skip
    assert tanks.plc.output("Panel.plant")
    assert tanks.plc.read("Control.level2") == pytest.approx(seen, abs=0.5)  # it holds what it saw last
    tanks.plc.fault("Plant", "absent", 0)
    tanks.plc.run_for(seconds=15)
    assert tanks.plc.read("Plant.ok")
    assert not tanks.plc.output("Panel.plant")
    assert tanks.level() == pytest.approx(50.0, abs=1.5)


def test_plant_in_st_is_the_one_in_python() -> None:
    plant = runpy.run_path(str(EXAMPLES / "tanks/plant.py"))["Plant"]()
    built = compile_sources([EXAMPLES / "tanks/plant.st"], io=IoFiles(wanted=False))
    with Simulator(built.image, built.symbols) as st:
        for pump, speed, inlet, demand in ((True, 60.0, True, 1.0), (False, 80.0, False, 0.5), (True, 100.0, False, 1)):
            plant.pump, plant.speed, plant.inlet, plant.demand = pump, speed, inlet, demand
            st.write({
                "TankPlant.pump": pump, "TankPlant.speed": speed, "TankPlant.inlet": inlet, "TankPlant.demand": demand
            })  # fmt: skip
            for _ in range(3000):
                st.run_cycles(1)
                plant.step(INTERVAL_MS / 1000)
                assert plant.supply.level == pytest.approx(st.read("TankPlant.level1"), abs=STEP_PERCENT)
                assert plant.process.level == pytest.approx(st.read("TankPlant.level2"), abs=STEP_PERCENT)


@pytest.fixture
def twin(tmp_path: Path) -> ctypes.CDLL:
    """The C twin of the tanks."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = tmp_path / "tanks.so"
    source = EXAMPLES / "tanks/c/tanks.c"
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", library, source, "-lm"], check=True)
    twin = ctypes.CDLL(str(library))
    twin.tanks_set.argtypes = [ctypes.c_float]
    twin.tanks_checksum.restype = ctypes.c_uint32
    twin.tanks_init()
    return twin


def bits(value: float) -> int:
    return int.from_bytes(struct.pack("<f", value), "little")


def checksum(plc: Simulator) -> int:
    """As in the C twin."""
    return (bits(plc.read("Plant.level1")) * 31 + bits(plc.read("Plant.level2"))) % (1 << 32)


def test_tanks_have_the_levels_of_the_twin_in_c_bit_by_bit(twin: ctypes.CDLL) -> None:
    """Both as `make bench` has them: the plant in ST beside the controller."""
    sources = [EXAMPLES / f"tanks/{name}.st" for name in ("types", "blocks", "control", "plant")]
    built = compile_sources([BENCH / "tanks.st", *sources], io=IoFiles(wanted=False))
    with Simulator(built.image, built.symbols) as plc:
        for cycle in range(3000):
            if cycle == 1500:
                plc.write({"Control.setpoint": 75.0})
                twin.tanks_set(75.0)
            plc.run_cycles(1)
            twin.plant_cycle(INTERVAL_MS * cycle)
            twin.control_cycle(INTERVAL_MS * cycle)
            assert checksum(plc) == twin.tanks_checksum(), f"cycle {cycle}"
