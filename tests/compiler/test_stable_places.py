"""`build --base`: variables that both programs have stay where they are."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from shares import share

sys.path.append(str(Path(__file__).parents[1]))

from online_programs import Source, built, edited, random_source

from plctool.core import lib
from plctool.debug.symbols import SymbolTable
from plctool.image.file import parse_image


def places(table: SymbolTable) -> dict[str, tuple[int, int, str, int]]:
    return {name: (s.area, s.offset, str(s.type), s.size) for name, s in table.variables.items()}


def assert_apart(table: SymbolTable) -> None:
    spans = sorted((s.area, s.offset, s.offset + s.size, name) for name, s in table.variables.items())
    for (area, _, end, name), (other_area, start, _, other) in pairwise(spans):
        assert area != other_area or end <= start, f"{name} and {other} overlap"


@pytest.mark.parametrize("seed", share(range(12), 3))
def test_any_edit_leaves_every_other_place_as_it_was(seed: int, tmp_path: Path) -> None:
    random = Random(seed)
    source = random_source(random)
    before = built(tmp_path, source.text)
    for n in range(4):
        source = edited(random, source, 100 * (n + 1))
        after = built(tmp_path, source.text, before.symbols)
        assert after.change is not None and after.change.problems == []
        had, has = places(before.symbols), places(after.symbols)
        new = {v.name for v in after.change.new}
        stay = (has.keys() & had.keys()) - new - set(after.change.moved)
        assert {name: has[name][:2] for name in stay} == {name: had[name][:2] for name in stay}
        assert has.keys() - had.keys() <= new
        assert {why.partition(" was ")[0] for why in after.change.retyped} >= new & had.keys()
        assert sorted(after.change.removed) == sorted(had.keys() - has.keys())
        assert_apart(after.symbols)
        old = [(s.area, s.offset, s.offset + s.size) for s in before.symbols.variables.values()]
        for name in new | set(after.change.moved):  # the program that runs uses none of their places
            area, offset, _, size = has[name]
            assert not [o for o in old if o[0] == area and o[1] < offset + size and offset < o[2]], name
        before = after


def test_room_of_removed_variables_is_used_again(tmp_path: Path) -> None:
    """Not at once, but by the next change, so that a program does not grow for ever."""
    text = "PROGRAM Main VAR {} : ARRAY[1..50] OF DINT; END_VAR ; END_PROGRAM"
    result = built(tmp_path, text.format("v0"))
    first = parse_image(result.image).areas
    for n in range(1, 20):
        result = built(tmp_path, text.format(f"v{n}"), result.symbols)
    assert parse_image(result.image).areas[0] <= 2 * first[0] + 8


def change_of(tmp_path: Path, before: str, after: str) -> list[str]:
    base = built(tmp_path, before).symbols
    change = built(tmp_path, after, base).change
    assert change is not None
    return change.problems


MAIN = "PROGRAM Main VAR {} END_VAR ; END_PROGRAM"
BLOCK = "FUNCTION_BLOCK B VAR_INPUT {} END_VAR ; END_FUNCTION_BLOCK " + MAIN.format("b : B;")
EXIT = "FUNCTION_BLOCK E METHOD FB_Exit : BOOL ; END_METHOD ; END_FUNCTION_BLOCK "


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        (
            EXIT + MAIN.format("e : E;"), EXIT + MAIN.format("f : INT;"),
            "Main.e is removed, and its FB_Exit would not run",
        ),
    ],
)  # fmt: skip
def test_what_cannot_change_is_named(tmp_path: Path, before: str, after: str, problem: str) -> None:
    assert change_of(tmp_path, before, after) == [problem]


@pytest.mark.parametrize(
    ("before", "after", "moved", "retyped"),
    [
        (MAIN.format("x : INT;"), MAIN.format("x : DINT;"), ["Main.x"], []),
        (MAIN.format("x : DINT;"), MAIN.format("x : INT;"), [], ["Main.x was DINT, is INT"]),
        (MAIN.format("x : STRING[5];"), MAIN.format("x : STRING[9];"), ["Main.x"], []),
        (BLOCK.format("a : DINT;"), BLOCK.format("a : DINT; c : DINT;"), ["Main.b"], []),
        (BLOCK.format("a, c : INT;"), BLOCK.format("c, a : INT;"), ["Main.b"], []),
        (BLOCK.format("a, c : DINT;"), BLOCK.format("a : DINT;"), [], []),
        (BLOCK.format("a : DINT;"), BLOCK.format("a : REAL;"), [], ["Main.b: B.a was DINT, is REAL"]),
        (MAIN.format("x : DINT;"), MAIN.replace("VAR", "VAR RETAIN", 1).format("x : DINT;"), ["Main.x"], []),
    ],
)
def test_what_moves_and_what_begins_anew_is_named(
    tmp_path: Path, before: str, after: str, moved: list[str], retyped: list[str]
) -> None:
    change = built(tmp_path, after, built(tmp_path, before).symbols).change
    assert change is not None
    assert (change.moved, change.retyped, change.problems) == (moved, retyped, [])


def test_constant_that_changes_is_saved_for_the_way_back_and_another_one_costs_nothing(tmp_path: Path) -> None:
    variables = "VAR n : INT; END_VAR VAR CONSTANT c : ARRAY[1..2] OF INT := [{}, 2]; END_VAR"
    text = f"PROGRAM Main {variables} n := n + c[1 + n MOD 2]; END_PROGRAM"
    base = built(tmp_path, text.format(1)).symbols
    steps = parse_image(built(tmp_path, text.format(5), base).image).change
    assert steps is not None and [s.kind for s in steps.steps] == [lib.CDL_CHANGE_COPY, lib.CDL_CHANGE_PUT]
    same = parse_image(built(tmp_path, text.format(1).replace("n + c", "n - c"), base).image).change
    assert same is not None and same.steps == ()


def test_a_member_that_fits_into_a_gap_is_new_in_its_place(tmp_path: Path) -> None:
    base = built(tmp_path, BLOCK.format("a : BOOL; c : DINT;")).symbols
    result = built(tmp_path, BLOCK.format("a : BOOL; b : INT := 7; c : DINT;"), base)
    assert result.change is not None and result.change.problems == []
    steps = parse_image(result.image).change
    assert steps is not None and [(s.to, s.data) for s in steps.steps] == [(2, b"\7\0")]


def test_classes_keep_their_numbers(tmp_path: Path) -> None:
    def classes(*names: str) -> str:
        extending = "".join(f"FUNCTION_BLOCK {n} EXTENDS Base ; END_FUNCTION_BLOCK " for n in names)
        own = "".join(f"x{n} : {n}; " for n in names)
        return "FUNCTION_BLOCK Base ; END_FUNCTION_BLOCK " + extending + MAIN.format(own)

    base = built(tmp_path, classes("A", "B")).symbols
    changed = built(tmp_path, classes("Z", "B", "A"), base).symbols
    assert {n: changed.classes[n] for n in ("A", "B", "Base")} == {n: base.classes[n] for n in ("A", "B", "Base")}
    assert changed.classes["Z"] not in base.classes.values()


def test_a_program_without_changes_has_no_steps(tmp_path: Path) -> None:
    text = Source(random_source(Random(5)).lines).text
    result = built(tmp_path, text, built(tmp_path, text).symbols)
    image = parse_image(result.image)
    assert image.change is not None and image.change.steps == ()
