"""Function blocks with VAR_GENERIC CONSTANT: one for each size that a program has of them."""

from __future__ import annotations

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import build_program
from plctool.fmt.formatter import formatted
from plctool.image.targets import DEFAULT_TARGET, TARGETS, find_target
from plctool.sim import Simulator

FIFO = """
FUNCTION_BLOCK Fifo
VAR_GENERIC CONSTANT
    n : UDINT := 5;
END_VAR
VAR
    items : ARRAY[0..n - 1] OF INT;
    head, count : UDINT;
END_VAR
METHOD Push : BOOL
VAR_INPUT value : INT; END_VAR
IF count < n THEN
    items[(head + count) MOD n] := value;
    count := count + 1;
    Push := TRUE;
END_IF
END_METHOD
METHOD Pop : INT
IF count > 0 THEN
    Pop := items[head];
    head := (head + 1) MOD n;
    count := count - 1;
END_IF
END_METHOD
END_FUNCTION_BLOCK
"""
PROGRAM = (
    FIFO
    + """
FUNCTION_BLOCK Pair
VAR_GENERIC CONSTANT m : UDINT; END_VAR
VAR a : Fifo<m>; b : Fifo<(m * 2)>; n : DINT; END_VAR
n := SIZEOF(a) + SIZEOF(b);
END_FUNCTION_BLOCK
VAR_GLOBAL CONSTANT SIZE : UDINT := 3; END_VAR
PROGRAM Main
VAR CONSTANT own : UDINT := SIZE + 1; END_VAR
VAR
    f : Fifo<3>;
    g : Fifo;
    h : ARRAY[1..2] OF Fifo<own>;
    p : Pair<SIZE>;
    i : INT;
    taken : ARRAY[1..3] OF INT;
    first : INT;
END_VAR
FOR i := 1 TO 9 DO
    IF f.Push(i) THEN taken[1] := taken[1] + 1; END_IF
    IF g.Push(i) THEN taken[2] := taken[2] + 1; END_IF
    IF h[2].Push(i * 10) THEN taken[3] := taken[3] + 1; END_IF
END_FOR
first := h[2].Pop();
p();
END_PROGRAM
"""
)


def said(text: str) -> list[tuple[int, str]]:
    """The errors in a program that begins with FIFO, by line after it."""
    found = check_sources([Source("p.st", FIFO + text)]).diagnostics
    return [(d.line - FIFO.count("\n"), d.message) for d in found if d.severity == "error"]


def test_each_instance_has_the_size_that_its_type_says() -> None:
    checked = check_sources([Source("p.st", PROGRAM)])
    assert checked.program is not None, checked.diagnostics
    built = build_program(checked.program, Options(find_target(DEFAULT_TARGET), 2))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert [plc.read(f"Main.taken[{n}]") for n in (1, 2, 3)] == [3, 5, 4]
        assert plc.read("Main.first") == 10
        assert plc.read("Main.p.n") == (3 * 2 + 2 + 8) + (6 * 2 + 8)


def test_instances_of_one_size_are_of_one_type() -> None:
    text = """FUNCTION Put : BOOL
VAR_IN_OUT into : Fifo<4>; END_VAR
Put := into.Push(7);
END_FUNCTION
VAR_GLOBAL CONSTANT SIZE : UDINT := 4; END_VAR
PROGRAM Main
VAR f : Fifo<SIZE>; g : Fifo<5>; ok : BOOL; END_VAR
ok := Put(f);
ok := Put(g);
END_PROGRAM
"""
    ((line, message),) = said(text)
    assert line == 9
    assert "Fifo<4>" in message
    assert "Fifo<5>" in message


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_they_are_built_for_every_target(target: str) -> None:
    checked = check_sources([Source("p.st", PROGRAM)])
    assert checked.program is not None, checked.diagnostics
    assert build_program(checked.program, Options(find_target(target), 2)).image


@pytest.mark.parametrize(
    ("declared", "messages"),
    [
        ("f : Fifo<x>; x : UDINT;", ["a constant of Fifo is a number, or a constant that is one"]),
        ("f : Fifo<1, 2>;", ["Fifo has 1 constant: write Fifo<n>"]),
        ("f : Fifo<(4 / 0)>;", ["a constant of Fifo is a number, or a constant that is one"]),
        ("f : INT<3>;", ["INT has no VAR_GENERIC CONSTANT, so nothing follows it in < >"]),
        ("f : Plain<3>;", ["Plain has no VAR_GENERIC CONSTANT, so nothing follows it in < >"]),
        ("f : Gone<3>;", ["unknown type Gone"]),
        ("f : Fifo>3>;", ["the constants of a block stand between < and >"]),
        ("f : Endless<1>;", ["Endless has blocks of ever other sizes"]),
        ("f : Needy;", ["Needy has 1 constant: write Needy<k>"]),
    ],
)
def test_what_is_no_size_is_refused_once(declared: str, messages: list[str]) -> None:
    text = f"""FUNCTION_BLOCK Plain
END_FUNCTION_BLOCK
FUNCTION_BLOCK Endless
VAR_GENERIC CONSTANT k : UDINT; END_VAR
VAR e : Endless<(k + 1)>; END_VAR
END_FUNCTION_BLOCK
FUNCTION_BLOCK Needy
VAR_GENERIC CONSTANT k : UDINT; END_VAR
END_FUNCTION_BLOCK
PROGRAM Main
VAR {declared} END_VAR
END_PROGRAM
"""
    found = [message for _, message in said(text)]
    assert len(found) == len(messages), found
    assert all(wanted in message for wanted, message in zip(messages, found, strict=True)), found


def test_the_formatter_sets_no_blanks_into_a_type() -> None:
    text = "PROGRAM Main\nVAR\n    f : Fifo < 3 > ;\n    b : BOOL := 1<2;\nEND_VAR\nEND_PROGRAM\n"
    assert formatted("p.st", text) == text.replace("Fifo < 3 > ;", "Fifo<3>;").replace("1<2", "1 < 2")
