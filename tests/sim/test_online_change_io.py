"""Online changes of programs with inputs and outputs, in the simulator."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import VALVES
from online_programs import built

from plctool import Simulator
from plctool.core import lib
from plctool.iec.types import UDINT

SOURCE = """PROGRAM Main
VAR button, motor, lamp, switch, coil : BOOL; level, seen, sent, register, setpoint : INT; opened, coils : BYTE;
n : DINT; lost : UDINT; END_VAR
motor := button; n := n + 1; coil := switch; coils := opened; sent := register + setpoint;
IF n > 100 AND NOT (Bench.ok AND Drive.ok AND Valves.ok) THEN lost := lost + 1; END_IF
END_PROGRAM
PROGRAM Other VAR n : DINT; END_VAR n := n + 1; END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
TASK Fast(INTERVAL := T#10ms, PRIORITY := 1); TASK Slow(INTERVAL := T#20ms, PRIORITY := 2);
PROGRAM Main WITH Fast : Main; PROGRAM Other WITH Slow : Other;
END_RESOURCE END_CONFIGURATION
"""
DEVICES = """
[gpio.in]
DI0 = "Main.switch"
[gpio.out]
DO0 = "Main.coil"
[[sim]]
name = "Bench"
in = { button = "Main.button", level = "Main.level" }
out = { motor = { var = "Main.motor", on_stop = 1 }, lamp = "Main.lamp" }
[modbus.server.tcp]
name = "Scada"
holding = { 40001 = "Main.setpoint" }
[[modbus.tcp]]
host = "10.0.0.1"
[[modbus.tcp.device]]
name = "Drive"
read = [ { function = 3, address = 40001, every = "T#20ms", var = "Main.register" } ]
write = [ { function = 16, address = 40101, every = "T#50ms", on_change = true, var = "Main.sent" } ]
[[canopen]]
name = "Bus"
node = 127
[[canopen.device]]
name = "Valves"
node = 9
eds = "valves.eds"
heartbeat = "T#200ms"
set = { "2001" = 700, "2000" = "press twenty-five" }
in = { "6000:01" = "Main.opened" }
out = { "6200:01" = "Main.coils" }
"""
# What the second task does besides: it reads and writes channels that only the first one did, or did not.
BODIES = (
    "Main.lamp := Main.level = 7;",
    "Main.seen := Main.register; Main.coils.7 := Main.opened.0;",
    "Main.seen := Main.level; Main.lamp := NOT Main.switch;",
    "",
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(VALVES, tmp_path)
    (tmp_path / "devices.io.toml").write_text(DEVICES)
    return tmp_path


@pytest.fixture
def plc(folder: Path) -> Iterator[Simulator]:
    result = built(folder, SOURCE)
    with Simulator(result.image, result.symbols) as plc:
        yield plc


def change(plc: Simulator, folder: Path, text: str) -> None:
    result = built(folder, text, plc.symbols())
    assert result.change is not None and result.change.problems == []
    plc.add_symbols(result.symbols)
    plc.change(result.image)


def with_body(body: str) -> str:
    return SOURCE.replace("PROGRAM Other VAR n : DINT; END_VAR", f"PROGRAM Other VAR n : DINT; END_VAR {body}")


VALVES_OUTPUTS = 0x209
OUTPUTS = {"Main.motor": True, "Main.coil": True, "Main.sent": 42, "Main.coils": 0x5A}


def test_devices_of_all_drivers_go_on_through_changes_and_no_output_is_disturbed(plc: Simulator, folder: Path) -> None:
    for name, value in (("button", True), ("switch", True), ("register", 42), ("level", 7), ("opened", 0x5A)):
        plc.set_input(f"Main.{name}", value)
    plc.run_for(2000)
    boots = plc.io_read_parameter("Valves", int(lib.CANOPEN_PARAM_BOOTS), UDINT)
    plc.can_receive()
    for body in BODIES:
        change(plc, folder, with_body(body))
        for _ in range(40):
            assert {name: plc.output(name) for name in OUTPUTS} == OUTPUTS
            plc.run_for(5)
    assert plc.read("Main.seen") == 7 and plc.output("Main.lamp") is False
    assert plc.read("Main.lost") == 0
    assert plc.io_read_parameter("Valves", int(lib.CANOPEN_PARAM_BOOTS), UDINT) == boots
    assert {bytes(f.data) for f in plc.can_receive() if f.id == VALVES_OUTPUTS} <= {b"\x5a"}
    assert not any("lost" in entry.text for entry in plc.log())
    plc.set_input("Main.opened", 0x11)
    plc.set_input("Main.setpoint", 3)
    plc.fault("Drive", "absent")
    plc.run_for(4000)
    assert plc.output("Main.coils") == 0x11
    assert plc.read("Main.sent") == 45
    assert "Drive is lost: it does not reply" in [entry.text for entry in plc.log()]


def test_node_that_is_being_configured_gets_all_of_it(plc: Simulator, folder: Path) -> None:
    for n in range(8):
        plc.run_for(9)
        change(plc, folder, with_body(f"n := n + {n};"))
    plc.run_for(2000)
    assert plc.read("Valves.ok") and plc.read("Main.lost") == 0
    assert plc.io_read_parameter("Valves", int(lib.CANOPEN_PARAM_BOOTS), UDINT) == 1
    texts = [f.data for f in plc.can_receive() if f.id == 0x609]
    assert b"press twenty-five" in b"".join(bytes(data[1:]) for data in texts if data[0] & 0xE0 == 0)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("node = 127\n", 'node = 127\n[[sim]]\nname = "More"\n', "More"),
        ('every = "T#50ms"', 'every = "T#60ms"', "Drive"),
        (', lamp = "Main.lamp"', "", "gpio, Drive, Bench"),  # those after it in the outputs have other places
        ("on_stop = 1", 'on_stop = "hold"', "Bench"),
        ('"Main.switch"', '{ var = "Main.switch", invert = true }', "gpio"),
    ],
)
def test_other_devices_are_refused_by_name(plc: Simulator, folder: Path, old: str, new: str, names: str) -> None:
    assert DEVICES.count(old) == 1
    (folder / "devices.io.toml").write_text(DEVICES.replace(old, new))
    result = built(folder, SOURCE, plc.symbols())
    assert result.change is not None
    (problem,) = result.change.problems
    assert problem == f"the I/O configuration has changed ({names})"
