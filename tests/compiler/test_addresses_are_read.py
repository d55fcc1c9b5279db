"""What is at an address such as %MW1 is read and written without a name."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.errors import UsageError
from plctool.sim import Simulator

PROGRAM = """
PROGRAM Main
VAR seen : WORD; bit : BOOL; END_VAR
%MW1 := 16#1234;
%QX0.3 := TRUE;
seen := %IW0;
bit := %MX8.1;
END_PROGRAM
"""


@pytest.fixture
def plc(tmp_path: Path) -> Simulator:
    source = tmp_path / "main.st"
    source.write_text(PROGRAM)
    result = compile_sources([source])
    return Simulator(result.image, result.symbols)


def test_addresses_are_read_as_the_program_names_them_or_otherwise(plc: Simulator) -> None:
    with plc:
        plc.run_cycles(1)
        assert plc.read("%MW1") == 0x1234
        assert plc.read("%mb3") == 0x12
        assert plc.read("%MX2.2") is True
        assert plc.read("%QX0.3") is True


def test_addresses_are_written(plc: Simulator) -> None:
    with plc:
        plc.write({"%IW0": 77})
        plc.write({"%MX8.1": True})
        plc.run_cycles(2)
        assert plc.read("Main.seen") == 77
        assert plc.read("Main.bit") is True


@pytest.mark.parametrize("address", ["%MX0.9", "%ZW1", "%M"])
def test_what_is_no_address_is_no_variable(plc: Simulator, address: str) -> None:
    with plc, pytest.raises(UsageError):
        plc.read(address)
