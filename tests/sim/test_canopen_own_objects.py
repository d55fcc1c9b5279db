"""Blocks of CiA 405 read and write the objects of this controller, which is a device, without a frame (C405-22)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from plctool.compiler import compile_sources
from plctool.sim import Simulator

NODE = 9
SOURCE = """
PROGRAM Main
VAR
    count : UDINT := 16#11223344; setpoint : UINT := 700; limited : INT(-5..5); text : STRING(20) := 'none';
    r4 : CIA405.SDO_READ4; w4 : CIA405.SDO_WRITE4; id : CIA405.GET_LOCAL_NODE_ID; state : CIA405.GET_STATE;
    bytes : ARRAY[1..4] OF BYTE;
END_VAR
r4(DATA => bytes);
w4(DATALENGTH := 2);
id();
state(DEVICE := 0);
END_PROGRAM
"""
DESCRIPTION = """
[[canopen]]
name = "Bus"
[[canopen_device]]
name = "Field"
node = 9
download = true
read = { "2100" = "Main.count", "2101" = "Main.text" }
write = { "2200" = "Main.setpoint", "2201" = "Main.limited" }
"""


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    (tmp_path / "app.st").write_text(SOURCE)
    (tmp_path / "app.io.toml").write_text(DESCRIPTION)
    built = compile_sources([tmp_path / "app.st"])
    with Simulator(built.image, built.symbols) as plc:
        plc.run_for(50)
        plc.can_receive()
        yield plc


def do(plc: Simulator, block: str, **inputs: Any) -> tuple[bool, int, int]:
    """CONFIRM, ERROR and ERRORINFO of a job."""
    plc.write({f"Main.{block}.ENABLE": False})
    plc.run_cycles(1)
    plc.write({**{f"Main.{block}.{name}": value for name, value in inputs.items()}, f"Main.{block}.ENABLE": True})
    plc.run_cycles(4)
    return (plc.read(f"Main.{block}.CONFIRM"), plc.read(f"Main.{block}.ERROR"), plc.read(f"Main.{block}.ERRORINFO"))


@pytest.mark.parametrize("device", [0, NODE])
def test_own_objects_are_read_and_written_without_a_frame(plc: Simulator, device: int) -> None:
    assert do(plc, "r4", DEVICE=device, INDEX=0x2100, SUBINDEX=0) == (True, 0, 0)
    assert plc.read("Main.bytes") == [0x44, 0x33, 0x22, 0x11]
    plc.write({"Main.w4.DATA[1]": 0xD2, "Main.w4.DATA[2]": 4})
    assert do(plc, "w4", DEVICE=device, INDEX=0x2200, SUBINDEX=0) == (True, 0, 0)
    plc.run_for(50)
    assert plc.read("Main.setpoint") == 700, "as by SDO of others: not in operation it has its own value"
    plc.can_send(0, bytes([1, NODE]))
    plc.run_for(50)
    assert do(plc, "w4", DEVICE=device, INDEX=0x2200, SUBINDEX=0) == (True, 0, 0)
    plc.run_for(50)
    assert plc.read("Main.setpoint") == 1234
    assert not [frame for frame in plc.can_receive() if frame.id >= 0x580]


def test_own_objects_are_refused_as_by_sdo(plc: Simulator) -> None:
    assert do(plc, "r4", DEVICE=0, INDEX=0x7777, SUBINDEX=0) == (False, 1, 0x06020000)
    assert do(plc, "r4", DEVICE=0, INDEX=0x2100, SUBINDEX=1) == (False, 1, 0x06090011)
    assert do(plc, "w4", DEVICE=0, INDEX=0x2100, SUBINDEX=0) == (False, 1, 0x06010002)
    plc.write({"Main.w4.DATA[1]": 6})
    assert do(plc, "w4", DEVICE=0, INDEX=0x2201, SUBINDEX=0) == (False, 1, 0x06090031)
    assert do(plc, "w4", DEVICE=0, INDEX=0x1F51, SUBINDEX=1)[1] == 1, "no program stops itself by this"
    assert do(plc, "r4", DEVICE=0, INDEX=0x1008, SUBINDEX=0)[1] == 2, "it is longer than four bytes"


def test_number_and_state_are_those_of_the_device(plc: Simulator) -> None:
    plc.write({"Main.id.ENABLE": True})
    names = {4: "STOPPED", 5: "OPERATIONAL", 0x7F: "PRE_OPERATIONAL"}
    for command, state in ((1, 5), (2, 4), (0x80, 0x7F)):
        plc.can_send(0, bytes([command, NODE]))
        plc.write({"Main.state.ENABLE": False})
        plc.run_cycles(2)
        plc.write({"Main.state.ENABLE": True})
        plc.run_cycles(2)
        assert plc.read("Main.state.STATE") == names[state]
    assert (plc.read("Main.id.CONFIRM"), plc.read("Main.id.DEVICE")) == (True, NODE)
