"""A long body is cut into functions wherever no JMP leads over the cut, and does the same as in one piece."""

from __future__ import annotations

from pathlib import Path

import pytest
from front_support import check, main

from plctool.compiler import compile_sources
from plctool.compiler.codegen.sections import sections
from plctool.sim import Simulator

VARIABLES = "n, k : DINT;"
FILLING = "n := (n * 31 + 7) MOD 65521;\n"


def parts_of(body: str) -> int:
    program = check(main(VARIABLES, body)).program
    assert program is not None
    return len(sections(next(pou for pou in program.pous if pou.name == "Main")))


@pytest.mark.parametrize(
    ("body", "parts"),
    [
        (FILLING * 2000, 5),
        ("back: " + FILLING * 2000 + "IF n < 0 THEN JMP back; END_IF", 1),
        ("IF n < 0 THEN JMP out; END_IF\n" + FILLING * 2000 + "out: n := 1;", 2),  # what follows the label
        (FILLING * 800 + "a: k := k + 1; IF k < 3 THEN JMP a; END_IF\n" + FILLING * 1200, 5),
        (FILLING * 800 + "IF k > 3 THEN l: k := k - 1; IF k > 1 THEN JMP l; END_IF END_IF\n" + FILLING * 1200, 5),
        (FILLING * 800 + "a: k := k + 1;\n" + FILLING * 500 + "IF k < 3 THEN JMP a; END_IF\n" + FILLING * 700, 4),
    ],
    ids=["none", "backward over all", "forward over all", "short loop", "within a statement", "long loop"],
)
def test_a_body_is_cut_where_no_jump_leads_over_the_cut(body: str, parts: int) -> None:
    assert parts_of(body) == parts


def test_the_parts_do_what_the_whole_did(tmp_path: Path) -> None:
    body = FILLING * 800 + "a: k := k + 1;\n" + FILLING * 500 + "IF k < 3 THEN JMP a; END_IF\n" + FILLING * 700
    (tmp_path / "main.st").write_text(main(VARIABLES, body))
    built = compile_sources([tmp_path / "main.st"], level=0)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        found = plc.read("Main.n"), plc.read("Main.k")
    n = 0
    for _ in range(800 + 3 * 500 + 700):
        n = (n * 31 + 7) % 65521
    assert found == (n, 3)
