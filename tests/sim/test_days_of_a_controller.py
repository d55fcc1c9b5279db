"""Days of a controller with all that happens to it: downloads, resets, power cuts, exceptions, starts and stops.

Whatever happens, and in which order, each variable has the value that the table in docs/language.md promises, and each
task has run all its cycles.
"""

from __future__ import annotations

from functools import cache

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from kept_table import table

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import BuildResult, build_program
from plctool.image.targets import DEFAULT_TARGET, find_target
from plctool.link.services import AppState
from plctool.sim import Simulator

CYCLE = 100  # ms
SAVED_AFTER = 2500  # ms: twice the time between two savings of retain variables, and some
INITIAL = 7
NAMES = {"VAR": "Main.plain", "RETAIN": "Main.retained", "PERSISTENT": "Main.lasting"}
TABLE = {(event, kind): cell == "kept" for event, kind, cell in table()}

PROGRAM = """
FUNCTION Seven : DINT
Seven := 7;
END_FUNCTION
PROGRAM Main
VAR {more} cycles : UDINT; trip : BOOL; zero : DINT; started : DINT := Seven(); END_VAR
VAR {more} plain : DINT := 7; END_VAR
VAR RETAIN {more} retained : DINT := 7; END_VAR
VAR PERSISTENT {more} lasting : DINT := 7; END_VAR
cycles := cycles + 1;
IF trip THEN zero := 1 / zero; END_IF
END_PROGRAM
CONFIGURATION Plant
TASK T(INTERVAL := T#100ms);
PROGRAM Main WITH T : Main;
END_CONFIGURATION
"""


@cache
def built(number: int, *, fails: bool = False) -> BuildResult:
    """One of several programs with the same variables in other places. `fails`: its initialisation does."""
    more = "".join(f"more{i} : LINT; " for i in range(number))
    sections = iter(f"{more.replace('more', f'{section}_')}" for section in "abcd")
    text = "".join(part + next(sections, "") for part in PROGRAM.split("{more}"))
    text = text.replace("Seven := 7", "Seven := Seven / Seven") if fails else text
    checked = check_sources([Source("days.st", text)])
    assert checked.program is not None, checked.diagnostics
    return build_program(checked.program, Options(find_target(DEFAULT_TARGET), 2))


class Days(RuleBasedStateMachine):
    """`values`: of each kind of variable what may be saved, and last what it is. `initialised`: a program that failed
    before is not, after a power cut, until it is started."""

    @initialize()
    def begin(self) -> None:
        first = built(0)
        self.plc = Simulator(first.image, first.symbols)
        self.values = {kind: [INITIAL] for kind in NAMES}
        self.number = self.cycles = 0
        self.is_first_run = True
        self.initialised = True

    def teardown(self) -> None:
        if hasattr(self, "plc"):
            self.plc.close()

    @property
    def state(self) -> AppState:
        return self.plc.status().state

    def is_running(self) -> bool:
        return hasattr(self, "plc") and self.state is AppState.RUN

    def happens(self, event: str) -> None:
        """Takes over what the table says of an event."""
        for kind in NAMES:
            if not TABLE[event, kind]:
                self.values[kind] = [INITIAL]
        if not TABLE[event, "VAR"]:
            self.cycles = 0
        self.is_first_run = True

    def saved(self) -> None:
        self.values = {kind: known[-1:] for kind, known in self.values.items()}

    # ---- what happens ----

    @rule(ms=st.integers(1, 12 * 3600 * 1000 // CYCLE).map(CYCLE.__mul__))
    def time_passes(self, ms: int) -> None:
        was_running = self.is_running()
        self.plc.run_for(ms)
        if was_running:
            now = self.plc.read("Main.cycles")
            assert now - self.cycles - ms // CYCLE in ((0, 1) if self.is_first_run else (0,))
            self.cycles, self.is_first_run = now, False
        if ms >= SAVED_AFTER:
            self.saved()

    @rule(kind=st.sampled_from(sorted(NAMES)), value=st.integers(-(2**31), 2**31 - 1))
    def a_tool_writes(self, kind: str, value: int) -> None:
        self.plc.write({NAMES[kind]: value})
        self.values[kind].append(value)

    @precondition(is_running)
    @rule()
    def stop_and_start(self) -> None:
        self.stop()
        self.start()
        self.happens("stop, start")

    @precondition(is_running)
    @rule()
    def stop(self) -> None:
        self.plc.stop()
        self.saved()

    @precondition(lambda self: hasattr(self, "plc") and self.state is AppState.STOP)
    @rule()
    def start(self) -> None:
        self.plc.start()
        self.is_first_run = True
        if not self.initialised:
            self.values["VAR"], self.cycles, self.initialised = [INITIAL], 0, True

    @rule(option=st.sampled_from(("warm", "cold")), start=st.booleans())
    def reset(self, option: str, start: bool) -> None:
        self.plc.reset(option)
        self.happens(f"reset {option}")
        self.initialised = True
        if start and self.state is not AppState.RUN:
            self.start()

    @precondition(is_running)
    @rule()
    def the_program_fails(self) -> None:
        self.plc.write({"Main.trip": True})
        self.plc.run_cycles(2, check=False)
        assert self.state is AppState.EXCEPTION
        self.plc.reset("warm")
        self.happens("exception, reset warm")

    @rule()
    def the_power_fails(self) -> None:
        before = {kind: list(known) for kind, known in self.values.items()}
        assert self.plc._core.lib.SimStart() == self.plc._core.lib.ERR_OK
        self.happens("power off and on")
        for kind in ("RETAIN", "PERSISTENT"):
            seen = self.plc.read(NAMES[kind])
            assert seen in before[kind]
            self.values[kind] = [seen]
        self.initialised = self.state is AppState.RUN

    @rule()
    def the_power_fails_with_a_warning(self) -> None:
        self.plc.restart()
        self.happens("power off and on")
        self.saved()
        self.initialised = self.state is AppState.RUN

    @rule(further=st.integers(1, 3), start=st.booleans())
    def download(self, further: int, start: bool) -> None:
        self.number = (self.number + further) % 4
        program = built(self.number)
        self.plc.flash(program.image, start=start)
        self.plc.add_symbols(program.symbols)
        self.happens("download")
        self.saved()
        self.initialised = True

    @precondition(is_running)
    @rule(number=st.integers(0, 3))
    def a_download_fails_and_is_rolled_back(self, number: int) -> None:
        self.plc.run_for(SAVED_AFTER)  # the program is one that has run
        crc = self.plc.status().image_crc
        self.plc.flash(built(number, fails=True).image, start=False)
        assert self.state is AppState.EXCEPTION
        assert self.plc._core.lib.SimStart() == self.plc._core.lib.ERR_OK
        assert self.plc.status().image_crc == crc
        self.happens("download, rolled back")

    # ---- what is always true ----

    @invariant()
    def the_values_are_those_of_the_table(self) -> None:
        if not hasattr(self, "plc"):
            return
        for kind, name in NAMES.items():
            if self.initialised or kind != "VAR":
                assert self.plc.read(name) == self.values[kind][-1], kind
        assert not self.initialised or self.plc.read("Main.started") == INITIAL


@pytest.mark.hypothesis
def test_nothing_is_lost_whatever_happens() -> None:
    shorter = settings(max_examples=max(settings().max_examples // 4, 8), stateful_step_count=40, deadline=None)
    run_state_machine_as_test(Days, settings=shorter)
