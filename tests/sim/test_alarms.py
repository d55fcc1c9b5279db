"""Alarms in the simulator; the rest of the promise is in tests/alarms.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from alarms import PROGRAM, Alarms

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
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
        simulator.run_cycles(1)
        yield simulator


def run(plc: Controller) -> None:
    assert isinstance(plc, Simulator)
    plc.run_cycles(1)


class TestSimulator(Alarms):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        run(plc)
        while not condition():
            run(plc)


def built_of(tmp_path: Path, text: str) -> BuildResult:
    (tmp_path / "app.st").write_text(text)
    return compile_sources([tmp_path / "app.st"])


def test_program_without_alarms_is_an_error_that_says_so(tmp_path: Path) -> None:
    built = built_of(tmp_path, "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM")
    with Simulator(built.image, built.symbols) as plc, pytest.raises(UsageError, match="no instances of ALARM"):
        plc.alarms()


def test_program_may_make_the_history_longer(tmp_path: Path) -> None:
    text = "VAR_GLOBAL CONSTANT ALARM_HISTORY_SIZE : UDINT := 100; END_VAR\n" + PROGRAM
    built = built_of(tmp_path, text)
    with Simulator(built.image, built.symbols) as plc:
        for n in range(60):
            plc.write({"Main.dry": n % 2 == 0})
            plc.run_cycles(1)
        assert len(plc.alarm_history().events) == 60


def test_new_program_keeps_the_history_and_does_not_know_alarms_that_are_gone(
    plc: Simulator, built: BuildResult, tmp_path: Path
) -> None:
    plc.write({"Main.dry": True, "Main.level": 90.0})
    plc.run_cycles(1)
    other = built_of(tmp_path, PROGRAM.replace("pump : Pump", "lift : Pump").replace("pump(", "lift("))
    plc.add_symbols(other.symbols)
    plc.flash(other.image)
    assert plc.alarm_history().count == 2
    names = sorted(event.name for event in plc.alarm_history().events)
    assert names[0].startswith("16#") and names[1] == "Main.high"


def test_delays_are_waited_for(tmp_path: Path) -> None:
    built = built_of(
        tmp_path,
        """PROGRAM Main
        VAR a : ALARM := (OnDelay := T#50ms, OffDelay := T#30ms, Class := ALARM_INFO); on : BOOL; END_VAR
        a(Condition := on);
        END_PROGRAM""",
    )
    with Simulator(built.image, built.symbols) as plc:
        plc.write({"Main.on": True})
        states = []
        for n in range(20):
            plc.write({"Main.on": n < 2 or 4 <= n < 12})
            plc.run_cycles(1)
            states.append(plc.read("Main.a.Active"))
    assert states == [False] * 9 + [True] * 6 + [False] * 5


def test_alarms_of_several_tasks_have_an_entry_each(tmp_path: Path) -> None:
    built = built_of(
        tmp_path,
        """PROGRAM One VAR a : ALARM; END_VAR a(Condition := NOT a.Condition); END_PROGRAM
        PROGRAM Two VAR b : ALARM; END_VAR b(Condition := NOT b.Condition); END_PROGRAM
        CONFIGURATION c RESOURCE r ON plc
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 1); TASK Slow(INTERVAL := T#3ms, PRIORITY := 2);
        PROGRAM One WITH Fast : One; PROGRAM Two WITH Slow : Two;
        END_RESOURCE END_CONFIGURATION""",
    )
    with Simulator(built.image, built.symbols) as plc:
        plc.run_for(ms=12)
        history = plc.alarm_history()
        assert history.count == len(history.events) > 12
        assert {event.name for event in history.events} == {"One.a", "Two.b"}
        assert plc.read("AlarmCounts.Open") == len(plc.alarms())


def test_program_may_have_variables_of_the_same_names(tmp_path: Path) -> None:
    text = "VAR_GLOBAL AlarmHistory, AlarmCounts, AlarmRun__ : INT := 7; END_VAR\n" + PROGRAM
    built = built_of(tmp_path, text)
    with Simulator(built.image, built.symbols) as plc:
        plc.write({"Main.dry": True})
        plc.run_cycles(2)
        assert plc.read("AlarmHistory") == 7
        assert [event.name for event in plc.alarm_history().events] == ["Main.pump"]
        assert plc.alarms()[0].age_s is not None
