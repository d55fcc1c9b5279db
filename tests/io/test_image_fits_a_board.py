"""What a program needs of its board besides memory: functions, drivers and their room; refused at build and as a
production image, before a device refuses it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool.cli.commands.images import production
from plctool.compiler import compile_sources
from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.image.limits import Need
from plctool.io.configuration import Configuration, ConnectorEntry, ParameterEntry
from plctool.io.room import needs_of_io

REALS = "PROGRAM Main VAR r : REAL; l : LREAL; n : LINT; END_VAR\n{}\nEND_PROGRAM\n"
BITS = "PROGRAM Main\nVAR a, b : BOOL; END_VAR\nb := a;\nEND_PROGRAM\n"
PULSE = (
    "PROGRAM Count VAR a : BOOL; END_VAR END_PROGRAM CONFIGURATION C RESOURCE R ON D\n"
    "{}END_RESOURCE END_CONFIGURATION\n"
)


def device(number: int, jobs: int = 1, count: int = 1) -> str:
    """A Modbus device that is read by some jobs, each of some registers."""
    reads = "".join(
        f"[[modbus.rs485.device.read]]\nfunction = 4\naddress = {30001 + i * count}\nevery = 'T#1s'\n"
        f"vars = {[f'%IW{(number + i) % 20 * count + n}' for n in range(count)]}\n"
        for i in range(jobs)
    )
    return f"[[modbus.rs485.device]]\nunit = {number}\nname = 'D{number}'\n{reads}"


def line(*devices: str, options: str = "") -> str:
    return f"[[modbus.rs485]]\nport = 'COM2'\n{options}{''.join(devices)}"


@pytest.fixture
def refused(tmp_path: Path) -> Any:
    """What is said of a program by the build for a board, and by the making of a production image."""

    def build(board: str, text: str, description: str = "") -> str:
        source, image, flash = tmp_path / "main.st", tmp_path / "main.cdl", tmp_path / "flash.hex"
        source.write_text(text)
        if description:
            (tmp_path / "main.io.toml").write_text(description)
        compile_sources([source], board=board, limits=False).write(image)
        try:
            compile_sources([source], board=board)
        except UsageError as error:
            with pytest.raises(UsageError, match="does not fit"):
                production(image, board, None, flash)
            assert not flash.exists()
            return str(error)
        production(image, board, None, flash)
        flash.unlink()
        return ""

    return build


def test_function_that_the_firmware_does_not_have(refused: Any) -> None:
    assert refused("mps2-an385/standard", REALS.format("r := SQRT(r);")) == ""
    assert refused("mps2-an385/standard", REALS.format("r := EXPT(r, 2.5) + ATAN(r);")) == (
        "The program does not fit MPS2 AN385 (standard). It needs CmpMath for powf and atanf, which the firmware does "
        "not have; mps2-an385/full has it."
    )
    assert refused("mps2-an385/full", REALS.format("r := SIN(r);")) == ""


@pytest.mark.parametrize(
    ("board", "statement", "said"),
    [
        ("mps2-an385/minimal", "r := r * 1.5;", "CmpRealCalls for REAL"),
        ("mps2-an386/minimal", "r := r * 1.5;", ""),  # the processor can
        ("mps2-an385/minimal", "n := n / 7;", "CmpIntCalls for LINT and division"),
        ("mps2-an386/standard", "l := l * 1.5;", "CmpLrealCalls for LREAL"),
        ("mps2-an386/full", "l := l * 1.5;", ""),
    ],
)
def test_arithmetic_that_the_firmware_does_not_have(refused: Any, board: str, statement: str, said: str) -> None:
    message = refused(board, REALS.format(statement))
    assert said in message and bool(said) == bool(message)


@pytest.mark.parametrize(
    ("board", "description", "said"),
    [
        ("mps2-an385/standard", "[gpio.in]\nDI0 = 'Main.a'\n", "It needs CmpIoMgrEmbedded for inputs and outputs,"),
        ("mps2-an385/standard", "[gpio.in]\nDI0 = 'Main.a'\n", "It needs IoDrvGpio for "),
        ("mps2-an385/io", "[gpio.in]\nDI0 = 'Main.a'\n", ""),
        ("mps2-an385/modbus", line(device(1)), ""),
        ("mps2-an385/io", line(device(1)), "It needs IoDrvModbus for "),
        (
            "mps2-an385/full",
            "[[sim]]\nname = 'Bench'\nin = { a = 'Main.a' }\n",
            "It needs IoDrvSim for Bench, which the firm",
        ),
        ("mps2-an385/full", "[[sim]]\noptional = true\nin = { a = 'Main.a' }\n", ""),
        ("plcrt", "[[sim]]\nin = { a = 'Main.a' }\n", ""),
    ],
)
def test_driver_that_the_firmware_does_not_have(refused: Any, board: str, description: str, said: str) -> None:
    message = refused(board, BITS, description)
    assert said in message and bool(said) == bool(message)


@pytest.mark.parametrize(
    ("description", "said"),
    [
        (line(*map(device, range(1, 9))), ""),
        (line(*map(device, range(1, 10))), "It needs 9 Modbus devices, the device has 8."),
        (line(device(1, jobs=16)), ""),
        (line(device(1, jobs=17)), "It needs 17 reads and writes of Modbus, the device has 16."),
        (line(device(1)) + line(device(2)).replace("COM2", "COM3"),
         "It needs 2 lines to Modbus devices, the device has 1."),
        (line(device(1)).replace("rs485]]\nport = 'COM2'", "tcp]]\nhost = '10.0.0.1'").replace("rs485", "tcp"),
         "It needs 1 lines and servers of Modbus TCP, the device has 0."),
        (line(*map(device, range(1, 10)), options="optional = true\n"), ""),
    ],
)  # fmt: skip
def test_room_that_the_driver_does_not_have(refused: Any, description: str, said: str) -> None:
    message = refused("mps2-an385/modbus", BITS, description)
    assert said in message and bool(said) == bool(message)


def test_function_of_the_same_name_is_another_one(refused: Any) -> None:
    """A vendor's own `log` needs no CmpMath, and what it takes of the stack is not known."""
    text = (
        "{attribute 'external' := 'log'}\nFUNCTION WriteLog : DINT VAR_INPUT a, b : DINT; END_VAR END_FUNCTION\n"
        "PROGRAM Main VAR n : DINT; END_VAR n := WriteLog(n, 1); END_PROGRAM\n"
    )
    assert refused("mps2-an385/standard", text) == ""


def test_what_a_driver_has_no_room_for_is_not_said_where_it_is_missing(refused: Any) -> None:
    message = refused("mps2-an385/standard", BITS, line(*map(device, range(1, 12))))
    assert (
        "It needs IoDrvModbus for " in message
        and " and 9 more, which" in message
        and "Modbus devices, the device has" not in message
    )
    assert "devices and buses" not in message and "smaller" not in message


def test_data_of_modbus_is_what_is_read_and_twice_what_is_written() -> None:
    jobs = [
        {"function": lib.MODBUS_READ_INPUT_REGISTERS, "read_count": 100},
        {"function": lib.MODBUS_READ_WRITE_REGISTERS, "read_count": 3, "write_count": 10},
        {"function": lib.MODBUS_WRITE_COILS, "write_count": 9},
    ]
    made = [ffi.new("MODBUS_JOB *", job) for job in jobs] + [ffi.new("MODBUS_RANGE *", {"bits": 17})]
    numbers = [lib.MODBUS_PARAM_JOB + i for i in range(3)] + [lib.MODBUS_PARAM_RANGE]
    *of_jobs, of_range = (
        ParameterEntry(number, 0, 8 * len(ffi.buffer(value)), bytes(ffi.buffer(value)), True)
        for number, value in zip(numbers, made, strict=True)
    )
    server, client = (
        ParameterEntry(lib.MODBUS_PARAM_ROLE, 0, 32, bytes([role, 0, 0, 0]))
        for role in (lib.MODBUS_ROLE_SERIAL_SERVER, lib.MODBUS_ROLE_SERIAL_CLIENT)
    )
    connectors = (
        ConnectorEntry("Server", "IoDrvModbus", lib.CT_MASTER, lib.CF_ENABLE, parameters=(server, of_range)),
        ConnectorEntry("Line", "IoDrvModbus", lib.CT_MASTER, lib.CF_ENABLE, parameters=(client,)),
        ConnectorEntry("Device", "IoDrvModbus", lib.CT_SLAVE, lib.CF_ENABLE, parent=1, parameters=tuple(of_jobs)),
    )
    needs = {name: need.amount for name, need in needs_of_io(Configuration(connectors, ())).items()}
    assert needs["modbus_data"] == 3 + 200 + (6 + 2 * 20) + 2 * 2
    assert (needs["modbus_jobs"], needs["modbus_ranges"], needs["modbus_servers"]) == (3, 1, 1)
    assert needs["modbus_lines"] == 1 and "modbus_tcp" not in needs


@pytest.mark.parametrize(
    ("kinds", "needed"),
    [("rrr", 3), ("rro", 2), ("orr", 3), ("oorooo", 3), ("ooo", 0), ("ror", 3), ("offr", 2)],
)
def test_optional_devices_count_if_a_required_one_comes_after_them(kinds: str, needed: int) -> None:
    """r: required, o: optional, f: switched off."""
    flags = {"r": lib.CF_ENABLE, "o": lib.CF_ENABLE | lib.CF_OPTIONAL, "f": 0}
    line_of_all = ConnectorEntry("Line", "IoDrvModbus", lib.CT_MASTER, lib.CF_ENABLE)
    devices = [ConnectorEntry("D", "IoDrvModbus", lib.CT_SLAVE, flags[kind], parent=0) for kind in kinds]
    needs = needs_of_io(Configuration((line_of_all, *devices), ()))
    assert needs.get("modbus_devices", Need(0)).amount == needed


def test_devices_of_an_optional_line_are_optional() -> None:
    optional = ConnectorEntry("Line", "IoDrvModbus", lib.CT_MASTER, lib.CF_ENABLE | lib.CF_OPTIONAL)
    device_of_it = ConnectorEntry("D", "IoDrvModbus", lib.CT_SLAVE, lib.CF_ENABLE, parent=0)
    assert needs_of_io(Configuration((optional, device_of_it), ())).keys() == {"connectors"}


def test_optional_devices_of_a_program_take_the_room_of_those_after_them(refused: Any) -> None:
    optional = line(*map(device, range(1, 6)), options="optional = true\n")
    needed = line(*map(device, range(6, 11))).replace("COM2", "COM3")
    assert "It needs 10 Modbus devices, the device has 8." in refused("mps2-an385/modbus", BITS, optional + needed)


def test_more_devices_and_lines_than_the_firmware_has_room_for(refused: Any) -> None:
    lines = "".join(f"L{i} = '%IX{i // 8}.{i % 8}'\n" for i in range(33))
    assert "It needs 2 groups of lines, the device has 1." in refused("mps2-an385/io", BITS, f"[gpio.in]\n{lines}")
    benches = "".join(f"[[sim]]\nname = 'B{i}'\noptional = true\nin = {{ a = '%IX{i}.0' }}\n" for i in range(5))
    assert "It needs 5 devices and buses, the device has 4." in refused("mps2-an385/io", BITS, benches)


def test_more_events_than_the_firmware_has(refused: Any) -> None:
    tasks = "".join(f"TASK T{i}(EVENT := 'e{i}'); PROGRAM P{i} WITH T{i} : Count;\n" for i in range(3))
    events = "[gpio.in]\n" + "".join(f"DI{i} = {{ var = '%IX0.{i}', event = 'e{i}' }}\n" for i in range(3))
    assert "It needs 3 events of lines, the device has 2." in refused("mps2-an385/io", PULSE.format(tasks), events)


def test_all_that_is_lacking_is_said_at_once(refused: Any) -> None:
    message = refused(
        "mps2-an385/minimal", REALS.format("r := SIN(r) * 1.5; l := l * 2.5;"), "[gpio.in]\nDI0 = '%IX0.0'\n"
    )
    for component in ("CmpMath", "CmpRealCalls", "CmpLrealCalls", "CmpIoMgrEmbedded", "IoDrvGpio"):
        assert f"It needs {component} for " in message
