"""A power cut at each flash operation while a program saves a recipe and its alarms: the old state or the new one.

The other stores of the device have such a test in C: log kept (test_log_keep), retain variables (test_power_fail,
test_retain_sram, test_retain_file), settings (test_settings), files (test_iec_file, test_files).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pytest

from plctool.core import lib
from plctool.debug.alarms import AlarmEvent
from plctool.errors import PlcError
from plctool.sim import Simulator

PROGRAM = """
PROGRAM Main
VAR
    recipe : RECIPE_FILE;
    high : ALARM := (Text := 'too hot');
    save, hot : BOOL;
    temperature : DINT := 1;
END_VAR
VAR PERSISTENT
    kept : DINT;
END_VAR
high(Condition := hot);
recipe.Add('Main.temperature', temperature);
recipe(xSave := save, sFileName := 'green.csv');
kept := temperature;
END_PROGRAM
"""
HISTORY = 24
CHANGES = 2  # of the alarm, in a story


@pytest.fixture(scope="module")
def plc(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulator]:
    source = tmp_path_factory.mktemp("program") / "app.st"
    source.write_text(PROGRAM)
    with Simulator.from_sources(source) as plc:
        yield plc


def content(temperature: int) -> bytes:
    return f"name,type,value\nMain.temperature,DINT,{temperature}\n".encode()


def story(plc: Simulator, temperature: int) -> None:
    """Saves a recipe and two changes of an alarm; the device saves its variables once a second."""
    plc.write({"Main.temperature": temperature, "Main.hot": True, "Main.save": True})
    plc.run_for(700)
    plc.write({"Main.hot": False, "Main.save": False})
    plc.run_for(1300)


def is_old_or_new(before: Sequence[AlarmEvent], after: Sequence[AlarmEvent]) -> bool:
    """True if `after` is the history before with some of the changes at its end."""
    for new in range(CHANGES + 1):
        kept = (*before, *after[len(after) - new :])[-HISTORY:]
        if list(kept) == list(after):
            return True
    return False


@pytest.mark.parametrize("mode", [lib.SIM_CUT_BEFORE, lib.SIM_CUT_AFTER, lib.SIM_CUT_TORN])
def test_cut_at_each_operation_leaves_the_old_state_or_the_new_one(plc: Simulator, mode: int) -> None:
    story(plc, 1)
    temperature, cuts, finished = 1, 0, False
    while not finished:
        before = plc.alarm_history().events
        plc._lib.SimFlashCut(cuts + 1, mode)
        try:
            story(plc, temperature + 1)
            finished = True
        except PlcError:
            cuts += 1
        plc.restart()
        plc.run_cycles(2)
        assert plc.files()["green.csv"] in (content(temperature), content(temperature + 1))
        assert is_old_or_new(before, plc.alarm_history().events), f"cut {cuts}"
        story(plc, temperature := temperature + 2)  # the device goes on: all of it is saved again
        assert plc.files()["green.csv"] == content(temperature)
    assert cuts > 50
