"""PLCopen XML: jumps and labels between networks of LD and FBD."""

from __future__ import annotations

from pathlib import Path

import pytest
from plcopen_support import errors, pou, project, started, variables
from test_plcopen_diagrams import CYCLE, at, block, coil, contact, given, ladder, lines, network, run, taken


def jump(number: int, label: str, *sources: str, row: int = 0, more: str = "") -> str:
    """A jump."""
    return f'<jump localId="{number}" label="{label}" {more}>{at(row, 90)}{lines(*sources)}</jump>\n'


def label(number: int, name: str, row: int = 0, more: str = "") -> str:
    """A label."""
    return f'<label localId="{number}" label="{name}" {more}>{at(row)}</label>\n'


@pytest.mark.parametrize(("skip", "seen"), [("TRUE", (False, True)), ("FALSE", (True, True))])
def test_a_jump_leaves_out_the_networks_up_to_its_label(tmp_path: Path, skip: str, seen: tuple[bool, bool]) -> None:
    body = ladder(
        coil(7, "c", "1", row=130),
        contact(2, "skip", "1"),
        jump(3, "over", "2", row=10),
        coil(5, "b", "1", row=50),
        label(6, "over", row=100),
    )
    found = run(tmp_path, body, [f"skip:BOOL:={skip}", "b:BOOL", "c:BOOL"])
    assert (found["b"], found["c"]) == seen


def test_a_jump_is_the_last_in_its_network(tmp_path: Path) -> None:
    body = network(
        given(1, "TRUE"),
        jump(2, "over", "4.ENO", row=10),
        given(3, "n"),
        block(4, "MOVE", {"EN": "1", "IN": "3"}, "ENO OUT", row=10),
        taken(5, "m", "4.OUT", row=20),
        given(6, "FALSE"),
        taken(7, "m", "8", row=60),
        given(8, "0"),
        label(9, "over", row=90),
    )
    assert run(tmp_path, body, ["n:INT:=7", "m:INT"])["m"] == 7


def test_a_jump_back_repeats(tmp_path: Path) -> None:
    body = network(
        label(1, "again", row=0),
        given(2, "n"),
        given(3, "1"),
        block(4, "ADD", {"IN1": "2", "IN2": "3"}, row=30),
        taken(5, "n", "4.OUT", row=30),
        given(6, "n"),
        given(7, "5"),
        block(8, "GE", {"IN1": "6", "IN2": "7"}, row=80),
        jump(9, "again", "8.OUT", row=80, more='negated="true"'),
    )
    assert run(tmp_path, body, ["n:INT"])["n"] == 5


def test_networks_without_positions_are_in_the_order_of_the_file(tmp_path: Path) -> None:
    body = ladder(
        contact(2, "a", "1"),
        jump(3, "over", "2"),
        coil(4, "b", "1"),
        label(5, "over"),
        coil(6, "c", "1"),
    ).replace('x="90"', 'x="0"')
    assert run(tmp_path, body, ["a:BOOL:=TRUE", "b:BOOL", "c:BOOL"]) == {"a": True, "b": False, "c": True}


def test_a_block_after_a_jump_is_not_executed(tmp_path: Path) -> None:
    body = ladder(
        contact(2, "go", "1"),
        jump(3, "over", "2", row=0),
        contact(4, "go", "1"),
        block(5, "TON", {"IN": "4"}, "Q ET", "late", row=40),
        label(6, "over", row=90),
    )
    main = pou("Main", body, variables("localVars", "go:BOOL:=TRUE", "late:TON"))
    with started(tmp_path, project(main, instances=CYCLE)) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.late.IN") is False


def test_a_jump_to_nothing_is_an_error_at_its_line(tmp_path: Path) -> None:
    text = project(pou("Main", ladder(jump(2, "gone", "1")), ""))
    line = text[: text.index("<jump")].count("\n") + 1
    assert errors(tmp_path, text) == [
        (line, "there is no label gone here; a JMP does not leave its body, METHOD or ACTION")
    ]
