"""In whose cycle a channel is read or written."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, configuration

PROGRAM = """\
VAR_GLOBAL a, b, c, unused, go : BOOL; x, y : BOOL; END_VAR
PROGRAM One
x := a AND c;
END_PROGRAM
PROGRAM Two
y := b OR c;
END_PROGRAM
PROGRAM Three
VAR n : INT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION C
TASK Slow(INTERVAL := T#20ms, PRIORITY := 3);
TASK Fast(INTERVAL := T#5ms, PRIORITY := 1);
TASK Waiting(SINGLE := go, PRIORITY := 2);
PROGRAM P1 WITH Slow : One;
PROGRAM P2 WITH Fast : Two;
PROGRAM P3 WITH Waiting : Three;
END_CONFIGURATION
"""
DESCRIPTION = """\
[sim]
name = "Bench"
in = { a = "a", b = "b", c = "c", unused = "unused", go = "go" }
out = { x = "x", y = "y" }
"""


@pytest.fixture(scope="module")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    built = build(tmp_path_factory.mktemp("io"), PROGRAM, DESCRIPTION)
    return {c["channel"]: c["tasks"] for c in built.symbols.io["channels"]}


def test_task_that_uses_a_channel_reads_or_writes_it(tasks: dict[str, list[str]]) -> None:
    assert (tasks["a"], tasks["b"], tasks["x"], tasks["y"]) == (["Slow"], ["Fast"], ["Slow"], ["Fast"])


def test_channel_of_two_tasks_is_read_by_both(tasks: dict[str, list[str]]) -> None:
    assert tasks["c"] == ["Slow", "Fast"]


def test_channel_that_no_task_uses_belongs_to_the_bus_cycle(tasks: dict[str, list[str]]) -> None:
    assert tasks["unused"] == ["Fast"]


def test_input_that_starts_a_task_is_read_by_the_bus_cycle(tasks: dict[str, list[str]]) -> None:
    assert tasks["go"] == ["Fast"]


def test_task_of_the_bus_cycle_is_that_of_the_description(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION.replace("[sim]", "[sim]\ntask = 'slow'"))
    assert configuration(built).connectors[0].bus_task == 0
    assert next(c["tasks"] for c in built.symbols.io["channels"] if c["channel"] == "unused") == ["Slow"]


def test_age_is_that_of_the_slowest_task(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    ages = {c["channel"]: c["age_us"] for c in built.symbols.io["channels"]}
    assert (ages["b"], ages["c"]) == (5000, 20000)


def test_connectors_of_one_driver_are_next_to_each_other(tmp_path: Path) -> None:
    program = (
        "VAR_GLOBAL a, b, c : BOOL; END_VAR\nPROGRAM Main\nVAR n : BOOL; END_VAR\nn := a OR b OR c;\nEND_PROGRAM\n"
    )
    text = "[[sim]]\nname = 'S1'\nin = { a = 'a' }\n[[sim]]\nname = 'S2'\nin = { a = 'c' }\n[gpio]\nin = { b = 'b' }\n"
    built = build(tmp_path, program, text)
    found = configuration(built)
    drivers = [found.connectors[m.connector].driver for m in found.task_maps[0].connectors]
    assert sorted(drivers) == drivers or sorted(drivers, reverse=True) == drivers
    assert len(drivers) == 3
