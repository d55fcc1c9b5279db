"""A program with its real description, on simulated devices and the virtual clock."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build

from plctool.compiler.image.build import BuildResult
from plctool.errors import UsageError
from plctool.sim import Simulator

PROGRAM = """\
PROGRAM Main
VAR start, door, motor : BOOL; level : INT; speed : REAL; valve : Valve; ok : BOOL; n : UDINT; END_VAR
motor := start AND NOT door;
speed := INT_TO_REAL(level) / 4.0;
valve(wanted := level > 10);
ok := Bench.ok;
n := n + 1;
END_PROGRAM
FUNCTION_BLOCK Valve
VAR_INPUT wanted : BOOL; END_VAR
VAR open : BOOL; END_VAR
open := wanted;
END_FUNCTION_BLOCK
"""
DESCRIPTION = """\
[gpio]
in = { DI0 = "Main.start", DI1 = { var = "Main.door", invert = true } }
out = { DO0 = { var = "Main.motor", on_stop = "hold" }, DO1 = "Main.valve.open" }
[[sim]]
name = "Bench"
in = { level = { var = "Main.level", on_error = "zero" } }
out = { speed = { var = "Main.speed", on_stop = 2.5 }, lamp = "%QX40.3" }
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return build(tmp_path_factory.mktemp("io"), PROGRAM, DESCRIPTION)


@pytest.fixture
def plc(built: BuildResult) -> Simulator:
    with Simulator(built.image, built.symbols) as plc:
        yield plc  # type: ignore[misc]


def test_input_reaches_the_program_and_its_output_the_device(plc: Simulator) -> None:
    plc.set_input("gpio.DI0", True)
    assert plc.output("gpio.DO0") is False
    plc.run_cycles(1)
    assert plc.read("Main.motor") is True
    assert plc.output("DO0") is True


def test_channel_has_the_name_of_its_variable_too(plc: Simulator) -> None:
    plc.set_input("main.START", True)
    plc.run_cycles(1)
    assert plc.output("Main.motor") is True
    assert plc.read("gpio.DO0") is True


def test_numbers_go_both_ways(plc: Simulator) -> None:
    plc.set_input("level", -7)
    plc.run_cycles(1)
    assert plc.output("speed") == -1.75


def test_part_of_an_instance_is_an_output(plc: Simulator) -> None:
    plc.set_input("level", 11)
    plc.run_cycles(1)
    assert plc.output("DO1") is True


def test_input_that_is_written_stays(plc: Simulator) -> None:
    plc.write({"Main.start": True, "Main.level": 300})
    plc.run_cycles(3)
    assert plc.read("Main.motor", "Main.level") == {"Main.motor": True, "Main.level": 300}


def test_outputs_are_as_the_description_says_when_the_program_stops(plc: Simulator) -> None:
    plc.set_input("DI0", True)
    plc.set_input("level", 100)
    plc.run_cycles(1)
    plc.stop()
    plc.run_for(100)
    assert (plc.output("DO0"), plc.output("DO1"), plc.output("speed")) == (True, False, 2.5)


def test_lost_device_is_seen_by_the_program(plc: Simulator) -> None:
    plc.set_input("level", 5)
    plc.run_cycles(2)
    assert plc.read("Main.ok") is True
    plc.fault("Bench", "absent")
    plc.run_cycles(20)
    assert plc.read("Main.ok", "Main.level") == {"Main.ok": False, "Main.level": 0}
    assert plc.read("Bench.errors") > 0
    plc.fault("Bench", "absent", 0)
    plc.run_cycles(20)
    assert plc.read("Main.ok", "Main.level") == {"Main.ok": True, "Main.level": 5}


def test_plant_runs_on_the_virtual_clock(plc: Simulator) -> None:
    times: list[int] = []

    def step(plant: Simulator) -> None:
        times.append(plant.now_ns // 1_000_000)
        plant.set_input("level", len(times))

    plc.attach(step, every_ms=25)
    plc.run_for(100)
    assert times == [25, 50, 75, 100]
    plc.run_cycles(10)
    assert len(times) == 7  # what was due at 125, 150 and 175 ms
    assert plc.output("level") == 7


def test_unknown_channel_is_an_error_with_a_hint(plc: Simulator) -> None:
    with pytest.raises(UsageError, match=r"There is no channel gpio\.DI7; did you mean gpio\.DI"):
        plc.set_input("gpio.DI7", True)
    with pytest.raises(UsageError, match=r"gpio\.DO0 is an output: the program sets it"):
        plc.set_input("DO0", True)
    with pytest.raises(UsageError, match="choose one of absent, late, type, answers"):
        plc.fault("Bench", "broken")


def test_plant_goes_on_after_a_restart(plc: Simulator) -> None:
    steps: list[int] = []
    plc.attach(lambda plant: steps.append(plant.now_ns // 1_000_000), every_ms=10)
    plc.run_for(25)
    plc.restart()
    plc.run_for(25)
    assert steps == [10, 20, 10, 20]


def test_image_survives_a_restart(plc: Simulator) -> None:
    plc.set_input("DI0", True)
    plc.restart()
    plc.set_input("DI0", True)
    plc.start()
    plc.run_cycles(1)
    assert plc.output("DO0") is True


def test_input_of_a_device_that_is_not_enabled_is_plain_memory(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION + '[[sim]]\nname = "Spare"\nenabled = false\nin = { n = "Main.n" }\n')
    with Simulator(built.image, built.symbols) as plc:
        plc.write({"Main.n": 5})
        assert plc.read("Main.n") == 5
        with pytest.raises(UsageError, match=r"Spare.n is of a device that is not enabled"):
            plc.set_input("Spare.n", 5)
        plc.set_input("level", 5)
        plc.run_cycles(1)
        assert plc.read("Main.speed") == 1.25
