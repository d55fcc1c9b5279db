"""Online changes in the simulator, and what holds for any of them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from changing import Changing, program
from online_programs import built, carried, edited, random_source

from plctool import Simulator
from plctool.controller import Controller


class TestSimulator(Changing):
    @pytest.fixture
    def plc(self, tmp_path: Path) -> Iterator[Simulator]:
        result = built(tmp_path, program())
        with Simulator(result.image, result.symbols) as plc:
            plc.run_for(50)
            yield plc

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        for _ in range(100):
            plc.run_for(10, check=False)
            if condition():
                return
        raise AssertionError("it does not come")


def values(plc: Simulator) -> dict[str, Any]:
    """All but pointers."""
    names = [name for name in plc.symbols().variables if not name.startswith("Main.to")]
    return plc.read_all(names)


def write_all(plc: Simulator, written: dict[str, Any]) -> None:
    for name, value in written.items():
        if isinstance(value, dict):
            write_all(plc, {f"{name}.{member}": part for member, part in value.items()})
        elif isinstance(value, list):
            write_all(plc, {f"{name}[{index}]": part for index, part in enumerate(value, 1)})
        else:
            plc.write({name: value})


@pytest.mark.parametrize("seed", range(10))
def test_a_changed_program_behaves_as_one_that_began_with_these_values(seed: int, tmp_path: Path) -> None:
    """Any program and any edit: what both have keeps its value, new ones have their initial values, pointers lead to
    the same variables; and from then on it does what a download would do that is given these values."""
    random = Random(seed)
    source = random_source(random)
    result = built(tmp_path, source.text)
    with Simulator(result.image, result.symbols) as plc:
        for n in range(3):
            plc.run_for(10 * random.randrange(1, 9))
            before, had = values(plc), source.types
            source = edited(random, source, 100 * (n + 1))
            result = built(tmp_path, source.text, result.symbols)
            plc.add_symbols(result.symbols)
            plc.change(result.image)
            now = values(plc)
            (tmp_path / "fresh").mkdir(exist_ok=True)
            fresh = built(tmp_path / "fresh", source.text)
            with Simulator(fresh.image, fresh.symbols, start=False) as other:
                other.restart()
                initial = values(other)
                assert now == {
                    name: carried(name.removeprefix("Main."), before[name], value, had, source.types)
                    if name in before
                    else value
                    for name, value in initial.items()
                }
                write_all(other, now)
                assert values(other) == now
                other.start()
                plc.run_for(100)
                other.run_for(100)
                assert values(plc)["Main.block"] == values(other)["Main.block"]
                assert plc.read("Main.to^") == plc.read("Main.cycles")
            for line in source.lines:
                place = f"Main.{line.name}" + "[1]" * ("ARRAY" in line.type)
                assert plc.read(f"Main.to_{line.name}^") == plc.read(place)


def test_ten_changes_in_a_row_lose_no_cycle(tmp_path: Path) -> None:
    text = program("n := n + 1;")
    result = built(tmp_path, text)
    with Simulator(result.image, result.symbols) as plc:
        for n in range(10):
            plc.run_for(20)
            result = built(tmp_path, text.replace("n := n + 1;", f"n := n + 1; fixed := {n};"), result.symbols)
            plc.add_symbols(result.symbols)
            plc.change(result.image)
        plc.run_for(20)
        assert plc.read("Main.n") == plc.tasks()[0].cycles == 11 * 4
        assert plc.tasks()[0].overruns == 0
