"""Requests that a program makes of devices of pymodbus, by MODBUS_READ and MODBUS_WRITE, beside what is exchanged again
and again."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from free_ports import free_port
from modbus_support import Devices, Wire

import plctool
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR
    read : MODBUS_READ; write : MODBUS_WRITE; get, set : BOOL;
    device : STRING := 'Meter'; reference : UDINT := 40011; readBy : USINT := 3; writeBy : USINT := 16;
    count : UINT := 3;
    words : ARRAY[1..10] OF WORD; values : ARRAY[1..10] OF WORD := [11, 16#FFFF, 33];
    power : INT; n : DINT;
END_VAR
n := n + 1;
read(Execute := get, Device := device, FunctionCode := readBy, Address := reference, Count := count, Data := words);
write(Execute := set, Device := device, FunctionCode := writeBy, Address := reference, Count := count, Data := values);
END_PROGRAM
"""
DESCRIPTION = """
[[modbus.rs485]]
port = "{line}"
baud = 38400
[[modbus.rs485.device]]
name = "Meter"
unit = 3
timeout = "T#5s"
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#50ms"
var = "Main.power"
[[modbus.rs485.device]]
name = "Absent"
unit = 4
timeout = "T#100ms"
[[modbus.tcp]]
host = "127.0.0.1"
port = {port}
[[modbus.tcp.device]]
name = "Drive"
unit = 1
"""

NO_REPLY = 0x104  # ErrorID
TRIES = 5


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Plc, Devices, Devices]]:
    folder = tmp_path_factory.mktemp("requests")
    port = free_port()
    with Wire() as wire:
        wire.absent = {4}
        (folder / "main.st").write_text(PROGRAM)
        (folder / "main.io.toml").write_text(DESCRIPTION.format(line=wire.plc, port=port))
        image = folder / "main.cdl"
        compile_sources([folder / "main.st"]).write(image)
        meter, drive = Devices([3], serial=wire.other, baud=38400), Devices([1], tcp=port)
        with meter, drive, Plcrt(folder / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
            plc.flash(image)
            yield plc, meter, drive


def ask(plc: Plc, block: str, **inputs: object) -> int:
    """Makes a request; its ErrorID. One that a busy machine has cut in two has no reply, and is made again."""
    start = {"read": "Main.get", "write": "Main.set"}[block]
    for _ in range(TRIES):
        plc.write({f"Main.{name}": value for name, value in inputs.items()} | {start: True})
        eventually(lambda: plc.read(f"Main.{block}.Done") or plc.read(f"Main.{block}.Error"))
        error = int(plc.read(f"Main.{block}.ErrorID"))
        plc.write({start: False})
        eventually(lambda: not (plc.read(f"Main.{block}.Done") or plc.read(f"Main.{block}.Error")))
        if error != NO_REPLY or inputs["device"] == "Absent":
            break
    return error


@pytest.mark.parametrize(("device", "unit"), [("Meter", 3), ("Drive", 1)])
def test_registers_go_there_and_come_back(plant: tuple[Plc, Devices, Devices], device: str, unit: int) -> None:
    plc, meter, drive = plant
    memory = (meter if unit == 3 else drive).memory
    assert ask(plc, "write", device=device, reference=40011, writeBy=16, count=3) == 0
    assert memory[unit][10:13] == [11, 0xFFFF, 33]
    assert ask(plc, "read", device=device, reference=40011, readBy=3, count=3) == 0
    assert [plc.read(f"Main.words[{i}]") for i in (1, 2, 3)] == [11, 0xFFFF, 33]


def test_coils_and_single_writes(plant: tuple[Plc, Devices, Devices]) -> None:
    plc, meter, _ = plant
    assert ask(plc, "write", device="Meter", reference=481, writeBy=15, count=18) == 0
    assert meter.memory[3][30:32] == [11, 3], "18 coils"
    assert ask(plc, "read", device="Meter", reference=481, readBy=1, count=18) == 0
    assert [plc.read(f"Main.words[{i}]") for i in (1, 2)] == [11, 3]
    assert ask(plc, "write", device="Meter", reference=40020, writeBy=6, count=1) == 0
    assert meter.memory[3][19] == 11
    assert ask(plc, "write", device="Meter", reference=321, writeBy=5, count=1) == 0
    assert meter.memory[3][20] & 1 == 1


def test_what_a_device_refuses_is_its_exception(plant: tuple[Plc, Devices, Devices]) -> None:
    plc, _, _ = plant
    assert ask(plc, "read", device="Meter", reference=49000, readBy=3, count=3) == 2


def test_a_device_that_is_not_there_is_an_error_and_holds_up_no_other(plant: tuple[Plc, Devices, Devices]) -> None:
    plc, meter, _ = plant
    assert ask(plc, "read", device="Absent", reference=40001, readBy=3, count=1) == NO_REPLY
    before = meter.count(3)
    eventually(lambda: meter.count(3) > before + 5)


def test_a_program_that_was_stopped_goes_on_asking(plant: tuple[Plc, Devices, Devices]) -> None:
    plc, _, _ = plant
    plc.write({"Main.device": "Absent", "Main.reference": 40001, "Main.count": 1, "Main.get": True})
    plc.stop()
    plc.write({"Main.device": "Meter", "Main.get": False})
    plc.start()
    eventually(lambda: not (plc.read("Main.read.Busy") or plc.read("Main.read.Error")))
    assert ask(plc, "read", device="Meter", reference=40011, readBy=3, count=1) == 0
