"""A program whose calls fill the stack that its board has for them runs, whenever it is interrupted. Calls of C
functions are counted with a reserve, which is left over, or with what they take in the firmware that is there."""

from __future__ import annotations

from pathlib import Path

import pytest
from environment import CONFIG, TARGET, firmware

from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.image.board import known_boards
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

RUNS = 50  # of the task, most of whose time is at its deepest
SAMPLE = 400
# With this argument SIN takes all it may.
OF_C = {"standard": "r * 1.01 + DINT_TO_REAL(n)", "full": "SIN(1.0E30 + r)"}[CONFIG]
PROGRAM = """
PROGRAM Deep
VAR n : DINT; r : REAL; END_VAR
VAR_TEMP t : ARRAY[0..{last}] OF BYTE; i : DINT; END_VAR
FOR i := 0 TO 50 DO
    MEMSET(ADR(t), DINT_TO_BYTE(n + i), SIZEOF(t));
    r := {calculation};
    IF t[n MOD 100] <> DINT_TO_BYTE(n + i) THEN n := 100000; END_IF
END_FOR
n := n + 1;
END_PROGRAM
PROGRAM Above
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
TASK Slow(INTERVAL := T#20ms, PRIORITY := 2);
PROGRAM Top WITH Fast : Above;
PROGRAM Low WITH Slow : Deep;
END_RESOURCE END_CONFIGURATION
"""


@pytest.mark.parametrize(
    ("calculation", "measured"),
    [("1.0", False), (OF_C, False), (OF_C, True)],
    ids=["all of it", "with C functions", "with those of the firmware"],
)
def test_program_that_fills_the_stack_runs(board, tmp_path: Path, calculation: str, measured: bool) -> None:
    known = next(b for b in known_boards() if (b.target, b.config) == (TARGET, CONFIG))
    limit = known.limits["stack"]
    options = {"firmware": firmware(CONFIG)} if measured else {"board": known.slug}
    source = tmp_path / "deep.st"

    def build(size: int):
        source.write_text(PROGRAM.format(last=size - 1, calculation=calculation))
        return compile_sources([source], **options)

    others = build(SAMPLE).needs["stack"].amount - SAMPLE
    built = build((limit - others) // 8 * 8)
    assert limit - 8 < built.needs["stack"].amount <= limit
    built.write(tmp_path / "deep.cdl")
    with Plc(Connection(board.line()), tmp_path / "deep.sym") as plc:
        plc.flash(built.image)
        eventually(lambda: plc.status().state is not AppState.RUN or plc.read("Low.n") > RUNS)
        assert plc.status().exception is None
        assert plc.read("Low.n") < 100000
