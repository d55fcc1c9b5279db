"""Values that go from task to task, in the simulator; the promise is in tests/task_links.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from online_programs import built
from task_links import PROGRAM, TaskLinks

from plctool.controller import Controller
from plctool.sim import Simulator


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    result = built(tmp_path, PROGRAM)
    with Simulator(result.image, result.symbols) as simulator:
        yield simulator


class TestSimulator(TaskLinks):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        while not condition():
            plc.run_for(10, check=False)


def test_the_destination_has_what_the_source_had_after_its_cycle(plc: Simulator) -> None:
    plc.run_for(1)  # Show began after Control
    plc.run_for(6)  # Control ran at 2, 4 and 6 ms
    assert plc.read("Control.values.a", "Show.n") == {"Control.values.a": 4, "Show.n": 1}
    plc.run_for(1)
    assert plc.read("Show.n") == 4


def test_an_online_change_leads_the_links_to_where_the_variables_are_then(plc: Simulator, tmp_path: Path) -> None:
    plc.run_for(50)
    place = plc.symbols().variables["Show.values"].offset
    larger = PROGRAM.replace("f, g, h : DINT;", "f, g, h : DINT; more : ARRAY[1..9] OF LREAL;")
    changed = built(tmp_path, larger, plc.symbols())
    assert changed.symbols.variables["Show.values"].offset != place
    assert changed.change is not None and changed.change.problems == []
    plc.add_symbols(changed.symbols)
    plc.change(changed.image)
    n = plc.read("Show.n")
    plc.run_for(50)
    assert plc.read("Show.n") > n + 10
    assert plc.read("Show.torn") == 0
