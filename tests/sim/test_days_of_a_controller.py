"""Days of a controller with all that happens to it: downloads, resets, power cuts, exceptions, starts and stops, under
each start policy, and with a program that denies and forbids some of that.

Whatever happens, and in which order, each variable has the value that the table in docs/language.md promises, and each
task has run all its cycles. What is refused changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

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
from plctool.core import lib
from plctool.errors import DeviceError
from plctool.image.targets import DEFAULT_TARGET, find_target
from plctool.link.services import AppState
from plctool.sim import Simulator

CYCLE = 100  # ms
HOUR = 3600 * 1000 // CYCLE  # cycles
SAVED_AFTER = 2500  # ms: twice the time between two savings of retain variables, and some
PROVEN_AFTER = 5000  # ms: longer than a new program takes to prove itself
INITIAL = 7
NAMES = {"VAR": "Main.plain", "RETAIN": "Main.retained", "PERSISTENT": "Main.lasting"}
TABLE = {(event, kind): cell == "kept" for event, kind, cell in table()}

DENIED = ("DenyStart", "DenyStop", "DenyStartBootproject", "PrepareDownload")
FORBIDDEN = ("Download", "Stop", "Reset")
POLICIES = ("always", "never", "clean")
LAST_HOURS = 8  # of an example whose program runs
HOURS = 72  # of virtual time that pass at least, in all examples together

PROGRAM = """
VAR_GLOBAL PERSISTENT denied : WORD; END_VAR
VAR_GLOBAL forbidden : WORD; END_VAR
{functions}
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
{forbids}
END_PROGRAM
CONFIGURATION Plant
TASK T(INTERVAL := T#100ms);
PROGRAM Main WITH T : Main;
END_CONFIGURATION
"""
FUNCTION = """
{{attribute 'call_on' := 'EVT_{event}'}}
FUNCTION On{event} : BOOL
On{event} := denied.{bit};
EventSetReason('{event}');
END_FUNCTION
"""
FUNCTIONS = "".join(FUNCTION.format(event=event, bit=bit) for bit, event in enumerate(DENIED))
FORBIDS = "".join(
    f"PlcOperationControlInstance.xDisableApplication{name} := forbidden.{bit};\n" for bit, name in enumerate(FORBIDDEN)
)


@cache
def built(number: int, *, fails: bool = False) -> BuildResult:
    """One of several programs with the same variables in other places. `fails`: its initialisation does."""
    more = "".join(f"more{i} : LINT; " for i in range(number))
    sections = iter(f"{more.replace('more', f'{section}_')}" for section in "abcd")
    text = "".join(part + next(sections, "") for part in PROGRAM.split("{more}"))
    text = text.replace("{functions}", FUNCTIONS).replace("{forbids}", FORBIDS)
    text = text.replace("Seven := 7", "Seven := Seven / Seven") if fails else text
    checked = check_sources([Source("days.st", text)])
    assert checked.program is not None, checked.diagnostics
    return build_program(checked.program, Options(find_target(DEFAULT_TARGET), 2))


class Days(RuleBasedStateMachine):
    """`values`: of each kind of variable what may be saved, and last what it is. `initialised`: a program that failed
    before, or waits by the policy, is not, after a power cut, until it is started. `failed`: an exception happened
    since the last download."""

    passed = 0  # ms of virtual time in all examples

    @initialize()
    def begin(self) -> None:
        first = built(0)
        self.plc = Simulator(first.image, first.symbols)
        self.values = {kind: [INITIAL] for kind in NAMES}
        self.number = self.cycles = 0
        self.is_first_run = True
        self.initialised = True
        self.policy, self.failed = "always", False

    def teardown(self) -> None:
        if hasattr(self, "plc"):
            if self.is_running():
                self.time_passes(LAST_HOURS * HOUR * CYCLE)
            assert set(self.plc.files()) <= {"Settings.cfg"}
            assert self.plc._core.lib.SimFlashViolations() == 0
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

    def denies(self, event: str) -> bool:
        """True if the program answers the event, and denies it."""
        if not self.initialised or self.state is AppState.EXCEPTION:
            return False
        return self.says_no_to(event)

    def says_no_to(self, event: str) -> bool:
        """The same, also of a program that has not begun."""
        return bool(self.plc.read("denied") >> DENIED.index(event) & 1)

    def forbids(self, operation: str) -> bool:
        return operation in self.plc.status().forbidden

    def done(self, operate: Callable[[], object], *refusals: bool) -> bool:
        """Operates, which is refused if one of the refusals holds, and only then."""
        if not any(refusals):
            operate()
            return True
        with pytest.raises(DeviceError) as caught:
            operate()
        assert caught.value.result == lib.ERR_OPERATION_DENIED
        return False

    def is_stopped(self) -> bool:
        """Stops the program, if it does not refuse that."""
        done = self.done(self.plc.stop, self.forbids("stop"), self.denies("DenyStop"))
        if done:
            self.saved()
        return done

    def is_started(self) -> bool:
        """Starts the program, if it does not deny that. One that waits gets its initial values before."""
        denied = self.says_no_to("DenyStart")
        if not self.initialised:
            self.values["VAR"], self.cycles, self.initialised = [INITIAL], 0, True
        done = self.done(self.plc.start, denied)
        self.is_first_run = self.is_first_run or done
        return done

    def power_is_back(self) -> None:
        """What the policy and the program say of the start."""
        denied = self.says_no_to("DenyStartBootproject")
        waits = self.policy == "never" or denied
        if waits:
            assert self.state is AppState.STOP or (self.failed and self.state is AppState.EXCEPTION)
        elif not self.failed:
            assert self.state is AppState.RUN
        self.initialised = self.state is AppState.RUN or (denied and self.is_initialised())
        if self.state is AppState.EXCEPTION:
            self.plc.reset("warm")
            self.happens("exception, reset warm")
            self.initialised = True

    def is_initialised(self) -> bool:
        return bool(self.plc.read("Main.started") == INITIAL)

    def saved(self) -> None:
        self.values = {kind: known[-1:] for kind, known in self.values.items()}

    # ---- what happens ----

    @rule(ms=st.one_of(st.integers(1, 100), st.integers(HOUR, 24 * HOUR)).map(CYCLE.__mul__))
    def time_passes(self, ms: int) -> None:
        was_running = self.is_running()
        self.plc.run_for(ms)
        if was_running:
            now = self.plc.read("Main.cycles")
            assert now - self.cycles - ms // CYCLE in ((0, 1) if self.is_first_run else (0,))
            self.cycles, self.is_first_run = now, False
            Days.passed += ms
        if ms >= SAVED_AFTER:
            self.saved()

    @rule(kind=st.sampled_from(sorted(NAMES)), value=st.integers(-(2**31), 2**31 - 1))
    def a_tool_writes(self, kind: str, value: int) -> None:
        self.plc.write({NAMES[kind]: value})
        self.values[kind].append(value)

    @rule(denied=st.integers(0, 15), forbidden=st.integers(0, 7))
    def the_program_denies_and_forbids(self, denied: int, forbidden: int) -> None:
        self.plc.write({"denied": denied, "forbidden": forbidden})
        self.time_passes(SAVED_AFTER)

    @rule(policy=st.sampled_from(POLICIES))
    def a_policy_is_set(self, policy: str) -> None:
        """It counts from the next start on."""
        self.plc.put_file("Settings.cfg", f"[CmpApp]\nBootproject.Start={policy}\n".encode())
        self.policy = policy

    @precondition(is_running)
    @rule()
    def stop_and_start(self) -> None:
        if self.is_stopped() and self.is_started():
            self.happens("stop, start")

    @precondition(is_running)
    @rule()
    def stop(self) -> None:
        self.is_stopped()

    @precondition(lambda self: hasattr(self, "plc") and self.state is AppState.STOP)
    @rule()
    def start(self) -> None:
        self.is_started()

    @rule(option=st.sampled_from(("warm", "cold")), start=st.booleans())
    def reset(self, option: str, start: bool) -> None:
        reset = partial(self.plc.reset, option)
        if not self.done(reset, self.forbids("reset"), self.is_running() and self.denies("DenyStop")):
            return
        self.happens(f"reset {option}")
        self.initialised = True
        if start and self.state is not AppState.RUN:
            self.is_started()

    @precondition(is_running)
    @rule()
    def the_program_fails(self) -> None:
        """One that has not proven itself would give way to the previous one."""
        self.time_passes(PROVEN_AFTER)
        self.plc.write({"Main.trip": True})
        self.plc.run_cycles(2, check=False)
        assert self.state is AppState.EXCEPTION
        assert self.plc.status().forbidden == []
        self.plc.reset("warm")
        self.happens("exception, reset warm")
        self.failed = True

    @rule()
    def the_power_fails(self) -> None:
        before = {kind: list(known) for kind, known in self.values.items()}
        assert self.plc._core.lib.SimStart() == self.plc._core.lib.ERR_OK
        self.happens("power off and on")
        for kind in ("RETAIN", "PERSISTENT"):
            seen = self.plc.read(NAMES[kind])
            assert seen in before[kind]
            self.values[kind] = [seen]
        self.power_is_back()

    @rule()
    def the_power_fails_with_a_warning(self) -> None:
        self.plc.restart()
        self.happens("power off and on")
        self.saved()
        self.power_is_back()

    @rule(further=st.integers(1, 3), start=st.booleans())
    def download(self, further: int, start: bool) -> None:
        number = (self.number + further) % 4
        program = built(number)
        start = start and not self.says_no_to("DenyStart")
        if not self.done(partial(self.plc.flash, program.image, start=start, force=True), *self.refuses_download()):
            return
        self.number = number
        self.plc.add_symbols(program.symbols)
        self.happens("download")
        self.saved()
        self.initialised, self.failed = True, False

    def refuses_download(self) -> tuple[bool, ...]:
        return (
            self.forbids("download"),
            self.denies("PrepareDownload"),
            self.is_running() and self.denies("DenyStop"),
        )

    @precondition(is_running)
    @rule(number=st.integers(0, 3))
    def a_download_fails_and_is_rolled_back(self, number: int) -> None:
        self.time_passes(SAVED_AFTER)  # the program is one that has run
        crc = self.plc.status().image_crc
        flash = partial(self.plc.flash, built(number, fails=True).image, start=False, force=True)
        if not self.done(flash, *self.refuses_download()):
            return
        assert self.state is AppState.EXCEPTION
        assert self.plc._core.lib.SimStart() == self.plc._core.lib.ERR_OK
        assert self.plc.status().image_crc == crc
        self.happens("download, rolled back")
        self.failed = True
        self.power_is_back()

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
    shorter = settings(max_examples=max(settings().max_examples // 4, 40), stateful_step_count=40, deadline=None)
    Days.passed = 0
    run_state_machine_as_test(Days, settings=shorter)
    assert Days.passed >= HOURS * HOUR * CYCLE
