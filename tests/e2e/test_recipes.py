"""Recipes on plcrt; the rest of the promise is in tests/recipes.py."""

from __future__ import annotations

import random
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from recipes import PROGRAM, Recipes

from plctool import connect
from plctool.device import Plc
from plctool.errors import PlcError
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

CUTS = 8


@pytest.fixture
def image(tool) -> Path:
    return tool.build("recipes", PROGRAM)


@pytest.fixture
def plc(plcrt: Plcrt, image: Path) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(Recipes):
    pass


def test_power_cut_leaves_one_recipe_or_the_other(plc: Plc, plcrt: Plcrt, image: Path, tmp_path: Path) -> None:
    """The values are RETAIN, and go to the controller in one request."""
    two = [tmp_path / "one.json", tmp_path / "two.json"]
    plc.save_recipe(two[0], ["Main.tea"])
    plc.write({"Main.tea.temperature": 1.5, "Main.tea.cups": 12, "Main.tea.label": "two", "Main.tea.flags": 0xFFFF})
    plc.save_recipe(two[1], ["Main.tea"])
    kept = [plc.check_recipe(file) for file in two]
    chance = random.Random(37)
    seen = set()
    for _ in range(CUTS):
        with connect(f"tcp:{plcrt.tcp}") as again:
            for n in range(chance.randrange(1, 120)):
                assert again.load_recipe(two[n % 2]).together
        plcrt.stop(signal.SIGKILL)
        plcrt.start()
        with connect(f"tcp:{plcrt.tcp}") as again:
            eventually(lambda again=again: str(again.status().state) == "run")
            found = again.recipe(["Main.tea"]).texts
        texts = [{fitting.name: fitting.text for fitting in fittings} for fittings in kept]
        assert found in texts
        seen.add(texts.index(found))
    assert seen  # which of them is a matter of time


def test_commands_save_compare_load_and_list(plc: Plc, plcrt: Plcrt, image: Path, tool) -> None:
    link = ["--tcp", plcrt.tcp]
    assert tool("recipe", "save", "tea.csv", "Main.tea.*", *link).out == "tea.csv: 6 values\n"
    tool.ok("write", "Main.tea.cups=7", *link)
    done = tool("recipe", "diff", "tea.csv", *link)
    assert (done.status, done.out) == (1, "Main.tea.cups: 7 -> 2\n")
    assert tool.ok("recipe", "check", "tea.csv", "--image", str(image))["values"]["Main.tea.cups"] == "2"
    assert len(tool.ok("recipe", "check", "tea.csv", "*.cups", *link)["values"]) == 1
    document = tool.ok("recipe", "load", "tea.csv", "--then", "Main.take_over=TRUE", *link)
    assert document["changed"] == [{"name": "Main.tea.cups", "now": "7", "recipe": "2"}]
    assert tool("recipe", "diff", "tea.csv", *link).out == "no differences\n"
    assert "6 values written, 0 changed" in tool("recipe", "load", "tea.csv", *link).out
    assert "Main.tea.steep        TIME" in tool("recipe", "list", "tea.csv").out


def test_recipe_that_does_not_fit_exits_with_two(plc: Plc, plcrt: Plcrt, tool, tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text('{"recipe": {"Main.tea.cups": 99}}')
    done = tool("recipe", "load", "bad.json", "--tcp", plcrt.tcp)
    assert done.status == 2 and "1 value does not fit the program. Main.tea.cups: '99' is not a value of" in done.err
    done = tool("recipe", "save", "new.json", "--tcp", plcrt.tcp)
    assert done.status == 2 and "Name what new.json is to have" in done.err
    done = tool("recipe", "save", "new.txt", "Main.tea", "--tcp", plcrt.tcp)
    assert done.status == 2 and "new.txt is neither .json nor .csv" in done.err
    with pytest.raises(PlcError, match="no value for Main"):
        plc.load_recipe((plc.recipe(["Main.tea"])).only(["Main.x"]))
