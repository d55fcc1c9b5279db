"""Online changes in the simulator, and what holds for any of them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
from shares import share

sys.path.append(str(Path(__file__).parents[1]))

import many_changes
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


@pytest.mark.parametrize("seed", share(range(10), 3))
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


def test_member_that_moves_between_two_others_keeps_its_value(tmp_path: Path) -> None:
    """`a` and `b` stay as far from each other as they were; `m` is where nothing was between them."""
    block = "FUNCTION_BLOCK Block VAR {} END_VAR m := m; a := a; b := b; END_FUNCTION_BLOCK\n"
    members = "m : DINT := 51; removed : DINT; a : SINT := 36; b : LINT := 8;", "a : SINT; m : DINT; b : LINT;"
    texts = [program("block();", "VAR block : Block; END_VAR", block.format(text)) for text in members]
    result = built(tmp_path, texts[0])
    with Simulator(result.image, result.symbols) as plc:
        plc.run_for(20)
        result = built(tmp_path, texts[1], result.symbols)
        plc.add_symbols(result.symbols)
        plc.change(result.image)
        assert plc.read("Main.block") == {"a": 36, "m": 51, "b": 8}


def test_many_changes_in_a_row_lose_nothing(tmp_path: Path) -> None:
    """10 000 of them: make changes."""
    summary = many_changes.run(tmp_path, 12, 5)
    assert summary.changes == 12 and summary.room < 3


TASKS = """PROGRAM Main VAR n : DINT; go : BOOL; END_VAR n := n + 1; END_PROGRAM
PROGRAM Other VAR n : DINT; END_VAR n := n + 1; END_PROGRAM
PROGRAM Waits VAR n : DINT; END_VAR n := n + 1; END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
{tasks}
END_RESOURCE END_CONFIGURATION
"""
FAST = "TASK Fast(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH Fast : Main;"
SLOW = "TASK Slow(INTERVAL := T#20ms, PRIORITY := 5); PROGRAM Other WITH Slow : Other;"
EVENT = "TASK Event(SINGLE := Main.go, PRIORITY := 2); PROGRAM Waits WITH Event : Waits;"


def test_tasks_come_go_and_change_while_the_others_go_on(tmp_path: Path) -> None:
    result = built(tmp_path, TASKS.format(tasks=FAST + SLOW))
    with Simulator(result.image, result.symbols) as plc:

        def change(tasks: str) -> list[str]:
            result = built(tmp_path, TASKS.format(tasks=tasks), plc.symbols())
            assert result.change is not None and result.change.problems == []
            plc.add_symbols(result.symbols)
            plc.change(result.image)
            return result.change.tasks

        plc.run_for(100)
        cycles = plc.tasks()[0].cycles
        assert change(FAST + SLOW.replace("20ms", "50ms") + EVENT) == [
            "Slow: interval 20000, now 50000",
            "Event is new",
        ]
        other = plc.read("Other.n")
        plc.run_for(200)
        fast, slow, event = plc.tasks()
        assert (fast.cycles, fast.overruns) == (cycles + 20, 0)
        assert (slow.cycles, slow.interval_us, event.cycles) == (4, 50000, 0)
        assert plc.read("Other.n") == other + 4
        plc.write({"Main.go": True})
        plc.run_for(30)
        assert plc.read("Waits.n") == 1
        plc.write({"Main.go": False})
        plc.run_for(30)
        plc.write({"Main.go": True})
        changed = change(FAST + EVENT)  # an event that waits is lost with the task at that place
        assert changed == ["Event begins again, since its place among the tasks changes", "Slow is removed"]
        n = plc.read("Main.n")
        plc.run_for(100)
        assert [task.name for task in plc.tasks()] == ["Fast", "Event"]
        assert plc.read("Main.n") == n + 10
        assert change(SLOW.replace("PRIORITY := 5", "PRIORITY := 0"))[-2:] == ["Fast is removed", "Event is removed"]
        plc.run_for(100)
        assert [(task.name, task.priority, task.cycles) for task in plc.tasks()] == [("Slow", 0, 5)]
        assert plc.read("Other.n") == 5
        change(FAST + SLOW + EVENT)
        plc.run_for(100)
        assert (plc.read("Main.n"), plc.read("Other.n")) == (10, 10)
        assert not any(task.overruns for task in plc.tasks())
