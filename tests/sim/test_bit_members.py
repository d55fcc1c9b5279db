"""BIT members of a structure share bytes: by name each of them is a BOOL."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator

SOURCE = """
TYPE Bits : STRUCT run : BIT; fault : BIT; warn : BIT; END_STRUCT END_TYPE
TYPE Status : UNION bits : Bits; number : BYTE; END_UNION END_TYPE
PROGRAM Main
VAR s : Status; copy : Bits; n : INT; END_VAR
VAR PERSISTENT kept : Bits; END_VAR
copy := s.bits;
n := n + 1;
END_PROGRAM
"""


def built(tmp_path, text: str) -> BuildResult:
    path = tmp_path / "bits.st"
    path.write_text(text)
    return compile_sources([path])


@pytest.fixture
def plc(tmp_path) -> Iterator[Simulator]:
    program = built(tmp_path, SOURCE)
    with Simulator(program.image, program.symbols) as simulator:
        yield simulator


def test_a_bit_is_written_without_its_neighbours(plc) -> None:
    plc.write({"Main.s.number": 0b101})
    plc.write({"Main.s.bits.fault": True})
    assert plc.read_all(["Main.s.number", "Main.s.bits.fault"]) == {"Main.s.number": 0b111, "Main.s.bits.fault": True}
    plc.write({"Main.s.bits.run": False})
    assert plc.read_all(["Main.s.number"]) == {"Main.s.number": 0b110}


def test_a_structure_is_read_and_written_as_a_whole(plc) -> None:
    plc.write({"Main.s.bits": {"run": True, "fault": False, "warn": True}})
    plc.run_cycles(1)
    assert plc.read_all(["Main.copy"]) == {"Main.copy": {"run": True, "fault": False, "warn": True}}
    assert plc.read_all(["Main.s.number"]) == {"Main.s.number": 0b101}


def test_a_bit_is_forced_alone(plc) -> None:
    plc.force({"Main.s.bits.warn": True})
    plc.write({"Main.s.number": 0b001})
    plc.run_cycles(2)
    assert plc.read_all(["Main.copy"]) == {"Main.copy": {"run": True, "fault": False, "warn": True}}


@pytest.mark.parametrize(("members", "kept"), [("run : BIT; fault : BIT; warn : BIT;", True),
                                               ("new : BIT; run : BIT; fault : BIT; warn : BIT;", False),
                                               ("warn : BIT; fault : BIT; run : BIT;", False)])  # fmt: skip
def test_kept_bits_are_never_taken_for_others(plc, tmp_path, members: str, kept: bool) -> None:
    plc.write({"Main.kept": {"run": True, "fault": True, "warn": False}})
    plc.run_for(2500)
    changed = SOURCE.replace("run : BIT; fault : BIT; warn : BIT;", members).replace("n + 1", "n + 2")
    program = built(tmp_path, changed)
    plc.flash(program.image)
    plc.add_symbols(program.symbols)
    value = plc.read_all(["Main.kept"])["Main.kept"]
    assert [value["run"], value["fault"], value["warn"]] == [kept, kept, False]
