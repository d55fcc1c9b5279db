"""PLCopen XML of CODESYS: Continuous Function Charts run in the order of their numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from plcopen_support import data, errors, pou, project, st, started, variables
from test_plcopen_diagrams import CYCLE, at, block, given, lines, run, taken


def chart(*elements: str) -> str:
    """A body, as CODESYS writes it."""
    added = data("cfc", f"<CFC>\n{''.join(elements)}</CFC>")
    return f'<ST><xhtml xmlns="http://www.w3.org/1999/xhtml"/></ST><addData>{added}</addData>'


def wire(number: int, source: str) -> str:
    """A line; those who read it refer to it."""
    return f'<connector localId="{number}" name="">{at(0)}{lines(source)}</connector>\n'


def numbered(text: str, order: int, call: str = "") -> str:
    """An element with its number, a block also with what it calls."""
    text = text.replace(' executionOrderId="0"', "")
    head, _, rest = text.partition(">")
    called = f"<addData>{data('cfccalltype', f'<CallType>{call}</CallType>')}</addData>" if call else ""
    return f'{head} executionOrderId="{order}">{rest}'.replace("</block>", f"{called}</block>")


def operator(number: int, kind: str, order: int, *sources: str) -> str:
    """An operator."""
    inputs = {f"In{n}": source for n, source in enumerate(sources, 1)}
    return numbered(block(number, kind, inputs, "Out1"), order, "operator")


def test_elements_run_in_the_order_of_their_numbers_from_zero(tmp_path: Path) -> None:
    body = chart(
        given(1, "a"),
        wire(2, "1"),
        numbered(taken(3, "b", "2"), 1),
        given(4, "7"),
        numbered(taken(5, "a", "4"), 0),
        given(6, "b"),
        numbered(taken(7, "c", "6"), 2),
    )
    assert run(tmp_path, body, ["a:INT", "b:INT", "c:INT"]) == {"a": 7, "b": 7, "c": 7}


def test_what_a_later_element_gives_is_of_the_cycle_before(tmp_path: Path) -> None:
    body = chart(
        numbered(taken(1, "seen", "3"), 0),
        operator(2, "ADD", 1, "4", "5"),
        wire(3, "2.Out1"),
        given(4, "n"),
        given(5, "1"),
        numbered(taken(6, "n", "3"), 2),
    )
    assert run(tmp_path, body, ["n:INT", "seen:INT"], cycles=4) == {"n": 4, "seen": 3}


def test_a_function_may_read_its_own_result(tmp_path: Path) -> None:
    body = chart(
        operator(1, "ADD", 0, "2", "3"),
        wire(2, "1.Out1"),
        given(3, "step"),
        numbered(taken(4, "sum", "2"), 1),
    )
    assert run(tmp_path, body, ["step:INT:=2", "sum:INT"], cycles=3)["sum"] == 6


def test_blocks_and_programs_are_called(tmp_path: Path) -> None:
    other = pou("Other", st("q := i * 2;"), variables("inputVars", "i:INT") + variables("outputVars", "q:INT"))
    body = chart(
        given(1, "go"),
        wire(2, "1"),
        numbered(block(3, "TON", {"IN": "2", "PT": "4"}, "Q ET", "delay"), 0, "functionblock"),
        given(4, "T#20ms"),
        wire(5, "3.Q"),
        numbered(taken(6, "done", "5"), 1),
        given(7, "21"),
        numbered(block(8, "Other", {"i": "7"}, "q"), 2, "program"),
        wire(9, "8.q"),
        numbered(taken(10, "n", "9"), 3),
    )
    local = ["go:BOOL:=TRUE", "done:BOOL", "n:INT", "delay:TON"]
    assert run(tmp_path, body, local, 4, other) == {"go": True, "done": True, "n": 42}


def test_jumps_go_to_labels_by_their_numbers(tmp_path: Path) -> None:
    body = chart(
        given(1, "go"),
        numbered(f'<jump localId="2" label="over">{at(0)}{lines("1")}</jump>', 0),
        given(3, "1"),
        numbered(taken(4, "n", "3"), 1),
        numbered(f'<label localId="5" label="over">{at(0)}</label>', 2),
        numbered(taken(6, "m", "3"), 3),
    )
    assert run(tmp_path, body, ["go:BOOL:=TRUE", "n:INT", "m:INT"]) == {"go": True, "n": 0, "m": 1}


@pytest.mark.parametrize(
    ("element", "why"),
    [
        ("<vendorElement localId='9'/>", "it has a special element"),
        (numbered(block(9, "x.Do", {}, ""), 0, "method"), "it has a method"),
    ],
)
def test_what_is_not_read_is_named(tmp_path: Path, element: str, why: str) -> None:
    ((_, message),) = errors(tmp_path, project(pou("Main", chart(element), "")))
    assert message == f"the diagram Main (CFC) cannot be compiled: {why}"


def test_a_function_keeps_nothing_for_the_next_cycle(tmp_path: Path) -> None:
    body = chart(operator(1, "ADD", 0, "2", "3"), wire(2, "1.Out1"), given(3, "1"), numbered(taken(4, "F", "2"), 1))
    own = pou("F", body, "<returnType><INT/></returnType>", "function")
    ((_, message),) = errors(tmp_path, project(own))
    assert message == "the diagram F (CFC) cannot be compiled: it has a loop without a function block"


def test_a_chart_of_codesys_runs_in_its_configuration(tmp_path: Path) -> None:
    body = chart(operator(1, "NOT", 0, "2"), given(2, "on"), wire(3, "1.Out1"), numbered(taken(4, "on", "3"), 1))
    main = pou("Main", body, variables("localVars", "on:BOOL"))
    with started(tmp_path, project(main, instances=CYCLE)) as plc:
        seen = []
        for _ in range(3):
            plc.run_cycles(1)
            seen.append(plc.read("Main.on"))
    assert seen == [True, False, True]
