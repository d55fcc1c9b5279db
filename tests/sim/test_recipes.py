"""Recipes in the simulator, and their files; the rest of the promise is in tests/recipes.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1]))

from recipes import PROGRAM, Recipes

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.debug.recipes import Recipe, Value, read_recipe, write_recipe
from plctool.errors import UsageError
from plctool.sim import Simulator


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


class TestSimulator(Recipes):
    has_no_limit = True

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        plc.run_cycles(1)
        while not condition():
            plc.run_cycles(1)

    def test_value_that_the_program_writes_over_is_an_error(self) -> None:  # type: ignore[override]
        """No cycle runs in a simulator while it is written."""


def test_names_that_have_no_value_to_save_are_refused(plc: Simulator) -> None:
    for name, words in (("Main.limit", "constant"), ("Main.nothing", "no variable"), ("Other.*", "No variable")):
        with pytest.raises(UsageError, match=words):
            plc.recipe([name])
    with pytest.raises(UsageError, match="Name what the recipe"):
        plc.recipe([])
    assert "Main.limit" not in plc.recipe(["Main.*"]).values


def test_type_of_a_recipe_does_not_depend_on_limits_and_lengths(plc: Simulator) -> None:
    kinds = {name: value.type for name, value in plc.recipe(["Main.tea"]).values.items()}
    assert (kinds["Main.tea.cups"], kinds["Main.tea.label"], kinds["Main.tea.mode"]) == ("INT", "STRING", "Mode")
    assert plc.check_recipe(Recipe({"Main.tea.cups": Value("3", "INT(0..99)")}))


def test_bits_and_references_are_values_of_recipes(plc: Simulator) -> None:
    plc.run_cycles(1)
    plc.load_recipe(Recipe({"Main.tea.flags.9": Value("TRUE", "BOOL"), "Main.way.cups": Value("4")}))
    assert (plc.read("Main.tea.flags"), plc.read("Main.tea.cups")) == (0x200, 4)


def test_recipe_may_be_loaded_in_part(plc: Simulator) -> None:
    recipe = plc.recipe(["Main.list", "Main.tea"])
    assert list(recipe.only(["main.LIST[2]", "*.cups"]).values) == ["Main.list[2]", "Main.tea.cups"]
    with pytest.raises(UsageError, match=r"has no value for Main.n\*"):
        recipe.only(["Main.n*"])


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("a.txt", "", "neither .json nor .csv"),
        ("a.json", "{", "a.json:1:2: not JSON"),
        ("a.json", "[]", "is not a recipe; write"),
        ("a.json", '{"recipe": {}}', "has no values"),
        ("a.json", '{"recipe": {"Main.a": null}}', "Main.a has no value"),
        ("a.json", '{"recipe": {"Main.a": {"value": "1", "unit": "s"}}}', "unknown key unit"),
        ("a.json", '{"recipe": {"Main.a": 1, "Main.a": 2}}', "Main.a is there twice"),
        ("a.json", "[" * 100_000, "a.json"),
        ("a.csv", "", "not name,type,value"),
        ("a.csv", "name,unit,value\n", "a.csv:1: the first line is not"),
        ("a.csv", "name,value\nMain.a\n", "a.csv:2: 1 cells, but 2 columns"),
        ("a.csv", "name,value\nMain.a,1\n\nMain.a,2\n", "a.csv:4: Main.a is there twice"),
        ("a.csv", 'name,value\nMain.a,"1"2\n', "a.csv:2: not CSV"),
        ("a.csv", "name,value\n", "has no values"),
        ("a.csv", "name,value\nMain.a,\xe9\n", "not UTF-8"),
    ],
)
def test_file_that_is_not_a_recipe_is_refused_with_its_line(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text, "latin-1")
    with pytest.raises(UsageError) as caught:
        read_recipe(tmp_path / name)
    assert words in caught.value.message


def test_recipe_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        read_recipe(tmp_path / "none.json")


def test_recipe_written_by_hand_may_leave_out_types(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    file.write_text('{"recipe": {"Main.a": 5, "Main.b": true, "Main.c": 1.5, "Main.d": "T#2s"}}')
    assert read_recipe(file).texts == {"Main.a": "5", "Main.b": "TRUE", "Main.c": "1.5", "Main.d": "T#2s"}


def test_csv_of_a_spreadsheet_may_have_semicolons_and_a_byte_order_mark(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_bytes("\ufeffValue;Name\r\nT#2s;Main.a\r\n'x,y';Main.b\r\n".encode())
    assert read_recipe(file).texts == {"Main.a": "T#2s", "Main.b": "'x,y'"}


@given(st.dictionaries(st.from_regex(r"[A-Z][a-z]{0,5}(\.[a-z]+(\[[0-9]\])?){1,3}", fullmatch=True),
                       st.text(st.characters(exclude_categories=["Cs", "Cc"])), min_size=1))  # fmt: skip
def test_recipe_reads_back_as_it_was_written(tmp_path_factory, texts: dict[str, str]) -> None:
    recipe = Recipe({name: Value(text, "STRING") for name, text in texts.items()})
    for name in ("a.json", "a.csv"):
        file = tmp_path_factory.mktemp("recipe") / name
        write_recipe(file, recipe)
        read = read_recipe(file)
        assert {name: (value.text, value.type) for name, value in read.values.items()} == {
            name: (text, "STRING") for name, text in texts.items()
        }
