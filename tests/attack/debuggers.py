"""A hostile debugger on plcrt: traps anywhere, lists and conditions without sense, and its end in each state."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from campaign import NEWEST, STOPPED, Case
from hostile_tools import PROGRAM, Attack, HostileTools
from look import expect_running
from process import Runtime, eventually

sys.path.append(str(Path(__file__).resolve().parents[1]))

from hostile_debugger import CODE, act

import plctool
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import PlcError
from plctool.link.services import AppState

ACTIONS = 40
GONE_S = 7.0  # more than BP_ALIVE_MS
KILLED = "is killed after so many requests of a session"


class Debuggers(HostileTools):
    name = "debugger"
    promise = "after a debugger has gone, the program runs on, or is stopped with the cause in the log"
    short = 6
    tool = "a debugger"
    ends = ("detaches", "vanishes", "vanishes while it is halted")

    def cases(self) -> list[Case]:
        killed = [Attack(number, KILLED) for number in range(1, REQUESTS + 1)]
        return super().cases() + [Case(f"a debugger killed after request {a.seed} of a session", a) for a in killed]

    def attacked(self, attack: Attack, runtime: Runtime) -> str:
        with suppress(PlcError), plctool.connect(f"serial:{runtime.port}") as plc:
            _debug(plc, attack)

        gone_by = time.monotonic() + (0 if attack.end == "detaches" else GONE_S)

        def is_alone() -> bool | None:
            state = runtime.ask(lambda plc: plc.status().state, "after the debugger had gone")
            return True if state != AppState.HALTED and time.monotonic() > gone_by else None

        eventually(is_alone, "the program is still halted after its debugger has gone")
        seen = runtime.look("after the debugger had gone")
        outcome = NEWEST
        if seen.exception and seen.causes:
            outcome = STOPPED
        else:
            expect_running(seen, self.shop, (PROGRAM,))
        runtime.check_can_be_flashed()
        return outcome


def _debug(plc: Plc, attack: Attack) -> None:
    if attack.end == KILLED:
        _be_killed(plc, attack.seed)
        return
    chooser = random.Random(attack.seed)
    debugger = plc.breakpoints
    target = debugger._target
    for _ in range(ACTIONS):
        with suppress(PlcError):
            act(target, chooser)
    if attack.end == "detaches":
        debugger.close()
        return
    if attack.end.endswith("halted"):
        with suppress(PlcError):
            target.set(0, 0, None)
            target.temporary(range(0, CODE, 2))
            target.pause()
    plc._connection.close()  # nothing more is said: it is gone


REQUESTS = 12


def _session(plc: Plc) -> Iterator[None]:
    """One request at a time: the program runs, is halted, is looked at, steps, is halted again, and goes on."""
    target = plc.breakpoints._target  # it attaches
    yield
    yield target.set(0, 1, None)
    yield target.watch((), range(0, 64, 2))
    with suppress(PlcError):  # up to the end of the code
        target.temporary(range(0, CODE, 2))
    yield
    yield target.pause()
    eventually(lambda: target.status().halted or None, "no task halts")
    yield
    target.read_stack(0, 4)
    yield
    yield target.write_stack(0, target.read_stack(0, 4))
    yield target.go(int(lib.BP_STEP), target.status().serial)
    yield target.go(int(lib.BP_STEP_OUT), target.status().serial)
    yield target.go(int(lib.BP_GO), target.status().serial)
    yield target.clear(0)


def _be_killed(plc: Plc, request: int) -> None:
    """The line is closed after that many requests."""
    session = _session(plc)
    for _ in range(request):
        next(session)
    plc._connection.close()
