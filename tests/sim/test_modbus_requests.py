"""Requests of a program to simulated Modbus devices: MODBUS_READ and MODBUS_WRITE of the library."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool import Simulator, UsageError
from plctool.errors import DeviceError
from plctool.io.modbus.registers import COILS, DISCRETE, HOLDING, INPUT, wire_address

SOURCE = """
PROGRAM Main
VAR
    write : MODBUS_WRITE;
    read : MODBUS_READ;
    spare : ARRAY[1..20] OF MODBUS_READ;
    go, get, many : BOOL;
    device : STRING := 'Meter';
    writeCode : USINT := 16;
    code : USINT := 3;
    reference : UDINT := 40001;
    count : UINT := 3;
    out : ARRAY[0..3] OF WORD := [16#1234, 2, 16#FFFF, 4];
    in : ARRAY[1..130] OF WORD;
    one : ARRAY[0..0] OF WORD;
    done, failed, i : INT;
END_VAR
write(Execute := go, Device := device, FunctionCode := writeCode, Address := reference, Count := count, Data := out);
read(Execute := get, Device := device, FunctionCode := code, Address := reference, Count := count, Data := in);
IF many THEN
    FOR i := 1 TO 20 DO
        spare[i](Execute := TRUE, Device := 'Meter', Address := 40001, Data := one);
    END_FOR
END_IF
done := done + BOOL_TO_INT(read.Done);
failed := failed + BOOL_TO_INT(read.Error);
END_PROGRAM
"""
DESCRIPTION = """
[[modbus.rs485]]
port = "/dev/ttyS1"
[[modbus.rs485.device]]
name = "Meter"
unit = 3
[[modbus.tcp]]
host = "192.168.0.7"
[[modbus.tcp.device]]
name = "Drive"
"""


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    (tmp_path / "main.st").write_text(SOURCE)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION)
    with Simulator.from_sources(tmp_path / "main.st") as made:
        yield made


def ask(plc: Simulator, block: str, **inputs: Any) -> tuple[bool, int]:
    """Runs a request: whether it is done, and its ErrorID."""
    plc.write({f"Main.{name}": value for name, value in inputs.items()})
    start = {"read": "get", "write": "go"}[block]
    plc.write({f"Main.{start}": True})
    plc.run_for(100)
    outcome = plc.read(f"Main.{block}.Done"), plc.read(f"Main.{block}.ErrorID")
    assert plc.read(f"Main.{block}.Error") is (outcome[1] != 0)
    plc.write({f"Main.{start}": False})
    plc.run_for(20)
    return outcome


def test_what_was_written_is_read(plc: Simulator) -> None:
    assert ask(plc, "write") == (True, 0)
    assert ask(plc, "read") == (True, 0)
    assert [plc.read(f"Main.in[{i}]") for i in (1, 2, 3, 4)] == [0x1234, 2, 0xFFFF, 0]


def test_a_request_takes_its_time_and_the_block_is_busy(plc: Simulator) -> None:
    plc.set_modbus("Meter", 40001, 77)
    plc.write({"Main.count": 1})
    plc.write({"Main.get": True})
    plc.run_for(10)
    assert plc.read("Main.read.Busy") is True
    assert plc.read("Main.in[1]") == 0
    plc.run_for(90)
    assert (plc.read("Main.read.Busy"), plc.read("Main.in[1]")) == (False, 77)


@pytest.mark.parametrize(("code", "reference"), [(1, 7), (2, 10007), (3, 40007), (3, 400007), (4, 30007)])
def test_each_table_is_another(plc: Simulator, code: int, reference: int) -> None:
    for number, first in enumerate((7, 10007, 30007, 40007)):
        plc.set_modbus("Meter", first, number % 2 if first < 30000 else number)
    expected = {1: 0, 2: 1, 4: 2, 3: 3}[code]
    assert ask(plc, "read", code=code, reference=reference, count=1) == (True, 0)
    assert plc.read("Main.in[1]") == expected


def test_coils_are_16_in_a_word(plc: Simulator) -> None:
    assert ask(plc, "write", writeCode=15, reference=1, count=18) == (True, 0)
    assert ask(plc, "read", code=1, reference=1, count=18) == (True, 0)
    assert [plc.read(f"Main.in[{i}]") for i in (1, 2)] == [0x1234, 2]


@pytest.mark.parametrize(("code", "reference", "value"), [(5, 3, 0), (6, 40003, 0x1234)])
def test_one_is_written_alone(plc: Simulator, code: int, reference: int, value: int) -> None:
    assert ask(plc, "write", writeCode=code, reference=reference, count=1) == (True, 0)
    read_by = {5: 1, 6: 3}[code]
    assert ask(plc, "read", code=read_by, reference=reference, count=1) == (True, 0)
    assert plc.read("Main.in[1]") == value


def test_an_exception_of_the_device_is_the_error(plc: Simulator) -> None:
    assert ask(plc, "read") == (False, 2)


@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"device": "Mter"}, 0x101),
        ({"device": ""}, 0x101),
        ({"reference": 1}, 0x102),
        ({"reference": 30001}, 0x102),
        ({"count": 0}, 0x102),
        ({"count": 126}, 0x102),
        ({"count": 131}, 0x102),
        ({"code": 16}, 0x102),
        ({"code": 7}, 0x102),
        ({"code": 43}, 0x102),
        ({"reference": 465536, "count": 2}, 0x102),
    ],
)
def test_what_cannot_be_asked_is_an_error_at_once(plc: Simulator, inputs: dict[str, Any], error: int) -> None:
    plc.write({f"Main.{name}": value for name, value in inputs.items()} | {"Main.get": True})
    plc.run_cycles(1)
    assert (plc.read("Main.read.Error"), plc.read("Main.read.Busy"), plc.read("Main.read.ErrorID")) == (
        True,
        False,
        error,
    )


def test_an_absent_device_does_not_reply(plc: Simulator) -> None:
    plc.set_modbus("Meter", 40001, 1)
    plc.fault("Meter", "absent")
    plc.write({"Main.count": 1})
    plc.write({"Main.get": True})
    plc.run_for(900)
    assert plc.read("Main.read.Busy") is True, "the time-out is a second"
    plc.run_for(200)
    assert plc.read("Main.read.ErrorID") == 0x104
    plc.write({"Main.get": False})
    plc.fault("Meter", "absent", 0)
    plc.run_for(1000)  # its reply might be late
    assert ask(plc, "read", count=1) == (True, 0)


def test_more_requests_than_there_is_room_for_are_an_error(plc: Simulator) -> None:
    plc.set_modbus("Meter", 40001, 5)
    plc.write({"Main.many": True})
    plc.run_cycles(1)
    errors = [plc.read(f"Main.spare[{i}].ErrorID") for i in range(1, 21)]
    assert errors == [0] * 16 + [0x103] * 4
    plc.run_for(500)  # one after the other
    assert [plc.read(f"Main.spare[{i}].Done") for i in range(1, 21)] == [True] * 16 + [False] * 4
    assert ask(plc, "read", count=1) == (True, 0), "they gave back their room"


def test_a_stop_cancels_what_is_on_its_way(plc: Simulator) -> None:
    plc.set_modbus("Meter", 40001, 5)
    plc.write({"Main.count": 1})
    plc.write({"Main.get": True})
    plc.run_cycles(1)
    plc.stop()
    plc.run_for(1000)
    plc.start()
    plc.run_for(20)
    assert (plc.read("Main.read.Error"), plc.read("Main.read.ErrorID")) == (True, 0x105)
    plc.write({"Main.get": False})
    plc.run_for(20)
    assert ask(plc, "read", count=1) == (True, 0)


def test_execute_may_fall_before_the_end(plc: Simulator) -> None:
    plc.set_modbus("Meter", 40001, 5)
    plc.write({"Main.count": 1})
    plc.write({"Main.get": True})
    plc.run_cycles(1)
    plc.write({"Main.get": False})
    plc.run_for(200)
    assert (plc.read("Main.done"), plc.read("Main.failed"), plc.read("Main.in[1]")) == (1, 0, 5)


def test_devices_that_are_not_there_are_named(plc: Simulator) -> None:
    plc.set_modbus("Drive", 40001, 1)
    with pytest.raises(DeviceError, match="Meetr"):
        plc.set_modbus("Meetr", 40001, 1)
    with pytest.raises(UsageError, match="40001 is the first"):
        plc.set_modbus("Meter", 0, 1)
    with pytest.raises(UsageError, match="0 to 65535"):
        plc.set_modbus("Meter", 40001, -1)


@pytest.fixture(scope="module")
def addresses(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulator]:
    source = tmp_path_factory.mktemp("addresses") / "main.st"
    source.write_text(
        "PROGRAM Main VAR c : USINT; r : UDINT; a : DINT; END_VAR a := MODBUS_ADDRESS__(c, r); END_PROGRAM"
    )
    with Simulator.from_sources(source) as made:
        yield made


@given(
    st.sampled_from([(1, COILS), (2, DISCRETE), (3, HOLDING), (4, INPUT), (15, COILS), (16, HOLDING)]),
    st.one_of(st.integers(0, 500_000), st.sampled_from([0, 1, 9999, 10000, 65536, 65537, 40001, 49999, 50000, 465536])),
)
def test_addresses_are_those_of_the_description(
    addresses: Simulator, function: tuple[int, int], reference: int
) -> None:
    code, table = function
    expected = wire_address(reference, table)
    addresses.write({"Main.c": code, "Main.r": reference})
    addresses.run_cycles(1)
    assert addresses.read("Main.a") == (-1 if expected is None else expected)


def test_a_block_that_is_not_called_any_more_gives_its_place_back_after_a_minute(plc: Simulator) -> None:
    plc.write({"Main.many": True})
    plc.run_cycles(1)
    plc.write({"Main.many": False})
    plc.run_for(100)
    assert ask(plc, "read") == (False, 0x103)
    plc.run_for(seconds=62)
    assert ask(plc, "read") == (False, 2)
    plc.write({"Main.many": True})
    plc.run_cycles(1)
    assert [plc.read(f"Main.spare[{i}].ErrorID") for i in (1, 16, 17)] == [0x105, 0x105, 0x103]


@pytest.mark.parametrize("option", ["warm", "cold"])
def test_a_reset_ends_all_requests(plc: Simulator, option: str) -> None:
    plc.set_modbus("Meter", 40001, 5)
    plc.write({"Main.many": True})
    plc.run_cycles(1)
    plc.reset(option)
    plc.start()
    assert plc.read("Main.many") is False
    assert ask(plc, "read", count=1) == (True, 0), "there is room, though none was given back"
