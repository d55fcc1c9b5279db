"""Simulated Modbus devices at the end of wires that take their time, with the description as a controller has it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool import Simulator, UsageError
from plctool.iec.types import UDINT

SOURCE = """
PROGRAM Main
VAR
    level, other, far : INT;
    pump : BOOL;
    speed : REAL;
    low : WORD;
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
"""
DESCRIPTION = """
[[modbus.rs485]]
name = "Bus"
port = "/dev/ttyS1"
baud = 19200
[[modbus.rs485.device]]
name = "Tank"
unit = 3
timeout = "T#200ms"
[[modbus.rs485.device.read]]
function = 4
address = 30001
every = "T#100ms"
var = "Main.level"
[[modbus.rs485.device.write]]
function = 5
address = 1
on_change = true
var = "Main.pump"
[[modbus.rs485.device]]
name = "Drive"
unit = 4
timeout = "T#200ms"
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#100ms"
var = "Main.other"
[[modbus.rs485.device.write]]
function = 16
address = 40101
every = "T#1s"
on_change = true
verify = true
var = "Main.speed"

[[modbus.tcp]]
name = "Net"
host = "192.168.0.7"
[[modbus.tcp.device]]
name = "Remote"
timeout = "T#200ms"
[[modbus.tcp.device.read]]
function = 4
address = 30001
every = "T#50ms"
var = "Main.far"
"""
DEVICES = ("Tank", "Drive", "Remote")


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    (tmp_path / "main.st").write_text(SOURCE)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION)
    with Simulator.from_sources(tmp_path / "main.st") as made:
        made.run_for(1000)
        assert good(made) == DEVICES
        yield made


def good(plc: Simulator) -> tuple[str, ...]:
    return tuple(name for name in DEVICES if plc.read(f"{name}.ok"))


def steps_until(plc: Simulator, name: str, value: object, limit: int = 10_000) -> int:
    """Virtual ms until a variable has a value."""
    for ms in range(limit):
        if plc.read(name) == value:
            return ms
        plc.run_for(1)
    raise AssertionError(f"{name} never was {value}")


def requests(plc: Simulator, device: str) -> int:
    """That the driver has sent."""
    return int(plc.io_read_parameter(device, 0x8000, UDINT))


def test_an_input_is_as_old_as_the_line_makes_it(plc: Simulator) -> None:
    """10 ms of the task, 100 ms until it is read again, 8 and 7 characters of 0.573 ms, silences, and the device."""
    ages = set()
    for value in range(1, 40):
        plc.set_input("Main.level", value)
        ages.add(steps_until(plc, "Main.level", value))
        plc.run_for(7 * value % 31)
    assert max(ages) - min(ages) > 10
    assert 80 < max(ages) <= 10 + 100 + 8.6 + 2 * 2.1 + 2 + 2 * 15


def test_an_output_is_on_its_way_for_a_frame(plc: Simulator) -> None:
    """8 characters and silence; another request may be on the line first."""
    plc.write({"Main.pump": True})
    plc.run_for(4)
    assert plc.output("Main.pump") is False
    plc.run_for(50)
    assert plc.output("Main.pump") is True


def test_each_is_asked_as_often_as_the_description_says(plc: Simulator) -> None:
    before = {name: requests(plc, name) for name in DEVICES}
    plc.run_for(seconds=60)
    assert {name: requests(plc, name) - before[name] for name in DEVICES} == {
        "Tank": pytest.approx(600, abs=1),
        "Drive": pytest.approx(600 + 2 * 60, abs=2),  # it is written every second, and read back
        "Remote": pytest.approx(1200, abs=1),
    }


def test_a_lost_device_costs_the_others_little_and_comes_back_by_itself(plc: Simulator) -> None:
    plc.fault("Tank", "absent")
    plc.run_for(1000)
    assert good(plc) == ("Drive", "Remote")
    before = requests(plc, "Drive")
    plc.run_for(seconds=10)
    assert requests(plc, "Drive") - before == pytest.approx(120, abs=4)
    plc.fault("Tank", "absent", 0)
    plc.set_input("Main.level", 7)
    plc.run_for(seconds=11)  # docs/modbus.md: ask_again
    assert (good(plc), plc.read("Main.level")) == (DEVICES, 7)


def test_a_line_that_is_pulled_takes_its_devices_only(plc: Simulator) -> None:
    before = requests(plc, "Remote")
    plc.fault("Bus", "absent")
    plc.run_for(1500)  # three time-outs of each device
    assert good(plc) == ("Remote",)
    assert requests(plc, "Remote") - before == pytest.approx(30, abs=1), "the period of the others is unchanged"
    plc.fault("Bus", "absent", 0)
    plc.run_for(seconds=2)
    assert good(plc) == DEVICES


def test_a_connection_that_is_pulled_is_made_again(plc: Simulator) -> None:
    plc.fault("Net", "absent")
    plc.run_for(seconds=5)
    assert good(plc) == ("Tank", "Drive")
    plc.fault("Net", "absent", 0)
    plc.set_input("Main.far", 5)
    plc.run_for(seconds=8)
    assert (good(plc), plc.read("Main.far")) == (DEVICES, 5)


@pytest.mark.parametrize(("device", "line", "damaged"), [("Tank", "Bus", 1), ("Remote", "Net", 0)])
def test_a_damaged_reply_is_not_taken_and_asked_for_again(plc: Simulator, device: str, line: str, damaged: int) -> None:
    variable = {"Tank": "Main.level", "Remote": "Main.far"}[device]
    errors, bad_frames = plc.read(f"{device}.errors"), plc.io_read_parameter(line, 0x8007, UDINT)
    plc.fault(device, "answers", 1)
    plc.set_input(variable, 3)
    assert steps_until(plc, variable, 3) > 100
    assert plc.read(f"{device}.ok") is True
    assert plc.read(f"{device}.errors") == errors + 1
    assert plc.io_read_parameter(line, 0x8007, UDINT) == bad_frames + damaged, "a wrong CRC; on TCP the end is missing"


@pytest.mark.parametrize(("device", "line"), [("Tank", "Bus"), ("Remote", "Net")])
def test_half_a_reply_is_not_taken_and_asked_for_again(plc: Simulator, device: str, line: str) -> None:
    variable = {"Tank": "Main.level", "Remote": "Main.far"}[device]
    errors, bad_frames = plc.read(f"{device}.errors"), plc.io_read_parameter(line, 0x8007, UDINT)
    plc.fault(device, "cut", 2)
    plc.set_input(variable, 3)
    assert steps_until(plc, variable, 3) > 200, "both time-outs of 200 ms, or the next two requests"
    assert plc.read(f"{device}.ok") is True
    assert plc.read(f"{device}.errors") == errors + 2
    on_a_serial_line = 2 if line == "Bus" else 0
    assert plc.io_read_parameter(line, 0x8007, UDINT) == bad_frames + on_a_serial_line
    assert plc.io_read_parameter(device, 0x8001, UDINT) == 2, "time-outs"


def test_half_replies_are_a_lost_device_and_leave_the_line_to_others(plc: Simulator) -> None:
    plc.fault("Tank", "cut", 4_000_000_000)
    plc.run_for(2000)
    assert good(plc) == ("Drive", "Remote")
    before = requests(plc, "Drive")
    plc.run_for(seconds=10)
    assert requests(plc, "Drive") - before == pytest.approx(120, abs=4)
    plc.fault("Tank", "cut", 0)
    plc.run_for(seconds=62)
    assert good(plc) == DEVICES


def test_a_late_reply_makes_the_data_old_and_a_very_late_one_is_none(plc: Simulator) -> None:
    plc.fault("Tank", "late", 150)
    plc.run_for(2000)
    assert plc.read("Tank.ok") is True
    plc.fault("Tank", "late", 250)
    plc.run_for(2000)
    assert good(plc) == ("Drive", "Remote")


def test_another_device_than_described_refuses(plc: Simulator) -> None:
    plc.fault("Drive", "type")
    plc.run_for(2000)
    assert good(plc) == ("Tank", "Remote")
    assert plc.io_read_parameter("Drive", 0x8005, UDINT) == 2


def test_what_is_no_fault_of_a_line_is_said(plc: Simulator) -> None:
    with pytest.raises(UsageError, match="a line can only be absent"):
        plc.fault("Bus", "late", 5)
    with pytest.raises(UsageError, match="absent, late"):
        plc.fault("Bus", "broken")


def test_a_program_and_the_description_mean_the_same_register(plc: Simulator) -> None:
    plc.set_modbus("Tank", 30001, 99)
    plc.run_for(200)
    assert plc.read("Main.level") == 99


def test_a_stop_switches_off_what_is_connected(plc: Simulator) -> None:
    plc.write({"Main.pump": True})
    plc.run_for(200)
    assert plc.output("Main.pump") is True
    plc.stop()
    plc.run_for(200)
    assert plc.output("Main.pump") is False


def test_an_hour_of_bus_is_complete(plc: Simulator) -> None:
    before = {name: requests(plc, name) for name in DEVICES}
    plc.run_for(seconds=3600)
    assert {name: requests(plc, name) - before[name] for name in DEVICES} == {
        "Tank": pytest.approx(36_000, abs=2),
        "Drive": pytest.approx(36_000 + 2 * 3_600, abs=4),
        "Remote": pytest.approx(72_000, abs=2),
    }
    assert good(plc) == DEVICES
    assert [plc.read(f"{name}.errors") for name in DEVICES] == [0, 0, 0]


def test_a_serial_line_in_the_network_has_the_same_devices_and_faults(tmp_path: Path) -> None:
    text = DESCRIPTION.replace('[[modbus.rs485]]\nname = "Bus"\nport = "/dev/ttyS1"\nbaud = 19200\n', "", 1)
    text = text.replace("modbus.rs485", "modbus.tcp")
    (tmp_path / "main.st").write_text(SOURCE)
    line = '[[modbus.tcp]]\nname = "Bus"\nhost = "10.0.0.1"\nport = 8899\nframing = "rtu"\n'
    (tmp_path / "main.io.toml").write_text(line + text)
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        plc.run_for(1000)
        assert good(plc) == DEVICES
        plc.set_input("Main.level", 7)
        plc.write({"Main.speed": 1.5})
        plc.run_for(300)
        assert (plc.read("Main.level"), plc.output("Main.speed")) == (7, 1.5)
        for fault in ("absent", "answers", "cut"):
            plc.fault("Tank", fault, 3)
            plc.run_for(1500)
            assert requests(plc, "Tank") > 0 and plc.read("Tank.errors") >= 2
            plc.fault("Tank", fault, 0)
            plc.run_for(11_000)
            assert good(plc) == DEVICES


@pytest.mark.parametrize("host", ["meter-7.plant", "fd00::7"])
def test_a_host_that_is_looked_up_has_the_same_devices(tmp_path: Path, host: str) -> None:
    assert DESCRIPTION.count("192.168.0.7") == 1
    (tmp_path / "main.st").write_text(SOURCE)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION.replace("192.168.0.7", host))
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        plc.run_for(1000)
        assert good(plc) == DEVICES
        plc.fault("Net", "absent")
        plc.run_for(5000)
        assert good(plc) == ("Tank", "Drive")
