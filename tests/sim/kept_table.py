"""The table of what is kept, as docs/language.md has it, and a program with variables of all kinds to try it on."""

from __future__ import annotations

import re
from pathlib import Path

GUIDE = Path(__file__).parents[2] / "docs" / "language.md"
INITIAL, CHANGED = 7, 4711

QUALIFIERS = {
    "VAR": ["", "NON_RETAIN"],
    "RETAIN": ["RETAIN"],
    "PERSISTENT": ["PERSISTENT", "RETAIN PERSISTENT", "PERSISTENT RETAIN"],
}

# {new} is what a changed program has besides; it moves everything else.
PROGRAM = """
TYPE Point : STRUCT {new} x : DINT := 7; END_STRUCT END_TYPE
FUNCTION Seven : DINT
Seven := 7;
END_FUNCTION
FUNCTION_BLOCK Base
VAR_INPUT {new} v : DINT := 7; END_VAR
END_FUNCTION_BLOCK
FUNCTION_BLOCK Whole EXTENDS Base
VAR {new_too} calculated : DINT := Seven(); address : POINTER TO DINT := ADR(v); END_VAR
END_FUNCTION_BLOCK
FUNCTION_BLOCK Part
VAR {new} other : DINT := 7; END_VAR
VAR {qualifier} v : DINT := 7; END_VAR
VAR_STAT {qualifier} shared : DINT := 7; END_VAR
END_FUNCTION_BLOCK
VAR_GLOBAL {qualifier}
    {new} g : DINT := 7;
END_VAR
PROGRAM Main
VAR {qualifier}
    {new_too}
    n : DINT := 7;
    calculated : DINT := Seven();
    p : Point;
    a : ARRAY[1..3] OF DINT := [3(7)];
    grid : ARRAY[0..1, 1..2] OF DINT := [4(7)];
    points : ARRAY[1..2] OF Point;
    whole : Whole;
    wholes : ARRAY[1..5] OF Whole;
END_VAR
VAR
    part : Part;
    parts : ARRAY[1..2] OF Part;
    trip : BOOL;
    zero : DINT;
END_VAR
IF trip THEN zero := 1 / zero; END_IF
END_PROGRAM
PROGRAM Plant
VAR {new} n : DINT := 7; END_VAR
VAR NON_RETAIN lost : DINT := 7; END_VAR
END_PROGRAM
CONFIGURATION Machine
TASK Fast(INTERVAL := T#10ms, PRIORITY := 1);
PROGRAM Main WITH Fast : Main;
PROGRAM {one_qualifier} Second WITH Fast : Plant;
VAR_CONFIG
    Main.p.x : DINT := 7;
END_VAR
END_CONFIGURATION
"""

KEPT = [
    "g", "Main.n", "Main.calculated", "Main.p.x", "Main.a[2]", "Main.grid[1,2]", "Main.points[2].x", "Main.whole.v",
    "Main.whole.calculated", "Main.wholes[4].v", "Main.wholes[4].calculated", "Main.part.v",
    "Main.parts[2].v", "Part.shared", "Second.n",
]  # fmt: skip
"""Variables that are what the qualifier says."""
LOST = ["Main.part.other", "Main.parts[1].other", "Second.lost"]
"""Variables that are VAR, wherever they are."""


def program(qualifier: str, *, changed: bool = False) -> str:
    """The source; `changed`: the variables are elsewhere."""
    new, new_too = ("added : LREAL := 1.5;", "added_too : LREAL := 2.5;") if changed else ("", "")
    text = PROGRAM if qualifier else PROGRAM.replace("PROGRAM {one_qualifier} ", "PROGRAM ")
    one = "PERSISTENT" if "PERSISTENT" in qualifier else qualifier
    return text.format(qualifier=qualifier, one_qualifier=one, new=new, new_too=new_too)


def table() -> list[tuple[str, str, str]]:
    """(event, kind of variable, "kept" or "initial") of each cell."""
    lines = GUIDE.read_text(encoding="utf-8").split("## What is kept\n")[1].strip().split("\n\n")[0].splitlines()
    head, _, *rows = ([cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines)
    return [(row[0], kind, cell) for row in rows for kind, cell in zip(head[1:], row[1:], strict=True)]
