"""Online changes on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

PROGRAM = "PROGRAM Main\nVAR x : DINT; END_VAR\nx := x + 1;\nEND_PROGRAM\n"
TASK = (
    "CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#5ms, PRIORITY := 1); PROGRAM Main WITH T : Main;\n"
    "END_RESOURCE END_CONFIGURATION\n"
)


@pytest.fixture(autouse=True)
def source(scratch: Path, tool: Any) -> None:
    (scratch / "main.st").write_text(PROGRAM)
    assert tool("build", "main.st", "-o", "old.cdl").status == 0


def edit(scratch: Path, before: str, after: str) -> None:
    (scratch / "main.st").write_text(PROGRAM.replace(before, after))


def test_plan_of_a_change_is_printed_and_nothing_is_written(tool: Any, scratch: Path) -> None:
    edit(scratch, "x : DINT;", "y : INT := 4; x : DINT;")
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl", "--dry-run")
    assert done.status == 0
    assert "1 variable kept, 1 new, 0 removed; 2 bytes are written\n  new: Main.y" in done.out
    assert not (scratch / "new.cdl").exists()


def test_image_of_a_change_names_the_image_that_it_replaces(tool: Any, scratch: Path) -> None:
    crc = tool("info", "old.cdl", "--json").json["crc"]
    edit(scratch, "x + 1", "x + 2")
    document = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl", "--json").json
    assert document["change"]["base"] == crc == tool("info", "new.cdl", "--json").json["replaces"]


def test_impossible_change_is_refused_in_words(tool: Any, scratch: Path) -> None:
    build = ("build", "main.st", "--target", "cortex-m3", "--base", "old.cdl")
    done = tool(*build, "-o", "new.cdl")
    assert done.status == 2
    why = "the program that runs was built for another target than cortex-m3"
    assert f"No online change: {why}. Undo that, or download the program" in done.err
    assert not (scratch / "new.cdl").exists()
    assert tool(*build, "--dry-run", "--json").json["problems"] == [why]


def test_plan_says_which_tasks_change(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(PROGRAM + TASK)
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl")
    assert done.status == 0
    assert done.out.splitlines()[-2:] == ["  task: T is new", "  task: Main is removed"]


def test_plan_says_what_moves_and_what_begins_anew(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(PROGRAM.replace("x : DINT", "list : ARRAY[1..3] OF INT; x : DINT"))
    assert tool("build", "main.st", "-o", "old.cdl").status == 0
    text = PROGRAM.replace("x : DINT", "list : ARRAY[1..5] OF INT; x : REAL").replace("x + 1", "x + 1.0")
    (scratch / "main.st").write_text(text)
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl", "--dry-run")
    lines = ["  moved: Main.list", "  gets its initial value: Main.x was DINT, is REAL", "  extended: Main.list"]
    assert done.out.splitlines()[1:] == lines


def test_base_that_is_no_image_is_refused(tool: Any) -> None:
    assert "is not a valid application image" in tool("build", "main.st", "--base", "main.st").err
    assert "--dry-run needs --base" in tool("build", "main.st", "--dry-run").err


PROGRAM_CHART = """PROGRAM Main
VAR go, back : BOOL; END_VAR
INITIAL_STEP Idle: END_STEP
STEP Work: END_STEP
TRANSITION FROM Idle TO Work := go; END_TRANSITION
TRANSITION FROM Work TO Idle := back; END_TRANSITION
END_PROGRAM
"""
BLOCK_CHART = (
    PROGRAM_CHART.replace("END_PROGRAM", "END_FUNCTION_BLOCK").replace("PROGRAM Main", "FUNCTION_BLOCK Mixer")
    + "PROGRAM Main VAR mixer : Mixer; END_VAR mixer(); END_PROGRAM\n"
)
NEW_STEP = "STEP More: END_STEP\n"
TO_NEW_STEP = (
    "TRANSITION FROM Work TO More := go; END_TRANSITION\nTRANSITION FROM More TO Idle := back; END_TRANSITION\n"
)


@pytest.mark.parametrize("text", [PROGRAM_CHART, BLOCK_CHART], ids=["program", "block"])
@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        ("Work", "Labour", "the step Work is removed, and may be the active one"),
        ("Idle TO Work :=", "Idle TO (Work, Work2) :=", "steps run in parallel now"),
        (
            "INITIAL_STEP Idle: END_STEP\nSTEP Work: END_STEP",
            "STEP Work: END_STEP\nINITIAL_STEP Idle: END_STEP",
            "order",
        ),
    ],
    ids=["renamed", "parallel", "order"],
)
def test_change_that_would_move_a_chart_to_another_step_is_refused(
    tool: Any, scratch: Path, text: str, before: str, after: str, problem: str
) -> None:
    main = scratch / "main.st"
    main.write_text(text)
    assert tool("build", "main.st", "-o", "old.cdl").status == 0
    changed = text.replace(before, after)
    if "Work2" in after:
        changed = changed.replace("STEP Work:", "STEP Work2: END_STEP\nSTEP Work:")
    main.write_text(changed)
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl")
    assert done.status == 2
    assert "in the chart of M" in done.err
    assert problem in done.err


def test_step_can_be_added_after_the_others_and_actions_can_change(tool: Any, scratch: Path) -> None:
    main = scratch / "main.st"
    main.write_text(PROGRAM_CHART)
    assert tool("build", "main.st", "-o", "old.cdl").status == 0
    longer = PROGRAM_CHART.replace("END_PROGRAM", TO_NEW_STEP + "END_PROGRAM")
    step = "STEP Work: END_STEP\n"
    main.write_text(longer.replace(step, step + NEW_STEP))
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl", "--dry-run")
    assert (done.status, "new: Main.More" in done.out) == (0, True), done.err
    main.write_text(longer.replace(step, NEW_STEP + step))
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl")
    assert "new before others; write new ones after those that are there" in done.err
