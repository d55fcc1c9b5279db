"""A program saves and loads recipes: the same files as `plctool recipe`, all values or none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator

PROGRAM = """
PROGRAM Main
VAR
    recipe : RECIPE_FILE;
    save, load : BOOL;
    on : BOOL; small : SINT; count : INT; big : ULINT; mask : WORD; level : REAL; precise : LREAL;
    steep : TIME; label : STRING(20);
END_VAR
recipe.Add('Main.on', on);
recipe.Add('Main.small', small);
recipe.Add('Main.count', count);
recipe.Add('Main.big', big);
recipe.Add('Main.mask', mask);
recipe.Add('Main.level', level);
recipe.Add('Main.precise', precise);
recipe.Add('Main.steep', steep);
recipe.Add('Main.label', label);
recipe(xSave := save, xLoad := load, sFileName := 'tea.csv');
END_PROGRAM
"""
NAMES = [f"Main.{name}" for name in ("on", "small", "count", "big", "mask", "level", "precise", "steep", "label")]
VALUES = {
    "Main.on": True,
    "Main.small": -128,
    "Main.count": -32768,
    "Main.big": 2**64 - 1,
    "Main.mask": 0xFFFF,
    "Main.level": 90.5,
    "Main.precise": -1.25e-20,
    "Main.steep": "T#3m12s5ms",
    "Main.label": "gr\"een, $ 'x'\t",
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


def do(plc: Simulator, what: str) -> str:
    """The error; NO_ERROR."""
    plc.write({f"Main.{what}": True})
    for _ in range(100):
        plc.run_cycles(1)
        if plc.read("Main.recipe.xDone") or plc.read("Main.recipe.xError"):
            break
    else:
        raise AssertionError("the block does not come to an end")
    plc.write({f"Main.{what}": False})
    plc.run_cycles(1)
    assert not plc.read("Main.recipe.xBusy")
    return str(plc.read("Main.recipe.eError"))


def test_values_come_back_as_they_were_saved(plc: Simulator) -> None:
    plc.write(VALUES)
    assert do(plc, "save") == "NO_ERROR"
    before = {name: plc.read(name) for name in NAMES}
    plc.write({name: "T#0s" if name == "Main.steep" else "" if name == "Main.label" else 0 for name in NAMES[1:]})
    assert do(plc, "load") == "NO_ERROR"
    assert {name: plc.read(name) for name in NAMES} == before


def test_plctool_reads_what_a_program_saved_and_the_other_way_round(plc: Simulator, tmp_path) -> None:
    plc.write(VALUES)
    do(plc, "save")
    saved = tmp_path / "tea.csv"
    saved.write_bytes(plc.files()["tea.csv"])
    assert plc.recipe_differences(saved) == []
    plc.write({"Main.count": 7, "Main.label": "black"})
    plc.save_recipe(saved, NAMES)
    plc.put_file("tea.csv", saved.read_bytes())
    plc.write({"Main.count": 8, "Main.label": "none"})
    assert do(plc, "load") == "NO_ERROR"
    assert (plc.read("Main.count"), plc.read("Main.label")) == (7, "black")


@pytest.mark.parametrize(
    ("lines", "error", "line"),
    [
        ("Main.count,INT,5\nMain.small,SINT,128\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.small,SINT,-129\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.big,ULINT,18446744073709551616\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.mask,WORD,-1\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.mask,WORD,16#1FFFF\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.level,REAL,1e39\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.level,REAL,\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.steep,TIME,3m\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.on,BOOL,2\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.label,STRING,'123456789012345678901'\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.label,STRING,'a'b'\n", "WRONG_VALUE", 3),
        ("Main.count,INT,5\nMain.small,INT,1\n", "WRONG_TYPE", 3),
        ("Main.count,INT,5\nMain.other,INT,1\n", "UNKNOWN_NAME", 3),
        ("Main.count,INT,5\nMain.count,INT,6\n", "TWICE", 3),
        ("Main.count,INT,5\nMain.small\n", "NOT_CSV", 3),
        ("Main.count,INT,5,6\n", "NOT_CSV", 2),
        ('Main.count,INT,"5\n', "NOT_CSV", 2),
        ("Main.count,INT," + "5" * 300, "NOT_CSV", 2),
        ("\n" * 5000, "TOO_LARGE", 0),
    ],
)
def test_a_file_with_a_mistake_changes_nothing(plc: Simulator, lines: str, error: str, line: int) -> None:
    plc.write({"Main.count": 77})
    plc.put_file("tea.csv", f"name,type,value\n{lines}".encode())
    assert do(plc, "load") == error
    assert (plc.read("Main.count"), plc.read("Main.recipe.udiLine")) == (77, line)


def test_values_that_are_not_in_the_file_stay(plc: Simulator) -> None:
    plc.write({"Main.small": 5})
    plc.put_file("tea.csv", b"name,type,value\r\nMain.count,,16#FF\r\n\r\n")
    assert do(plc, "load") == "NO_ERROR"
    assert (plc.read("Main.count"), plc.read("Main.small")) == (255, 5)


def test_a_missing_file_and_a_file_of_the_device_are_refused(plc: Simulator) -> None:
    assert do(plc, "load") == "FILE_FAILED"
    assert plc.read("Main.recipe.eFileError") == "NOT_EXIST"
