"""No memory of the program is connected twice, by whatever names its parts are called."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from io_support import addresses, build, messages
from shares import examples

PROGRAM = """\
TYPE Point : STRUCT x : INT; y : INT; END_STRUCT; END_TYPE
TYPE Both : UNION word : WORD; low : BYTE; END_UNION; END_TYPE
VAR_GLOBAL g : ARRAY[0..1] OF INT; n : INT; END_VAR
PROGRAM Main
VAR
    list : ARRAY[1..4] OF INT; grid : ARRAY[0..1, 0..1] OF Point; rows : ARRAY[0..1] OF ARRAY[0..1] OF INT;
    p, q : Point; f : Block; both : Both; located AT %IB40 : ARRAY[0..3] OF BYTE;
END_VAR
VAR_EXTERNAL g : ARRAY[0..1] OF INT; n : INT; END_VAR
f();
END_PROGRAM
FUNCTION_BLOCK Block
VAR a, b : BOOL; END_VAR
a := b;
END_FUNCTION_BLOCK
"""

TWICE = [
    ("Main.list[1]", "Main.list[01]"),
    ("Main.list[1]", "Main.list[ 1 ]"),
    ("Main.list[1]", "main.LIST[1]"),
    ("Main.list", "Main.list[1]"),
    ("Main.list[1]", "Main.list"),
    ("Main.p", "Main.p.y"),
    ("Main.grid[1,0]", "Main.grid[1, 0].x"),
    ("Main.grid", "Main.grid[1, 0].x"),
    ("Main.rows[1]", "Main.rows[1][0]"),
    ("Main.both.word", "Main.both.low"),
    ("Main.f.a", "MAIN.F.A"),
    ("g[0]", "Main.g[0]"),
    ("g", "Main.g"),
    ("n", "Main.n"),
    ("g", "g[1]"),
    ("Main.located[1]", "%IB41"),
    ("%IB41", "Main.located[1]"),
    ("Main.located", "Main.located[1]"),
]
APART = [
    ("Main.list[1]", "Main.list[2]"),
    ("Main.p.x", "Main.p.y"),
    ("Main.p", "Main.q.x"),
    ("Main.grid[0,1]", "Main.grid[1,0]"),
    ("Main.f.a", "Main.f.b"),
    ("g[0]", "Main.g[1]"),
    ("Main.located[1]", "%IB42"),
]


@pytest.mark.parametrize(("one", "other"), TWICE)
def test_what_is_connected_twice_is_an_error(tmp_path: Path, one: str, other: str) -> None:
    found = messages(tmp_path, PROGRAM, f"[sim.in]\na = '{one}'\nb = '{other}'")
    assert [m for m in found if m.startswith("3: ") and "the channel a in line 2" in m and "already" in m], found


@pytest.mark.parametrize(("one", "other"), [pair for pair in TWICE if "%" not in pair[0] + pair[1]])
def test_input_that_is_an_output_too_is_an_error(tmp_path: Path, one: str, other: str) -> None:
    assert any(m.startswith("4: ") for m in messages(tmp_path, PROGRAM, f"[sim.in]\na='{one}'\n[sim.out]\nb='{other}'"))


@pytest.mark.parametrize(("one", "other"), APART)
def test_what_is_apart_is_not(tmp_path: Path, one: str, other: str) -> None:
    found = messages(tmp_path, PROGRAM, f"[sim.in]\na = '{one}'\nb = '{other}'")
    assert [m for m in found if "never used" not in m] == []


def test_part_of_a_variable_with_an_address_is_at_an_address(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, "[sim.in]\na = 'Main.located[1]'")
    assert addresses(built) == {"Main.located[1]": "%IB41"}
    found = messages(tmp_path, PROGRAM, "[sim.out]\na = 'Main.located[1]'")
    assert "2: Main.located[1] is at an address of the inputs, but a is an output" in found


INDICES = st.integers(-3, 3)
SPELLINGS = st.sampled_from(["{}", " {}", "{} ", "0{}", "00{}"])


@examples(40)
@given(INDICES, INDICES, SPELLINGS, SPELLINGS)
def test_elements_are_the_same_if_their_numbers_are(tmp_path: Path, i: int, j: int, one: str, other: str) -> None:
    program = "PROGRAM Main\nVAR list : ARRAY[-3..3] OF INT; END_VAR\nlist := list;\nEND_PROGRAM\n"
    first, second = (f"-{form.strip().format(-n)}" if n < 0 else form.format(n) for form, n in ((one, i), (other, j)))
    found = messages(tmp_path, program, f"[sim.in]\na = 'Main.list[{first}]'\nb = 'Main.list[{second}]'")
    assert any("already" in m for m in found) is (i == j)
