"""Alarms on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from plctool.controller import Controller
from plctool.debug.alarms import Alarm, AlarmEvent
from plctool.errors import UsageError
from plctool.testing.waiting import eventually

PROGRAM = """
VAR_GLOBAL CONSTANT
    FIRE : ALARM_CLASS := (Name := 'fire', Priority := 1, Rule := ALARM_RULE.LATCHED);
END_VAR
FUNCTION_BLOCK Pump EXTENDS ALARM
VAR_INPUT dry : BOOL; END_VAR
SUPER^(Condition := dry, Class := ALARM_INFO, Text := 'pump runs dry');
END_FUNCTION_BLOCK
TYPE Tank : STRUCT low : ALARM := (Class := ALARM_WARNING, Text := 'low'); level : REAL := 50.0; END_STRUCT; END_TYPE
PROGRAM Main
VAR
    high : ALARM := (Text := 'too high');
    fire : ALARM := (Class := FIRE, Text := 'hot');
    tanks : ARRAY[1..2] OF Tank;
    pump : Pump;
    hot, dry, button, quiet, day : BOOL;
    level : REAL;
    i : INT;
END_VAR
VAR RETAIN kept : ALARM := (Text := 'kept'); fault : BOOL; END_VAR
IF day THEN ALARM_CLOCK(DT#2026-11-28-12:00:00); END_IF
high(Condition := level > 80.0, Acknowledge := button, Suppress := quiet);
fire(Condition := hot);
kept(Condition := fault);
FOR i := 1 TO 2 DO
    tanks[i].low(Condition := tanks[i].level < 10.0);
END_FOR
pump(dry := dry);
END_PROGRAM
"""
EACH_CYCLE = """
PROGRAM Main
VAR a : ALARM := (Class := ALARM_INFO); END_VAR
VAR PERSISTENT events : DINT; END_VAR
a(Condition := NOT a.Condition);
events := events + 1;
END_PROGRAM
"""
"""Has an event in each cycle, and counts them."""


def check_one_moment(plc: Controller) -> int:
    """Checks that the history and another kept value are of the same moment. Returns the number of events."""
    eventually(lambda: str(plc.raw_status().state) == "run" and plc.read("Main.events") > 0)
    reading = plc.sample(["AlarmHistory.Count", "Main.events"])
    assert reading.consistent and reading.values["AlarmHistory.Count"] == reading.values["Main.events"]
    history = plc.alarm_history()
    kinds = [event.state for event in history.events if event.start == history.events[-1].start]
    assert kinds[::2] == kinds[:1] * len(kinds[::2]) and kinds[1::2] == kinds[1:2] * len(kinds[1::2])
    return history.count


ALL = ["Main.fire", "Main.high", "Main.kept", "Main.pump", "Main.tanks[1].low", "Main.tanks[2].low"]


class Alarms:
    """The fixture `plc` is a controller that runs PROGRAM."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def state(self, plc: Controller, name: str) -> str:
        return next(alarm.state for alarm in plc.alarms(all=True) if alarm.name == name)

    def reach(self, plc: Controller, name: str, state: str) -> None:
        self.wait(plc, lambda: self.state(plc, name) == state)

    def acknowledge(self, plc: Controller, *names: str) -> None:
        assert plc.acknowledge(names) == list(names)
        self.wait(plc, lambda: not plc.unconfirmed(names))

    def changes(self, plc: Controller, name: str) -> list[str]:
        return [event.state for event in plc.alarm_history().events if event.name == name]

    def test_all_alarms_of_a_program_are_found_wherever_they_are(self, plc: Controller) -> None:
        alarms = {alarm.name: alarm for alarm in plc.alarms(all=True)}
        assert sorted(alarms) == ALL
        assert plc.alarms() == []
        low = alarms["Main.tanks[2].low"]
        assert (low.state, low.text, low.class_name, low.priority) == ("NORMAL", "low", "warning", 2)

    def test_alarm_is_acknowledged_before_its_condition_ends(self, plc: Controller) -> None:
        plc.write({"Main.level": 90.0})
        self.reach(plc, "Main.high", "UNACKNOWLEDGED")
        assert plc.read("AlarmCounts") == {"Open": 1, "Waiting": 1}
        self.acknowledge(plc, "Main.high")
        self.reach(plc, "Main.high", "ACKNOWLEDGED")
        assert plc.read("AlarmCounts") == {"Open": 1, "Waiting": 0}
        plc.write({"Main.level": 20.0})
        self.reach(plc, "Main.high", "NORMAL")
        assert self.changes(plc, "Main.high") == ["UNACKNOWLEDGED", "ACKNOWLEDGED", "NORMAL"]
        assert plc.read("AlarmCounts") == {"Open": 0, "Waiting": 0}

    def test_alarm_waits_for_its_acknowledgement_after_its_condition_has_ended(self, plc: Controller) -> None:
        plc.write({"Main.tanks[1].level": 5.0})
        self.reach(plc, "Main.tanks[1].low", "UNACKNOWLEDGED")
        plc.write({"Main.tanks[1].level": 50.0})
        self.reach(plc, "Main.tanks[1].low", "RETURNED")
        plc.write({"Main.tanks[1].level": 5.0})
        self.reach(plc, "Main.tanks[1].low", "UNACKNOWLEDGED")
        plc.write({"Main.tanks[1].level": 50.0})
        self.reach(plc, "Main.tanks[1].low", "RETURNED")
        self.acknowledge(plc, "Main.tanks[1].low")
        self.reach(plc, "Main.tanks[1].low", "NORMAL")

    def test_latched_alarm_is_acknowledged_again_after_its_condition(self, plc: Controller) -> None:
        plc.write({"Main.hot": True})
        self.reach(plc, "Main.fire", "UNACKNOWLEDGED")
        self.acknowledge(plc, "Main.fire")
        self.reach(plc, "Main.fire", "ACKNOWLEDGED")
        plc.write({"Main.hot": False})
        self.reach(plc, "Main.fire", "RETURNED")
        self.acknowledge(plc, "Main.fire")
        self.reach(plc, "Main.fire", "NORMAL")

    def test_message_needs_no_acknowledgement(self, plc: Controller) -> None:
        plc.write({"Main.dry": True})
        self.reach(plc, "Main.pump", "ACKNOWLEDGED")
        assert plc.acknowledge(["Main.pump"]) == []
        plc.write({"Main.dry": False})
        self.reach(plc, "Main.pump", "NORMAL")

    def test_button_of_the_machine_acknowledges_when_it_is_pressed(self, plc: Controller) -> None:
        plc.write({"Main.button": True})
        plc.write({"Main.level": 90.0})
        self.reach(plc, "Main.high", "UNACKNOWLEDGED")
        plc.write({"Main.button": False})
        self.wait(plc, lambda: not plc.read("Main.high.Acknowledge"))
        assert self.state(plc, "Main.high") == "UNACKNOWLEDGED"
        plc.write({"Main.button": True})
        self.reach(plc, "Main.high", "ACKNOWLEDGED")

    def test_suppressed_alarm_is_not_shown_until_it_counts_again(self, plc: Controller) -> None:
        plc.write({"Main.level": 90.0, "Main.quiet": True})
        self.reach(plc, "Main.high", "SUPPRESSED")
        assert plc.alarms() == []
        plc.write({"Main.quiet": False})
        self.reach(plc, "Main.high", "UNACKNOWLEDGED")

    def test_what_waits_comes_first_then_the_highest_priority(self, plc: Controller) -> None:
        plc.write({"Main.dry": True, "Main.tanks[2].level": 0.0, "Main.hot": True, "Main.level": 90.0})
        self.wait(plc, lambda: len(plc.alarms()) == 4)
        order = ["Main.fire", "Main.high", "Main.tanks[2].low", "Main.pump"]
        assert [alarm.name for alarm in plc.alarms()] == order
        assert plc.acknowledge(["*.fire", "main.TANKS[2]*"]) == ["Main.fire", "Main.tanks[2].low"]
        self.wait(plc, lambda: [a.name for a in plc.alarms() if a.waits] == ["Main.high"])
        with pytest.raises(UsageError, match="no alarm Main"):
            plc.acknowledge(["Main.low"])
        assert plc.acknowledge() == ["Main.high"]

    def test_events_have_the_time_of_day_when_the_program_knows_it(self, plc: Controller) -> None:
        plc.write({"Main.dry": True})
        self.reach(plc, "Main.pump", "ACKNOWLEDGED")
        plc.write({"Main.day": True})
        self.wait(plc, lambda: plc.read("AlarmRun__.Epoch"))
        plc.write({"Main.level": 90.0})
        self.reach(plc, "Main.high", "UNACKNOWLEDGED")
        first, second = plc.alarm_history().events
        assert first.at is None and first.time_s < 1e8
        assert second.at is not None and second.at.isoformat().startswith("2026-11-28T12:0")
        alarms: dict[str, Alarm] = {alarm.name: alarm for alarm in plc.alarms()}
        assert alarms["Main.high"].since == second.at and alarms["Main.pump"].since is None
        assert (alarms["Main.pump"].age_s or 0) > 0

    def test_history_keeps_the_newest_events(self, plc: Controller) -> None:
        for _ in range(15):
            plc.write({"Main.dry": True})
            self.reach(plc, "Main.pump", "ACKNOWLEDGED")
            plc.write({"Main.dry": False})
            self.reach(plc, "Main.pump", "NORMAL")
        history = plc.alarm_history()
        assert (history.count, len(history.events)) == (30, 24)
        assert [event.state for event in history.events] == ["ACKNOWLEDGED", "NORMAL"] * 12
        times = [event.time_s for event in history.events]
        assert times == sorted(times)

    def make_events(self, plc: Controller) -> list[AlarmEvent]:
        """A history of two events, and a kept alarm that waits."""
        plc.write({"Main.fault": True, "Main.level": 90.0})
        self.wait(plc, lambda: len(plc.alarms()) == 2)
        return plc.alarm_history().events

    def test_history_and_retain_alarms_outlast_a_reset(self, plc: Controller) -> None:
        before = self.make_events(plc)
        plc.reset("warm")
        plc.start()
        self.reach(plc, "Main.kept", "UNACKNOWLEDGED")
        assert plc.alarm_history().events == before
        assert plc.read("AlarmCounts") == {"Open": 1, "Waiting": 1}
        plc.write({"Main.level": 90.0})
        self.reach(plc, "Main.high", "UNACKNOWLEDGED")
        assert [event.start for event in plc.alarm_history().events] == [1, 1, 2]
