"""An edge of a line of the board starts the task that waits for its event, on the virtual clock as on a board."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, messages

from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator

PROGRAM = """
PROGRAM Main
VAR a, b, c, d : BOOL; seen : INT; END_VAR
seen := BOOL_TO_INT(a) + BOOL_TO_INT(b) + BOOL_TO_INT(c) + BOOL_TO_INT(d);
END_PROGRAM
PROGRAM Counting
VAR n : INT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Board
    RESOURCE One ON PLC
        TASK Cyclic(INTERVAL := T#10ms, PRIORITY := 2);
        TASK OnRise(EVENT := 'rise', PRIORITY := 1);
        TASK OnFall(EVENT := 'fall', PRIORITY := 1);
        TASK OnBoth(EVENT := 'both', PRIORITY := 1);
        PROGRAM Main WITH Cyclic : Main;
        PROGRAM Rises WITH OnRise : Counting;
        PROGRAM Falls WITH OnFall : Counting;
        PROGRAM Both WITH OnBoth : Counting;
    END_RESOURCE
END_CONFIGURATION
"""
DESCRIPTION = """
[gpio.in]
DI0 = { var = "Main.a", event = "rise" }
DI1 = { var = "Main.b", event = "fall", edge = "falling", invert = true }
DI2 = { var = "Main.c", event = "both", edge = "both" }
DI3 = { var = "Main.d", event = "other" }
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return build(tmp_path_factory.mktemp("edges"), PROGRAM, DESCRIPTION)


@pytest.fixture
def plc(built: BuildResult) -> Simulator:
    with Simulator(built.image, built.symbols) as plc:
        yield plc  # type: ignore[misc]


def counted(plc: Simulator) -> list[int]:
    plc.run_cycles(1)
    return [plc.read(f"{name}.n") for name in ("Rises", "Falls", "Both")]


@pytest.mark.parametrize(
    ("line", "up", "down"),
    [("DI0", [1, 0, 0], [1, 0, 0]), ("DI1", [0, 0, 0], [0, 1, 0]), ("DI2", [0, 0, 1], [0, 0, 2])],
)
def test_the_edge_that_is_described_starts_the_task(plc: Simulator, line: str, up: list[int], down: list[int]) -> None:
    plc.set_input(line, True)
    assert counted(plc) == up
    plc.set_input(line, True)  # no edge
    assert counted(plc) == up
    plc.set_input(line, False)
    assert counted(plc) == down


def test_edges_between_two_cycles_are_a_run_each(plc: Simulator) -> None:
    for level in (True, False, True):
        plc.set_input("DI2", level)
    assert counted(plc) == [0, 0, 3]


def test_an_input_that_is_written_has_edges_too(plc: Simulator) -> None:
    plc.write({"Main.c": True})
    assert counted(plc) == [0, 0, 1]


def test_an_event_that_no_task_waits_for_does_nothing(plc: Simulator) -> None:
    plc.set_input("DI3", True)
    assert counted(plc) == [0, 0, 0]
    assert plc.read("Main.seen") == 1


def test_lines_that_are_not_there_have_no_edges(plc: Simulator) -> None:
    plc.fault("gpio", "absent")
    plc.set_input("DI0", True)
    assert counted(plc) == [0, 0, 0]
    plc.fault("gpio", "absent", 0)
    plc.set_input("DI0", False)
    plc.set_input("DI0", True)
    assert counted(plc) == [1, 0, 0]


@pytest.mark.parametrize(
    ("event", "hint"),
    [("other", ": write for example TASK Fast(EVENT := 'other')"), ("rize", "; did you mean rise?"),
     ("Rise", "; did you mean rise?")],
)  # fmt: skip
def test_event_that_no_task_waits_for_is_warned_of(tmp_path: Path, event: str, hint: str) -> None:
    found = messages(tmp_path, PROGRAM, DESCRIPTION.replace('"other"', f'"{event}"'))
    assert [m for m in found if "no task waits" in m] == [f"6: no task waits for the event '{event}'{hint}"]


def test_event_of_a_device_that_is_not_used_is_no_warning(tmp_path: Path) -> None:
    description = DESCRIPTION.replace("[gpio.in]", "[gpio]\nenabled = false\n[gpio.in]")
    assert not any("no task waits" in m for m in messages(tmp_path, PROGRAM, description))
