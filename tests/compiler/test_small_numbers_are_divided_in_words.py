"""What LLVM knows to be small is divided by constants as it is in the program, where smaller numbers are no easier."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from test_back_emulated import SYSTEMS, emulated
from test_back_structure import checked, parts

from plctool.compiler.codegen.emit import optimised
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.image.build import build_program
from plctool.iec.areas import Area
from plctool.image.file import parse_image
from plctool.image.targets import find_target
from plctool.sim import Simulator

DIVISORS = (*range(3, 24), 25, 100, 127, 128, 200, 255, 641, 1000, 32767, 40000, 65535)
NARROW = re.compile(r"(udiv|urem) (exact )?i(8|16)\b")


def program() -> str:
    """Sums that are less than 512 and less than 65536, divided by each number."""
    count = len(DIVISORS)
    lines = [
        f"a[{i}] := (x + small) / {d}; b[{i}] := (x + small) MOD {d}; c[{i}] := (x * 16 + y) / {d}; "
        f"d[{i}] := (x * 16 + y) MOD {d};"
        for i, d in enumerate(DIVISORS)
    ]
    arrays = f"a, b, c, d : ARRAY[0..{count - 1}] OF DINT;"
    head = f"PROGRAM Main VAR noise : DWORD := 12345; {arrays} x, y, small : DINT; END_VAR"
    steps = (
        "noise := noise XOR SHL(noise, 13); noise := noise XOR SHR(noise, 17); noise := noise XOR SHL(noise, 5);"
        "x := DWORD_TO_DINT(noise AND 16#FFF); y := DWORD_TO_DINT(SHR(noise, 12) AND 16#F);"
        "small := DWORD_TO_DINT(SHR(noise, 20) AND 16#3F);"
    )
    return f"{head}\n{steps}\n" + "\n".join(lines) + "\nEND_PROGRAM"


@pytest.mark.parametrize(("target", "narrow"), [("x86_64-linux", True), ("cortex-m3", False), ("rv32imac", False)])
def test_words_are_divided_where_that_is_no_more_work(target: str, narrow: bool) -> None:
    (part,) = parts(program(), target)
    module, _ = optimised(part, Options(find_target(target)))
    assert bool(NARROW.search(str(module))) == narrow


@pytest.mark.parametrize("target", SYSTEMS)
def test_the_results_are_the_same(target: str, tmp_path: Path) -> None:
    typed = checked(program())
    here = build_program(typed, Options(find_target("x86_64-linux")))
    built = build_program(typed, Options(find_target(target)))
    found = emulated([built], target, tmp_path)[0]
    size = parse_image(here.image).areas[Area.DATA.value]
    with Simulator(here.image, here.symbols) as plc:
        for code, memory in found:
            plc.run_cycles(1)
            assert code == 0 and memory == bytes(plc.memory(Area.DATA, 0, size))
    assert found
