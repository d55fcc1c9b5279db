"""A plant that is a program in ST, beside the controller on the same virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build

from plctool.compiler import compile_sources
from plctool.errors import DeviceError, UsageError
from plctool.sim import Simulator
from plctool.sim_plant import PlantProgram

PROGRAM = """\
PROGRAM Main
VAR level : REAL; pump : BOOL; END_VAR
IF level < 30.0 THEN pump := TRUE; ELSIF level > 60.0 THEN pump := FALSE; END_IF;
END_PROGRAM
"""
DESCRIPTION = "[[sim]]\nname = 'Tank'\nin = { level = 'Main.level' }\nout = { pump = 'Main.pump' }\n"
PLANT = """\
PROGRAM Plant
VAR Tank_pump : BOOL; level : REAL := 20.0; END_VAR
level := level + SEL(Tank_pump, -0.1, 0.2);
END_PROGRAM
"""


def plant(folder: Path, text: str) -> PlantProgram:
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.st").write_text(text)
    built = compile_sources([folder / "plant"])
    return PlantProgram(built.image, built.symbols)


def test_controller_keeps_the_level_of_the_plant(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    levels = []
    with plant(tmp_path, PLANT) as tank, Simulator(built.image, built.symbols) as plc:
        assert tank.every_ms == 10
        plc.attach(tank, tank.every_ms)
        for _ in range(60):
            plc.run_for(200)
            levels.append(plc.read("Main.level"))
    assert max(levels[10:]) == pytest.approx(60, abs=3)
    assert min(levels[10:]) == pytest.approx(30, abs=3)


def test_a_device_that_is_not_enabled_is_no_concern_of_the_plant(tmp_path: Path) -> None:
    spare = "[[sim]]\nname = 'Spare'\nenabled = false\nin = { level = 'Main.other' }\n"
    text = PROGRAM.replace("pump : BOOL;", "other : REAL; pump : BOOL;")
    built = build(tmp_path, text, DESCRIPTION + spare)
    with plant(tmp_path, PLANT) as tank, Simulator(built.image, built.symbols) as plc:
        plc.attach(tank, tank.every_ms)
        plc.run_for(200)
        assert plc.read("Main.other") == 0.0
        assert plc.read("Main.level") > 20.0


def test_a_plant_that_is_killed_is_told_of(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    with (
        pytest.raises(DeviceError, match="The plant failed: its process ended"),
        plant(tmp_path, PLANT) as tank,
        Simulator(built.image, built.symbols) as plc,
    ):
        plc.attach(tank, tank.every_ms)
        tank._process.kill()
        tank._process.wait()
        plc.run_for(200)


MODBUS = """\
[[modbus.tcp]]
host = "127.0.0.1"
[[modbus.tcp.device]]
name = "Tank"
[[modbus.tcp.device.read]]
function = 4
address = 30001
every = "T#20ms"
var = "Main.level"
[[modbus.tcp.device.write]]
function = 5
address = 1
on_change = true
var = "Main.pump"
"""


def test_plant_is_on_a_bus_too(tmp_path: Path) -> None:
    """There channels have the names of variables."""
    built = build(tmp_path, PROGRAM, MODBUS)
    with plant(tmp_path, PLANT) as tank, Simulator(built.image, built.symbols) as plc:
        plc.attach(tank, tank.every_ms)
        plc.run_for(seconds=2)
        assert plc.output("Main.pump") is True
        assert plc.read("Main.level") > 30.0


def test_block_in_the_plant_may_have_the_name_of_a_channel(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    text = """\
FUNCTION_BLOCK Motor VAR runs : BOOL; END_VAR runs := TRUE; END_FUNCTION_BLOCK
PROGRAM Plant
VAR pump : Motor; level : REAL; END_VAR
pump();
level := level + 1.0;
END_PROGRAM
"""
    with plant(tmp_path, text) as tank, Simulator(built.image, built.symbols) as plc:
        plc.attach(tank, tank.every_ms)
        plc.run_for(100)
        assert plc.read("Main.level") > 0.0


def test_exception_of_the_plant_is_named(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    text = "PROGRAM Plant\nVAR level : REAL; n, m : INT; END_VAR\nn := 1 / m;\nEND_PROGRAM\n"
    with plant(tmp_path, text) as tank, Simulator(built.image, built.symbols) as plc:
        plc.attach(tank, tank.every_ms)
        with pytest.raises(DeviceError, match=r"The plant failed: The program stopped: DIVIDEBYZERO.*plant\.st:3"):
            plc.run_for(100)


def test_plant_without_any_of_the_channels_is_an_error(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    text = "PROGRAM Plant\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n"
    with plant(tmp_path, text) as tank, Simulator(built.image, built.symbols) as plc:
        plc.attach(tank, tank.every_ms)
        with pytest.raises(UsageError, match="none of the variables level, pump"):
            plc.run_for(100)
