"""The example programs do what their comments say."""

from __future__ import annotations

import ctypes
import shutil
import struct
import subprocess
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.sim import Simulator

EXAMPLES = Path(__file__).parents[2] / "examples"
PLANT_MS = 5
CONTROL_MS = 10


def started(name: str) -> Simulator:
    result = compile_sources([EXAMPLES / name])
    assert not result.warnings
    return Simulator(result.image, result.symbols)


@pytest.fixture
def tanks() -> Iterator[Simulator]:
    with started("tanks") as plc:
        yield plc


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


def test_tanks_level_settles_at_the_set_point_within_fifteen_seconds(tanks: Simulator) -> None:
    for setpoint in (50.0, 65.0, 30.0):
        tanks.write({"Control.setpoint": setpoint})
        tanks.run_for(seconds=15)
        levels = []
        for _ in range(50):
            tanks.run_for(100)
            levels.append(tanks.read("Plant.level2"))
        assert all(abs(level - setpoint) < 1.5 for level in levels)


def test_tanks_pump_does_not_run_dry(tanks: Simulator) -> None:
    tanks.run_for(seconds=2)
    assert tanks.read("Control.pump")
    tanks.write({"Plant.supply.volume": 10.0})  # 2.5 %
    tanks.run_for(50)
    assert not tanks.read("Control.pump")
    assert tanks.read("Control.inlet")
    tanks.run_for(seconds=10)
    assert tanks.read("Plant.level1") > 6
    assert tanks.read("Control.pump")


def test_tanks_pump_stays_off_for_its_least_time(tanks: Simulator) -> None:
    tanks.run_for(400)
    assert not tanks.read("Control.pump")
    tanks.run_for(200)
    assert tanks.read("Control.pump")


def test_tanks_alarm_waits_and_is_acknowledged(tanks: Simulator) -> None:
    tanks.write({"Control.mode": "Off"})
    tanks.run_for(seconds=1.9)
    assert not tanks.read("Control.alarm_low")
    tanks.run_for(200)
    assert tanks.read("Control.alarm_low")
    assert tanks.read("Control.horn")
    tanks.write({"Control.acknowledge": True})
    tanks.run_for(50)
    assert tanks.read("Control.alarm_low")
    assert not tanks.read("Control.horn")


def test_tanks_set_point_survives_a_warm_start(tanks: Simulator) -> None:
    tanks.write({"Control.setpoint": 42.0})
    tanks.run_for(seconds=1)
    tanks.restart()
    assert tanks.read("Control.setpoint") == 42.0


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


def test_tanks_have_the_levels_of_the_twin_in_c_bit_by_bit(tanks: Simulator, twin: ctypes.CDLL) -> None:
    for cycle in range(3000):
        if cycle == 1500:
            tanks.write({"Control.setpoint": 75.0})
            twin.tanks_set(75.0)
        tanks.run_cycles(1)
        for now in range(CONTROL_MS * cycle - PLANT_MS, CONTROL_MS * cycle + 1, PLANT_MS):
            if now >= 0:
                twin.plant_cycle(now)
        twin.control_cycle(CONTROL_MS * cycle)
        assert checksum(tanks) == twin.tanks_checksum(), f"cycle {cycle}"
