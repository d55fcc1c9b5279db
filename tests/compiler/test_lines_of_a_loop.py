"""Wherever a loop is stopped, the line is one of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import Level, compile_sources
from plctool.image.targets import TARGETS

PROGRAM = """PROGRAM Main
VAR run : BOOL; x, begun : DINT; END_VAR
begun := begun + 1;
WHILE run DO
    x := x + 1;
END_WHILE
END_PROGRAM
"""
BEFORE, LOOP = 3, range(4, 8)  # lines of the statement before it; of the loop, and of what leads out of it


@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize("target", sorted(TARGETS))
def test_code_after_the_statement_before_it_is_of_the_loop(target: str, level: Level, tmp_path: Path) -> None:
    """At -O0 the loop begins with code that has no line of its own: it loads a pointer that is in no register."""
    (tmp_path / "main.st").write_text(PROGRAM)
    symbols = compile_sources([tmp_path / "main.st"], target=target, level=level).symbols
    unit = next(unit for unit in symbols.pous if unit.name == "Main")
    last = max(at for at, _, line in symbols.lines if line == BEFORE)
    rows = [at for at, _, line in symbols.lines if last < at < unit.offset + unit.size and line != BEFORE]
    assert rows
    for offset in range(min(rows), unit.offset + unit.size):
        place = symbols.address_to_line(offset)
        assert place is not None
        assert place.line in LOOP
