"""Recipes on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from plctool.controller import Controller
from plctool.errors import DeviceError, UsageError
from plctool.testing.waiting import eventually

PROGRAM = """
TYPE
    Mode : (Idle, Brew, Clean);
    Tea : STRUCT
        temperature : REAL := 90.5;
        steep : TIME := T#3m;
        cups : INT (1..12) := 2;
        mode : Mode := Brew;
        label : STRING(20) := 'green, $'hot$'';
        flags : WORD;
    END_STRUCT;
END_TYPE
PROGRAM Main
VAR RETAIN tea : Tea; END_VAR
VAR
    active : Tea;
    take_over, fight : BOOL;
    list : ARRAY[1..3] OF DINT := [10, 20, 30];
    way : REFERENCE TO Tea;
    table : ARRAY[1..2000] OF INT;
END_VAR
VAR CONSTANT limit : INT := 5; END_VAR
IF take_over THEN active := tea; take_over := FALSE; END_IF
IF fight THEN tea.cups := limit; END_IF
way REF= tea;
list[1] := list[1] + 0 * table[1];
END_PROGRAM
"""
TEA = {
    "Main.tea.temperature": 90.5,
    "Main.tea.steep": "T#3m",
    "Main.tea.cups": 2,
    "Main.tea.mode": "Brew",
    "Main.tea.label": "green, 'hot'",
    "Main.tea.flags": 0,
}


class Recipes:
    """The fixture `plc` is a controller that runs PROGRAM."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    @pytest.mark.parametrize("suffix", ["json", "csv"])
    def test_values_that_were_saved_are_loaded_again(self, plc: Controller, tmp_path: Path, suffix: str) -> None:
        file = tmp_path / f"tea.{suffix}"
        assert list(plc.save_recipe(file, ["Main.tea", "Main.list[2]"]).values) == [*TEA, "Main.list[2]"]
        plc.write({"Main.tea.steep": "T#1s", "Main.tea.label": "x", "Main.list": [1, 2, 3]})
        loaded = plc.load_recipe(file)
        assert [d.name for d in loaded.changed] == ["Main.tea.steep", "Main.tea.label", "Main.list[2]"]
        assert (loaded.values, loaded.together) == (7, True)
        assert plc.read_all(list(TEA)) == TEA
        assert plc.read("Main.list") == [1, 20, 3]
        assert plc.recipe_differences(file) == []

    def test_saving_again_takes_the_names_of_the_file(self, plc: Controller, tmp_path: Path) -> None:
        file = tmp_path / "tea.csv"
        plc.save_recipe(file, ["Main.tea.cups"])
        plc.write({"Main.tea.cups": 7})
        assert plc.save_recipe(file).texts == {"Main.tea.cups": "7"}

    def test_recipe_with_mistakes_names_all_of_them_and_writes_nothing(self, plc: Controller, tmp_path: Path) -> None:
        file = tmp_path / "bad.csv"
        file.write_text(
            "name,type,value\nMain.tea.flags,WORD,16#7\nMain.tea.cups,INT,13\nMain.tee.mode,Mode,Idle\n"
            "Main.tea.temperature,LREAL,1.0\nMain.tea.mode,,Boil\nMain.limit,INT,6\nmain.tea.FLAGS,,1\n"
            f"Main.tea.label,STRING,{'x' * 21}\n"
        )
        with pytest.raises(UsageError) as caught:
            plc.load_recipe(file)
        for words in (
            "7 values do not fit the program",
            f"{file}:3: Main.tea.cups: '13' is not a value of INT(1..12)",
            f"{file}:4: There is no variable Main.tee.mode",
            f"{file}:5: Main.tea.temperature is REAL in the program, LREAL in the recipe",
            f"{file}:6: Main.tea.mode: 'Boil' is not a value of Mode",
            f"{file}:7: Main.limit is a constant",
            f"{file}:8: main.tea.FLAGS and Main.tea.flags are the same variable",
            f"{file}:9: Main.tea.label: ",
        ):
            assert words in caught.value.message
        assert plc.read_all(list(TEA)) == TEA

    def test_value_that_the_program_writes_over_is_an_error(self, plc: Controller, tmp_path: Path) -> None:
        file = tmp_path / "tea.json"
        plc.save_recipe(file, ["Main.tea.cups"])
        plc.force({"Main.tea.cups": 5})
        self.wait(plc, lambda: plc.read("Main.tea.cups") == 5)
        plc.write({"Main.list": [7, 7, 7]})
        with pytest.raises(DeviceError, match=r"Main.tea.cups = 5, not 2: the program, a force or another tool"):
            for _ in range(100):  # a force is put back by the next cycle
                plc.load_recipe(file, {"Main.take_over": True})
                self.wait(plc, lambda: plc.read("Main.tea.cups") == 5)
        plc.unforce()

    def test_what_comes_then_is_written_after_all_values(self, plc: Controller, tmp_path: Path) -> None:
        file = tmp_path / "tea.json"
        plc.save_recipe(file, ["Main.tea"])
        plc.write({"Main.active.cups": 9, "Main.active.label": "old"})
        plc.load_recipe(file, then={"Main.take_over": True})
        self.wait(plc, lambda: not plc.read("Main.take_over"))
        assert plc.read("Main.active") == plc.read("Main.tea")
        with pytest.raises(UsageError, match="no variable Main"):
            plc.load_recipe(file, then={"Main.takeover": True})

    def test_more_values_than_a_request_takes_are_written_and_said(self, plc: Controller) -> None:
        recipe = plc.recipe(["Main.table"])
        plc.write({"Main.table": [7] * 2000})
        loaded = plc.load_recipe(recipe)
        assert (loaded.values, len(loaded.changed)) == (2000, 2000)
        assert loaded.together == self.has_no_limit
        assert plc.read("Main.table[2000]") == 0

    has_no_limit = False
    """True if all that there is fits one request."""
