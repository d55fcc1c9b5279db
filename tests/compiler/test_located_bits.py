"""Writing a bit writes that bit and nothing else, wherever it is and whatever writes it."""

from __future__ import annotations

from bit_programs import BitProgram, bit_programs, block_programs
from hypothesis import given
from shares import examples

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import build_program
from plctool.image.targets import find_target
from plctool.sim import Simulator


def run(p: BitProgram) -> None:
    checked = check_sources([Source("bits.st", p.text)])
    assert checked.program is not None, checked.diagnostics
    built = build_program(checked.program, Options(find_target("x86_64-linux"), 0))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert plc.status().exception is None
        assert {name: plc.read(name) for name in p.expected} == p.expected


@examples(150)
@given(bit_programs())
def test_a_write_reaches_its_bit_only(p: BitProgram) -> None:
    run(p)


@examples(20)
@given(block_programs())
def test_bits_of_blocks_are_copied_alone(p: BitProgram) -> None:
    run(p)
