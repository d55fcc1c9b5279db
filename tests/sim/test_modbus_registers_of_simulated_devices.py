"""What is in the registers of simulated Modbus devices: exchanges, masks, byte orders, and those of our own."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool import Simulator

SOURCE = """
PROGRAM Main
VAR
    out, in : INT;
    low : BYTE;
    around : WORD;
    r : ARRAY[0..3] OF REAL;
    d : ARRAY[0..3] OF LINT;
    setpoint : INT;
    alarm : BOOL;
    all, seen : INT;
END_VAR
END_PROGRAM
"""
ORDERS = ("ABCD", "CDAB", "BADC", "DCBA")
DESCRIPTION = """
[[modbus.rs485]]
port = "/dev/ttyS1"
[[modbus.rs485.device]]
name = "Drive"
unit = 1
[[modbus.rs485.device.read_write]]
every = "T#50ms"
read = { address = 40001, var = "Main.in" }
write = { address = 40002, var = "Main.out" }
[[modbus.rs485.device.write]]
function = 22
address = 40005
every = "T#50ms"
var = "Main.low"
[[modbus.rs485.device.read]]
function = 3
address = 40005
every = "T#50ms"
var = "Main.around"
[[modbus.rs485.device.read]]
function = 3
address = 40010
every = "T#50ms"
var = "Main.seen"
[[modbus.rs485.device]]
name = "All"
unit = 0
timeout = "T#20ms"
[[modbus.rs485.device.write]]
function = 6
address = 40010
every = "T#1s"
var = "Main.all"
[modbus.server.rs485]
port = "/dev/ttyS2"
[modbus.server.rs485.holding]
40001 = "Main.setpoint"
[modbus.server.rs485.discrete]
10001 = "Main.alarm"
""" + "".join(
    f"""
[[modbus.tcp]]
host = "192.168.0.{i + 1}"
[[modbus.tcp.device]]
name = "Order{i}"
order = "{order}"
[[modbus.tcp.device.read]]
function = 4
address = 30001
every = "T#20ms"
vars = ["Main.r[{i}]", "Main.d[{i}]"]
"""
    for i, order in enumerate(ORDERS)
)


@pytest.fixture(scope="module")
def plc(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulator]:
    folder = tmp_path_factory.mktemp("registers")
    (folder / "main.st").write_text(SOURCE)
    (folder / "main.io.toml").write_text(DESCRIPTION)
    with Simulator.from_sources(folder / "main.st") as made:
        made.run_for(500)
        yield made


@given(measured=st.integers(-32768, 32767), done=st.integers(-32768, 32767))
def test_an_exchange_reads_and_writes(plc: Simulator, measured: int, done: int) -> None:
    plc.set_input("Main.in", measured)
    plc.write({"Main.out": done})
    plc.run_for(200)
    assert (plc.read("Main.in"), plc.output("Main.out")) == (measured, done)


@given(around=st.integers(0, 0xFFFF), low=st.integers(0, 0xFF))
def test_half_a_register_leaves_the_other_half(plc: Simulator, around: int, low: int) -> None:
    plc.set_modbus("Drive", 40005, around)
    plc.write({"Main.low": low})
    plc.run_for(300)
    assert plc.read("Main.around") == (around & 0xFF00 | low)


@given(
    real=st.floats(width=32, allow_nan=False, allow_infinity=False),
    long=st.integers(-(2**63), 2**63 - 1),
    i=st.integers(0, 3),
)
def test_a_number_arrives_in_each_order_of_bytes(plc: Simulator, real: float, long: int, i: int) -> None:
    plc.set_input(f"Main.r[{i}]", real)
    plc.set_input(f"Main.d[{i}]", long)
    plc.run_for(100)
    assert struct.pack("<f", plc.read(f"Main.r[{i}]")) == struct.pack("<f", real), "a REAL is read with few digits"
    assert plc.read(f"Main.d[{i}]") == long


@pytest.mark.parametrize(
    ("i", "registers"), [(0, (0x3F9D, 0xF3B6)), (1, (0xF3B6, 0x3F9D)), (2, (0x9D3F, 0xB6F3)), (3, (0xB6F3, 0x9D3F))]
)
def test_orders_are_those_of_the_manual(plc: Simulator, i: int, registers: tuple[int, int]) -> None:
    """1.234 is 3F 9D F3 B6."""
    for offset, register in enumerate(registers):
        plc.set_modbus(f"Order{i}", 30001 + offset, register)
    plc.run_for(100)
    assert plc.read(f"Main.r[{i}]") == pytest.approx(1.234)


def test_what_is_written_to_all_devices_arrives_at_each(plc: Simulator) -> None:
    plc.write({"Main.all": 4711})
    plc.run_for(2000)
    assert plc.read("Main.seen") == 4711


def test_a_test_is_the_client_of_a_server(plc: Simulator) -> None:
    plc.set_input("Main.setpoint", 77)
    plc.write({"Main.alarm": True})
    plc.run_for(20)
    assert (plc.read("Main.setpoint"), plc.output("Main.alarm")) == (77, True)
